"""From when on a run is judged."""

import numpy as np
import pytest

from experiments.results.feature import converged_after
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
