"""Tables, figures and report page of a margin analysis, and its class for scripts."""

import html
import math
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from rich.markup import escape
from rich.table import Table

from diagrams.scenario import Scenario
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile
from experiments.studies.margins.analysis import analyse
from experiments.studies.margins.box import ErrorBox
from experiments.studies.margins.result import Case, MarginAnalysis
from experiments.studies.margins.texts import (
    GOOD_DAMPING,
    GOOD_DISC,
    margins_json,
    metrics_of,
    sentences,
)
from pfsc_drake.yaml.dumping import dump_typed
from pfsc_drake.yaml.typed import load_typed
from reporting.folder import check_folder, open_results
from reporting.metrics import Metrics
from reporting.notebook import metrics_table
from reporting.page import Page, Report
from reporting.progress import ProgressListener
from reporting.provenance import standard_attributes
from reporting.style import (
    ALERT,
    COLOURS,
    REFERENCE,
    STYLE,
    WIDTH,
    Drawing,
    Figure,
    add_legend,
    render,
)

# 1/s; faster modes are not shown, since they would compress the scale
_FASTEST = 400.0
_DAMPING_LINES = (0.1, 0.3, 0.7)


@dataclass(frozen=True)
class Margins:
    """Stability margins of a sampled loop: sentences, metrics and figures.

    Attributes:
        name: Name of the scenario.
        analysis: Modes of the loop along the path, with each model error, and margins.
    """

    name: str
    analysis: MarginAnalysis

    @property
    def is_stable(self) -> bool:
        """Whether the loop is stable everywhere with a perfect model."""
        return self.analysis.nominal.is_stable

    @property
    def is_robust(self) -> bool:
        """Whether it is also stable with all requested model errors."""
        return all(case.is_stable for case in self.analysis.cases)

    @property
    def sentences(self) -> list[str]:
        """Summary in sentences, the most important first."""
        return sentences(self.analysis)

    @property
    def metrics(self) -> Metrics:
        """Metrics by name."""
        return metrics_of(self.analysis)

    @property
    def figures(self) -> dict[str, Figure]:
        """Figures by name, each with ``png`` and ``caption``; a notebook shows them."""
        return {figure.name: figure for figure in draw_margins(self.analysis)}

    def _repr_html_(self) -> str:
        """Return sentences and metrics."""
        items = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in self.sentences)
        title = f"<b>Margins of {html.escape(self.name)}</b>"
        return f"{title}<ul>{items}</ul>{metrics_table(self.metrics)}"


def draw_margins(analysis: MarginAnalysis) -> list[Figure]:
    """Return the figures of an analysis: modes, rates along the path, margins of the drives.

    Args:
        analysis: The analysis.
    """
    with plt.rc_context(STYLE):
        drawings = [_modes(analysis), _along(analysis)]
        if analysis.margins:
            drawings.append(_drives(analysis))
        return [render(drawing) for drawing in drawings]


def _modes(analysis: MarginAnalysis) -> Drawing:
    """Draw the modes in the complex plane."""
    canvas = Canvas(figsize=(WIDTH, 4.8))
    panel = canvas.subplots()
    _scatter(panel, analysis.singles + analysis.corners, COLOURS[4], "with model errors", 10.0)
    moving = [point for point in analysis.nominal.points if point.instant.speed]
    resting = [point for point in analysis.nominal.points if not point.instant.speed]
    nominal, error = analysis.nominal, analysis.nominal.error
    _scatter(panel, [Case(error, "", moving)], COLOURS[0], "nominal, moving", 16.0)
    _scatter(panel, [Case(error, "", resting)], COLOURS[2], "nominal, at rest", 16.0)
    shown = [point.modes for case in analysis.cases for point in case.points if point.modes]
    rates = np.concatenate([m.rate for m in shown]) if shown else np.zeros(1)
    frequencies = np.concatenate([m.frequency for m in shown]) if shown else np.zeros(1)
    near = rates > -_FASTEST
    right = max(float(np.max(rates, initial=0.0)) * 1.15, 0.06 * _FASTEST)
    left = -1.05 * min(_FASTEST, max(float(np.max(-rates[near], initial=50.0)), 50.0))
    top = max(float(np.max(frequencies[near], initial=0.0)) / (2.0 * np.pi) * 1.1, 5.0)
    panel.set(xlim=(left, right), ylim=(-0.02 * top, top))
    panel.axvspan(0.0, right, color=ALERT, alpha=0.08, linewidth=0.0)
    panel.axvline(0.0, color=ALERT, linewidth=1.2)
    for damping in _DAMPING_LINES:
        slope = np.sqrt(1.0 - damping**2) / damping / (2.0 * np.pi)
        end = min(-left, top / slope)
        panel.plot([0.0, -end], [0.0, end * slope], ":", color=REFERENCE, linewidth=1.0, zorder=0)
        panel.annotate(f"{damping:g}", (-0.97 * end, 0.97 * end * slope), color=REFERENCE, size=9)
    panel.set_xlabel("real part in 1/s")
    panel.set_ylabel("frequency in Hz")
    panel.set_title("Modes of the sampled loop")
    add_legend(panel)
    unstable = sum(not case.is_stable for case in analysis.cases)
    verdict = "All are stable" if not unstable else f"{unstable} of the loops are unstable"
    caption = (
        f"Eigenvalues of the sampled loop, log(lambda) / T_s, of {len(analysis.cases)} loops at "
        f"{len(nominal.points)} points of the path. {verdict}. Dotted: damping ratios; a "
        f"well-damped loop is below the line {GOOD_DAMPING:g}. Faster modes are not shown."
    )
    return Drawing("modes", "Modes", caption, canvas)


def _scatter(panel: Axes, cases: list[Case], colour: str, label: str, size: float) -> None:
    modes = [point.modes for case in cases for point in case.points if point.modes is not None]
    if not modes:
        return
    rate = np.concatenate([m.rate for m in modes])
    frequency = np.concatenate([m.frequency for m in modes]) / (2.0 * np.pi)
    panel.scatter(rate, frequency, s=size, color=colour, label=label, alpha=0.7, linewidths=0.0)


def _along(analysis: MarginAnalysis) -> Drawing:
    """Draw the slowest rate along the path, nominal and with single parameter errors."""
    canvas = Canvas(figsize=(WIDTH, 3.6))
    panel = canvas.subplots()
    corners = analysis.corners
    for number, case in enumerate(corners):
        times, rates = _rates(case)
        label = "all errors" if number == 0 else None
        panel.plot(times, rates, "x", color=REFERENCE, markersize=5, label=label)
    for colour, (_, case) in zip(COLOURS[1:], analysis.worst_by_key.items(), strict=False):
        times, rates = _rates(case)
        panel.plot(times, rates, "o-", color=colour, markersize=4, label=str(case.error))
    times, rates = _rates(analysis.nominal)
    panel.plot(times, rates, "o-", color=COLOURS[0], markersize=5, label="nominal")
    panel.axhline(0.0, color=ALERT, linewidth=1.2)
    low, high = panel.get_ylim()
    panel.set_ylim(low, max(high, 0.08 * abs(low)))
    panel.axhspan(0.0, panel.get_ylim()[1], color=ALERT, alpha=0.08, linewidth=0.0)
    top = panel.get_ylim()[1]
    for point in analysis.nominal.points:
        words = "rest" if not point.instant.speed else f"{abs(point.instant.speed):.2g}"
        panel.annotate(words, (point.instant.time, top), ha="center", va="bottom", size=8)
    panel.set_xlabel("time in s; top: speed in m/s")
    panel.set_ylabel("slowest rate in 1/s")
    panel.legend(loc="best", fontsize=9)
    caption = (
        "Rate of the slowest mode along the path: unstable above zero. For each parameter error "
        "the "
        "worse sign is shown; crosses: errors in all parameters."
    )
    return Drawing("along_the_path", "Along the path", caption, canvas)


def _rates(case: Case) -> tuple[np.ndarray, np.ndarray]:
    times = np.array([point.instant.time for point in case.points])
    rates = np.array([point.rate for point in case.points])
    return times, np.where(np.isfinite(rates), rates, np.nan)


def _drives(analysis: MarginAnalysis) -> Drawing:
    """Draw the disc margin of each drive, with its range along the path."""
    canvas = Canvas(figsize=(WIDTH, 3.6))
    panel = canvas.subplots()
    alpha = np.array([[m.alpha for m in margins.drives] for margins in analysis.margins])
    worst = np.argmin(alpha, axis=0)
    names = [*analysis.joints, "all drives"]
    common = np.array([margins.common.alpha for margins in analysis.margins])
    smallest = np.append(alpha.min(axis=0), common.min())
    largest = np.append(alpha.max(axis=0), common.max())
    where = [analysis.margins[i].instant for i in [*worst.tolist(), int(np.argmin(common))]]
    points = np.arange(len(names))
    colours = [COLOURS[0]] * len(analysis.joints) + [COLOURS[2]]
    panel.bar(points, smallest, width=0.6, color=colours)
    panel.vlines(points, smallest, largest, color=REFERENCE, linewidth=2.0)
    panel.axhline(GOOD_DISC, color=REFERENCE, linestyle=":", linewidth=1.0)
    for x, height, instant in zip(points, largest, where, strict=True):
        percent = 100.0 * 2.0 * smallest[x] / max(2.0 - smallest[x], 1e-9)
        text = f"+{percent:.3g} %\n{instant.time:.2f} s" if smallest[x] < 2.0 else "any"
        panel.annotate(text, (x, height), ha="center", va="bottom", size=9)
    panel.set_xticks(points, names, rotation=20, ha="right")
    panel.set_ylim(0.0, 1.3 * max(float(np.max(largest)), 0.1))
    panel.set_ylabel("disc margin")
    panel.margins(x=0.03)
    caption = (
        "Smallest disc margin of each drive along the path, with the tolerated gain error there "
        "and "
        f"the time; grey line: range to the largest one. A disc margin of {GOOD_DISC:g} (dotted) "
        "tolerates a factor of 2.2 or 41 degrees. Exact linearization of elastic joints has small "
        "margins: it relies on accurate drive torques."
    )
    return Drawing("drives", "Margins of the drives", caption, canvas)


def point_table(analysis: MarginAnalysis) -> Table:
    """Return a table with a row for each analysed point of the path.

    Args:
        analysis: The analysis.
    """
    table = _table("t in s", "eta in m", "m/s", "1/s", "damping", "in the box", "disc margin")
    table.add_column("of", no_wrap=True)
    table.add_column("delay", justify="right", no_wrap=True)
    margins = {item.instant.time: item for item in analysis.margins}
    for number, point in enumerate(analysis.nominal.points):
        instant = point.instant
        box = max((case.points[number].rate for case in analysis.singles), default=point.rate)
        row = [
            f"{instant.time:.3f}",
            " ".join(f"{value:.2f}" for value in instant.eta),
            f"{abs(instant.speed):.2f}",
        ]
        row += [_rate(point.rate), f"{point.damping:.2f}"]
        row.append(_rate(box))
        own = margins.get(instant.time)
        if own is not None:
            weakest = min(range(len(own.drives)), key=lambda i: own.drives[i].alpha)
            row += [f"{own.smallest:.3g}", escape(analysis.joints[weakest]), f"{own.delay}"]
        table.add_row(*row)
    return table


def case_table(analysis: MarginAnalysis) -> Table:
    """Return a table with a row for each analysed model error.

    Args:
        analysis: The analysis.
    """
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column("Model error")
    table.add_column("slowest in 1/s", justify="right", no_wrap=True)
    table.add_column("where")
    for case in analysis.cases:
        table.add_row(str(case.error), _rate(case.worst.rate), case.worst.instant.location)
    return table


def summary(analysis: MarginAnalysis) -> str:
    """Return the summary, one paragraph per sentence.

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


def write_margins(
    scenario: ScenarioFile, out: Path, box: ErrorBox, progress: ProgressListener
) -> tuple[MarginAnalysis, Report]:
    """Analyse a scenario's margins and write ``margins.json`` and the page.

    Args:
        scenario: The scenario as read.
        out: Folder for the results.
        box: Model errors to tolerate.
        progress: Progress listener.

    Returns:
        The analysis and the page.

    Raises:
        InputError: If the scenario is wrong or the folder cannot be used.
    """
    inputs = scenario.inputs()
    check_folder(out, "margins", inputs)
    settings = load_typed(Scenario, scenario.data, scenario.source)
    with naming(scenario.source):
        analysis = analyse(settings, scenario.path.parent, box, progress)
    with open_results(out, "margins", inputs) as results:
        results.write("margins.json", margins_json(analysis))
        page = Page(
            kind="Sampled loop",
            title=f"Margins of {scenario.name}",
            description=" ".join(sentences(analysis)),
            scenario_yaml_text=dump_typed(settings),
            metrics=metrics_of(analysis),
            figures=draw_margins(analysis),
            log_attributes=standard_attributes(scenario.name),
        )
        return analysis, page.write(results)
