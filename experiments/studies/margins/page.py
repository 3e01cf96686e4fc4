"""From a scenario to its margins in a table and on one page."""

import math
from dataclasses import dataclass
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from diagrams.scenario import Scenario
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile
from experiments.studies.margins.analysis import analyse
from experiments.studies.margins.box import ErrorBox
from experiments.studies.margins.picture import draw_margins
from experiments.studies.margins.result import MarginAnalysis
from experiments.studies.margins.words import margins_json, metrics_of, sentences
from pfsc_drake.yaml.typed import dump_typed, load_typed
from reporting.folder import check_folder, open_results
from reporting.page import Report, report_page, write_report
from reporting.progress import ProgressListener
from reporting.provenance import standard_attributes


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


@dataclass(frozen=True)
class MarginsOutcome:
    """What an analysis left.

    Attributes:
        analysis: The analysis.
        report: The page.
    """

    analysis: MarginAnalysis
    report: Report


def write_margins(
    scenario: ScenarioFile, out: Path, box: ErrorBox, progress: ProgressListener
) -> MarginsOutcome:
    """Analyse a scenario's margins and write ``margins.json`` and the page.

    Args:
        scenario: The scenario as read.
        out: Folder for the results.
        box: Model errors that are to be borne.
        progress: Told how far it is.

    Raises:
        InputError: If the scenario is wrong or the folder cannot be used.
    """
    inputs = scenario.inputs()
    check_folder(out, "margins", inputs)
    settings = load_typed(Scenario, scenario.data, str(scenario.path))
    with naming(scenario.path):
        analysis = analyse(settings, scenario.path.parent, box, progress)
    with open_results(out, "margins", inputs) as results:
        results.write("margins.json", margins_json(analysis))
        figures = draw_margins(analysis)
        page = report_page(
            kind="Sampled loop",
            title=f"Margins of {scenario.name}",
            description=" ".join(sentences(analysis)),
            scenario_yaml_text=dump_typed(settings),
            metrics=metrics_of(analysis),
            figures=figures,
            log_attributes=standard_attributes(scenario.name),
        )
        return MarginsOutcome(analysis, write_report(results, figures, page))
