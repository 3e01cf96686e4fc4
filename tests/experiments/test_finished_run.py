"""From when on a run is judged."""

from unittest.mock import MagicMock

import numpy as np
import pytest

from experiments import finished_run
from experiments.finished_run import converged_after
from experiments.results.run_log import RunLog
from tests.scenarios import shipped_scenario


@pytest.mark.parametrize(("transition", "begin"), [(0.0, 0.6), (0.2, 0.6), (0.8, 0.8)])
def test_a_tool_that_goes_over_to_the_path_is_not_beside_it_yet(transition, begin):
    """As one does that is driven, whose start is smooth by itself."""
    settings = shipped_scenario("pfc_turntable")
    assert settings.reference.dwell == 0.6
    settings.start.transition = transition
    assert converged_after(settings, RunLog(np.zeros(0))) == begin


def test_a_tool_that_waits_comes_to_its_path_later():
    """It loses 0.4 s from 0.1 s on; one that still waits has not come."""
    settings, time = shipped_scenario("pfc_turntable"), np.linspace(0.0, 2.0, 201)
    log = RunLog(time)
    log.add("time_lost", np.clip(time - 0.1, 0.0, 0.4))
    assert converged_after(settings, log) == pytest.approx(1.0)
    log = RunLog(time)
    log.add("time_lost", np.maximum(time - 0.1, 0.0))
    assert converged_after(settings, log) == np.inf


def test_a_meshcat_that_is_ended_from_outside_is_replaced(monkeypatch):
    meshcats, ends = [], 2

    def record(diagram, meshcat, duration, period):
        meshcats.append(meshcat)
        if len(meshcats) <= ends:
            raise RuntimeError("the Meshcat thread has ended")
        return "page"

    monkeypatch.setattr(finished_run, "hidden_meshcat", object)
    monkeypatch.setattr(finished_run, "build_station_replay", lambda *arguments: None)
    monkeypatch.setattr(finished_run, "record", record)
    prepared = MagicMock(station=MagicMock(mounting=None))
    motion = MagicMock(times=[0.0, 1.0])
    assert finished_run._recording(prepared, motion) == "page"
    assert len(set(map(id, meshcats))) == 3
    meshcats.clear()
    ends = 3
    with pytest.raises(RuntimeError, match="has ended"):
        finished_run._recording(prepared, motion)
    assert len(meshcats) == 3
