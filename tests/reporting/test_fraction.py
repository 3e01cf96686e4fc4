"""Progress of what knows the fraction done, where there is no terminal."""

import io

from rich.console import Console

from reporting.fraction import fraction_display


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
    told = lines([(k / 1000.0, "looking") for k in range(1001)])
    assert 10 <= len(told) <= 12
    assert told[0] == "search: looking, 0%"


def test_words_are_not_markup():
    assert lines([(0.5, "link [bold]")]) == ["search: link [bold], 50%"]
