"""How long the longest run is."""

from types import SimpleNamespace

import pytest

from experiments import preparation
from experiments.preparation import MAX_FRAMES, MAX_TICKS, check_frames, check_length
from pfsc_drake import InputError

STATION = SimpleNamespace(
    controller=SimpleNamespace(period=1e-3),
    log=SimpleNamespace(rows={"a": slice(0, 60), "b": slice(60, 100)}),
)


@pytest.fixture(autouse=True)
def much_memory(monkeypatch):
    monkeypatch.setattr(preparation, "_MEMORY", 1e11)


@pytest.mark.parametrize(
    ("duration", "time", "memory"),
    [
        (1.1e3, "3.67 minutes", "7.04 GB"),
        (1e5, "5.56 hours", "640 GB"),
        (1e7, "23.1 days", "6.4e+04 GB"),
        (float("inf"), "inf years", "inf GB"),
    ],
)
def test_too_long(duration, time, memory):
    with pytest.raises(InputError, match="sampling intervals") as caught:
        check_length(SimpleNamespace(duration=duration), STATION)
    for part in (time, memory, f"duration = {duration:g} s", "up to 1000 s"):
        assert part in str(caught.value)


def test_long_enough():
    check_length(SimpleNamespace(duration=MAX_TICKS * 1e-3), STATION)
    with pytest.raises(InputError, match="sampling intervals"):
        check_length(SimpleNamespace(duration=(MAX_TICKS + 1) * 1e-3), STATION)


def test_too_many_frames():
    check_frames(MAX_FRAMES * 0.032, 0.032)
    with pytest.raises(
        InputError, match=r"frame_period = 0\.001 s: 1e\+06 frames in 1000 s"
    ) as caught:
        check_frames(1000.0, 1e-3)
    assert "frame_period from 0.02 s on" in str(caught.value)


def test_no_run_takes_more_memory_than_there_is(monkeypatch):
    # of a row of numbers, eight copies of 8 bytes: what is there suffices for 100 intervals
    numbers = sum(rows.stop - rows.start for rows in STATION.log.rows.values())
    monkeypatch.setattr(preparation, "_MEMORY", 100 * 64 * numbers)
    check_length(SimpleNamespace(duration=0.1), STATION)
    with pytest.raises(InputError, match=r"duration = 0\.102 s: .* allowed: up to 0\.1 s"):
        check_length(SimpleNamespace(duration=0.102), STATION)
