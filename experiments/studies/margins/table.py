"""An analysis of margins on the terminal."""

import math

from rich.markup import escape
from rich.table import Table

from experiments.studies.margins.result import MarginAnalysis
from experiments.studies.margins.words import sentences


def place_table(analysis: MarginAnalysis) -> Table:
    """Return a line for every place that was looked at.

    Args:
        analysis: The analysis.
    """
    table = _table("t in s", "eta in m", "m/s", "1/s", "damping", "in the box", "disc margin")
    table.add_column("of", no_wrap=True)
    table.add_column("delay", justify="right", no_wrap=True)
    margins = {item.instant.time: item for item in analysis.margins}
    for number, place in enumerate(analysis.nominal.places):
        instant = place.instant
        box = max((case.places[number].rate for case in analysis.singles), default=place.rate)
        row = [
            f"{instant.time:.3f}",
            " ".join(f"{value:.2f}" for value in instant.eta),
            f"{abs(instant.speed):.2f}",
        ]
        row += [_rate(place.rate), f"{place.damping:.2f}"]
        row.append(_rate(box))
        own = margins.get(instant.time)
        if own is not None:
            weakest = min(range(len(own.drives)), key=lambda i: own.drives[i].alpha)
            row += [f"{own.smallest:.3g}", escape(analysis.joints[weakest]), f"{own.delay}"]
        table.add_row(*row)
    return table


def case_table(analysis: MarginAnalysis) -> Table:
    """Return a line for every model error that was tried.

    Args:
        analysis: The analysis.
    """
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column("Model error")
    table.add_column("slowest in 1/s", justify="right", no_wrap=True)
    table.add_column("where")
    for case in analysis.cases:
        table.add_row(str(case.error), _rate(case.worst.rate), case.worst.instant.place)
    return table


def summary(analysis: MarginAnalysis) -> str:
    """Return what there is to say, one paragraph each.

    Args:
        analysis: The analysis.
    """
    return "\n".join(escape(sentence) for sentence in sentences(analysis))


def _table(*columns: str) -> Table:
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    return table


def _rate(rate: float) -> str:
    if math.isinf(rate):
        return "[red]fault[/]"
    return f"[red]{rate:+.1f}[/]" if rate > 0.0 else f"{rate:+.1f}"
