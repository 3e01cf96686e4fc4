"""What is kept of a person's controls, and where."""

import os
from types import SimpleNamespace

import numpy as np
import pytest

from diagrams.environment.operator import idle_controls
from experiments.live.live_simulation import _ticks_per_step
from experiments.live.takes import ControlRecord, TakeFolders
from experiments.simulation import chunk_ticks
from pfsc_drake.errors import InputError


def operator_at(period):
    """Return an operator without regions whose panel is sampled."""
    panel = SimpleNamespace(period=period)
    return SimpleNamespace(idle=idle_controls([]), regions=[], panel=panel)


def test_only_changes_are_kept_even_those_of_a_sign():
    record = ControlRecord(operator_at(2e-3))
    pushed = idle_controls([])
    pushed[1] = 5.0
    negative = idle_controls([])
    negative[0] = -0.0
    for tick, controls in [(0, idle_controls([])), (10, pushed), (20, pushed), (30, negative)]:
        record.note(tick, controls)
    lines = record.text().splitlines()[1:]
    assert [line.split(",")[0] for line in lines] == ["0", "0.02", "0.06"]
    assert lines[-1].split(",")[1] == "-0"


def test_what_is_set_before_the_first_tick_counts_from_there():
    record = ControlRecord(operator_at(2e-3))
    pushed = idle_controls([])
    pushed[2] = 0.1
    record.note(0, pushed)
    lines = record.text().splitlines()[1:]
    assert len(lines) == 1
    assert lines[0].startswith("0,0,0,0.1,0,")


def test_takes_of_earlier_sessions_stay(tmp_path):
    (tmp_path / "out" / "take_1").mkdir(parents=True)
    assert TakeFolders(tmp_path / "out", "run", []).next() == tmp_path / "out" / "take_2"


def test_a_folder_that_cannot_be_is_refused(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="file is no folder"):
        TakeFolders(tmp_path / "file" / "out", "run", [])


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(InputError, match="cannot be written"):
        TakeFolders(tmp_path / "locked" / "out", "run", [])


@pytest.mark.parametrize("period", [1e-4, 5e-4, 1e-3, 2e-3, 3e-3, 4e-3, 0.02])
def test_steps_divide_what_a_run_looks_at_together(period):
    ticks = _ticks_per_step(period)
    assert chunk_ticks(period) % ticks == 0
    assert ticks == 1 or ticks * period <= 0.01 + 1e-12
    assert np.isclose(period, 3e-3) or ticks * period >= 0.004
