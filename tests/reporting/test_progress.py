"""Progress display: plain lines at even distances, a bar on a terminal."""

import io

import pytest
from rich.console import Console

from reporting.progress import ProgressDisplay, fraction_display


def plain_lines(duration: float | None, step: float, count: int) -> list[str]:
    """Lines for a run whose times are sums of a step, as a simulation reports them."""
    stream = io.StringIO()
    with ProgressDisplay(Console(file=stream, width=200), "x", duration) as progress:
        time = 0.0
        for _ in range(count + 1):
            progress(time, "simulating")
            time += step
    return stream.getvalue().splitlines()


@pytest.mark.parametrize("step", [1e-3, 1e-2, 0.1])
def test_ten_lines_however_the_sums_round(step):
    lines = plain_lines(2.0, step, round(2.0 / step))
    assert lines[0] == "x: simulating"
    times = [float(line.split()[2]) for line in lines[1:]]
    assert times == pytest.approx([0.2 * i for i in range(1, 11)])


def test_unknown_duration_gives_a_line_per_second():
    lines = plain_lines(None, 0.25, 12)
    assert [line.split()[2] for line in lines[1:]] == ["1.00", "2.00", "3.00"]
    assert " of " not in lines[1]


def test_terminal_shows_a_bar_with_the_title_as_it_is():
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=True, width=120)
    with ProgressDisplay(console, "[red]x", 1.0) as progress:
        progress(0.0, "simulating")
        progress(0.5, "simulating")
        progress(0.0, "drawing figures")
        assert progress.simulated_time == 0.5
    assert "[red]x" in stream.getvalue()
    assert "drawing figures" in stream.getvalue()


def test_a_position_of_work_has_no_rate():
    """Each phase begins anew, and jumps in it are no speed."""
    stream = io.StringIO()
    with ProgressDisplay(Console(file=stream, width=200), "x", 4.0, paced=False) as progress:
        progress(4.0, "walking")
        for time in (0.0, 2.0, 4.0):
            progress(time, "linearizing, masses +5 %")
    lines = stream.getvalue().splitlines()
    assert not any("real time" in line for line in lines)
    assert "x: linearizing, masses +5 %, t = 2.00 of 4.00 s" in lines


def test_a_phase_that_goes_back_has_its_own_rate(monkeypatch):
    """A run of 4 s is repeated in 2 s: at twice its rate, and from its start on."""
    clock = iter([*[0.0] * 3, *[4.0] * 2, *[5.0] * 2, *[6.0] * 2])
    monkeypatch.setattr("reporting.progress.time.monotonic", lambda: next(clock))
    stream = io.StringIO()
    with ProgressDisplay(Console(file=stream, width=200), "x", 4.0) as progress:
        progress(0.0, "driving")
        progress(4.0, "driving")
        for time in (0.0, 2.0, 4.0):
            progress(time, "repeating the run")
        assert progress.simulated_time == 4.0
    last = stream.getvalue().splitlines()[-2:]
    assert last == [
        f"x: repeating the run {time:.2f} of 4.00 s, 2.0 x real time" for time in (2.0, 4.0)
    ]


def lines(steps):
    stream = io.StringIO()
    with fraction_display(Console(file=stream, width=100), "search") as tell:
        for fraction, phase in steps:
            tell(fraction, phase)
    return stream.getvalue().splitlines()


def test_a_line_for_each_phase():
    assert lines([(0.0, "preparing"), (0.01, "looking, 1 of 9"), (0.02, "looking, 2 of 9")]) == [
        "search: preparing, 0%",
        "search: looking, 1 of 9, 1%",
    ]


def test_a_line_for_each_tenth_of_a_phase():
    printed = lines([(k / 1000.0, "looking") for k in range(1001)])
    assert 10 <= len(printed) <= 12
    assert printed[0] == "search: looking, 0%"


def test_words_are_not_markup():
    assert lines([(0.5, "link [bold]")]) == ["search: link [bold], 50%"]
