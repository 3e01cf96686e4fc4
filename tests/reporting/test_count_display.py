"""Lines of progress where there is no terminal."""

import io

import pytest
from rich.console import Console

from reporting.progress import CountDisplay, format_time


def lines_of(total, done, statuses, terminal=False):
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=100)
    with CountDisplay(console, "arm", total, done, "completed") as progress:
        progress.processes(2)
        for status in statuses:
            progress.advance(status)
        progress.processes(0)
        progress.processes(0)
    return text.getvalue().splitlines()


def test_ten_lines_with_what_went_wrong():
    *lines, waiting = lines_of(100, 40, ["completed"] * 58 + ["fault", "died"])
    assert lines[0] == "arm: 40 of 100 runs, starting"
    assert [line.split(",")[0] for line in lines[1:]] == [
        f"arm: {done} of 100 runs" for done in (50, 60, 70, 80, 90, 100)
    ]
    assert all(line.endswith(" left") for line in lines[1:-1])
    assert lines[-1] == "arm: 100 of 100 runs, 1 died, 1 fault"
    assert waiting == "arm: no worker is left; waiting for one"


def test_a_bar_on_a_terminal():
    assert "2 of 3 runs, 1 fault" in "".join(lines_of(3, 0, ["completed", "fault"], True))


@pytest.mark.parametrize(
    ("seconds", "spoken"),
    [(0.4, "0 s"), (59.0, "59 s"), (61.0, "1 min 1 s"), (4800.0, "1 h 20 min"), (2e5, "2 d 7 h")],
)
def test_times(seconds, spoken):
    assert format_time(seconds) == spoken


def test_the_time_left_counts_runs_since_processes_started(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("reporting.progress.time.monotonic", lambda: clock[0])
    text = io.StringIO()
    with CountDisplay(Console(file=text, width=100), "arm", 20, 0, "completed") as progress:
        progress.processes(1)
        for _ in range(10):
            clock[0] += 10.0
            progress.advance("completed")
        progress.processes(0)
        clock[0] += 500.0
        progress.processes(1)
        for _ in range(2):
            clock[0] += 10.0
            progress.advance("completed")
    assert text.getvalue().splitlines()[-1] == "arm: 12 of 20 runs, 1 min 20 s left"
