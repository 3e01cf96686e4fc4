"""Recording and further commands at the end of a run."""

from pathlib import Path
from unittest.mock import MagicMock

import pytest

from experiments import finished_run


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


def test_commands_after_a_run_can_be_pasted():
    again, compare = finished_run._further_commands(Path("my out/a"), simulated=True).values()
    assert again == "pfsc run 'my out/a/scenario.yaml' --out OTHER"
    assert compare == "pfsc compare 'my out/a' OTHER"
    (only,) = finished_run._further_commands(Path("a"), simulated=False).values()
    assert only == "pfsc compare a OTHER"
