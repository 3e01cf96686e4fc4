"""The report of a run: one self-contained HTML page."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template
from urllib.parse import quote

from reporting.folder import ResultsFolder
from reporting.metrics import NARROW_SPACE, Metric, Metrics, format_quantity
from reporting.provenance import FIGURES
from reporting.registry import known_metric
from reporting.style import Figure

TEMPLATE = Path(__file__).resolve().parent / "page_template.html"
MAX_CARDS = 8

_SYMBOLS = {"<": "<", "<=": "≤", ">": ">", ">=": "≥"}


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes:
        title: A few words.
        caption: What to see in it, one or two sentences.
        head: Names of the columns.
        rows: Their cells; those that are numbers are set as such.
    """

    title: str
    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str | float]]


@dataclass
class Report:
    """A report as written.

    Attributes:
        path: The page to open; None if it could not be written.
        problem: What could not be written, or None; see ``ResultsFolder.explain_problems``.
    """

    path: Path | None
    problem: str | None


def write_report(results: ResultsFolder, figures: Sequence[Figure], page: str) -> Report:
    """Writes a page and its figures.

    Args:
        results: Folder of the results.
        figures: In reading order.
        page: From :func:`report_page`.
    """
    for figure in figures:
        results.write(f"{FIGURES}/{figure.name}.png", figure.png)
    path = results.write("report.html", page)
    return Report(path, results.explain_problems())


def report_page(
    title: str,
    description: str,
    scenario_yaml_text: str,
    metrics: Metrics,
    figures: Sequence[Figure],
    log_attributes: Mapping[str, str],
    recording: str | None = None,
    fault: str | None = None,
    broken: Sequence[str] = (),
    interrupted: bool = False,
    warnings: Sequence[str] = (),
    diagram_svg: str | None = None,
    kind: str = "Simulation run",
    commands: Mapping[str, str] | None = None,
    cards: Sequence[str] | None = None,
    tables: Sequence[Table] = (),
    details: str = "Scenario as resolved",
) -> str:
    """Returns the page; figures and diagram are inside, only the recording is beside it.

    Args:
        title: Name of the scenario.
        description: What was run, plain text.
        scenario_yaml_text: The scenario as resolved.
        metrics: All of them. Those with a target become cards, or the first few if none has one.
        figures: In reading order.
        log_attributes: What identifies the run, see :mod:`reporting.provenance`.
        recording: Path of the Meshcat page, relative to this one.
        fault: Why the run was stopped; None if it completed.
        broken: What was promised and not kept, one phrase each.
        interrupted: Whether the user stopped it.
        warnings: What may not have gone as well as hoped, one sentence each.
        diagram_svg: The block diagram as SVG text.
        kind: What the page is about, above its title.
        commands: Command lines worth repeating, by what they are good for.
        cards: Names of the metrics that become cards, instead.
        tables: In reading order, after the figures.
        details: What ``scenario_yaml_text`` is.
    """
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        kind=escape(kind),
        title=escape(title),
        description=escape(description.strip()),
        badges=_badges(metrics, fault, interrupted, broken),
        fault="".join(
            f'<div class="fault">{escape(end)}</div>'
            for end in ([fault] if fault else []) + [f"Missed: {phrase}" for phrase in broken]
        ),
        warnings="".join(f'<div class="warning">{escape(warning)}</div>' for warning in warnings),
        cards=_cards(metrics, cards),
        recording=_recording(recording),
        figures=_section("Figures", "\n".join(_figure(figure) for figure in figures)),
        tables=_section("Tables", "\n".join(_data_table(table) for table in tables)),
        commands=_commands(commands or {}),
        table=_table(metrics),
        details=_details(details, scenario_yaml_text, diagram_svg),
        attributes="\n".join(
            f"<div><dt>{escape(_spoken(name))}</dt><dd>{escape(value)}</dd></div>"
            for name, value in log_attributes.items()
        ),
    )


def _section(heading: str, content: str) -> str:
    """A section with heading, nothing without content."""
    return f"<section>\n<h2>{heading}</h2>\n{content}\n</section>" if content else ""


def _badges(metrics: Metrics, fault: str | None, interrupted: bool, broken: Sequence[str]) -> str:
    """How the run ended, and how many targets were met."""
    kind, end = ("bad", "✗ interrupted") if interrupted else ("good", "✓ completed")
    if broken and not interrupted:
        kind, end = "bad", "✗ ended, with promises broken"
    if fault:
        kind, end = "bad", "✗ stopped by fault"
    status = f'<span class="badge {kind}">{end}</span>'
    judged = [metric for metric in metrics.values() if metric.judged]
    verdicts = [metric.passed for metric in judged if metric.passed is not None]
    if not verdicts:
        return status
    kind = "good" if all(verdicts) else "bad"
    return (
        f'{status}<span class="badge {kind}">{sum(verdicts)} of {len(verdicts)} targets met</span>'
    )


def _cards(metrics: Metrics, chosen: Sequence[str] | None) -> str:
    """The metrics to look at first."""
    if chosen is None:
        chosen = [name for name, metric in metrics.items() if metric.target is not None]
    cards = [_card(name, metrics[name]) for name in (chosen or list(metrics))[:MAX_CARDS]]
    return _section("Key results", f'<div class="cards">{"".join(cards)}</div>' if cards else "")


def _card(name: str, metric: Metric) -> str:
    """One metric, large."""
    verdict = " ".join(part for part in (_mark(metric), _target(metric)) if part)
    return (
        f'<div class="card"><div class="name">{escape(_spoken(name, metric.unit))}</div>'
        f'<div class="value">{_value(metric)}</div><div class="verdict">{verdict}</div></div>\n'
    )


def _table(metrics: Metrics) -> str:
    """All metrics."""
    rows = "\n".join(
        f"<tr{_meaning(name)}><td>{escape(_spoken(name, metric.unit))}<br>"
        f"<code>{escape(name)}</code></td>"
        f'<td class="number">{_value(metric)}</td>'
        f'<td class="target" data-head="Target">{_target(metric)}</td>'
        f"<td>{_mark(metric)}</td>"
        f'<td data-head="Source">{escape(metric.source or "")}</td></tr>'
        for name, metric in metrics.items()
    )
    head = (
        '<tr><th>Metric</th><th class="number">Value</th><th>Target</th><th>Met</th>'
        "<th>Source</th></tr>"
    )
    table = (
        f'<div class="scroll"><table class="metrics"><thead>{head}</thead><tbody>\n{rows}\n'
        "</tbody></table></div>"
    )
    return _section("All metrics", table if metrics else "")


def _meaning(name: str) -> str:
    """What a metric is, to be read where the mouse rests."""
    known = known_metric(name)
    return "" if known is None else f' title="{escape(known.text)}"'


def _value(metric: Metric) -> str:
    """The value with unit."""
    return escape(format_quantity(metric.value, metric.unit))


def _target(metric: Metric) -> str:
    """The target in the unit of the metric, as text where it is no comparison."""
    if metric.bound is None:
        return escape(metric.target or "")
    comparison, number = metric.bound
    return escape(f"{_SYMBOLS[comparison]}{NARROW_SPACE}{format_quantity(number, metric.unit)}")


def _mark(metric: Metric) -> str:
    """Whether the target is met, by sign, word and colour."""
    verdict = metric.verdict
    if verdict in ("", "not judged"):
        return verdict
    kind, sign = ("good", "✓") if verdict == "met" else ("bad", "✗")
    text = f"{sign} {verdict}"
    return f'<span class="mark {kind}">{text}</span>'


def _figure(figure: Figure) -> str:
    """A figure, inside the page."""
    encoded = base64.b64encode(figure.png).decode("ascii")
    return (
        f'<figure><div class="sheet"><img src="data:image/png;base64,{encoded}"'
        f' alt="{escape(figure.title)}"></div>'
        f"<figcaption><strong>{escape(figure.title)}.</strong> {escape(figure.caption)}"
        "</figcaption></figure>"
    )


def _commands(commands: Mapping[str, str]) -> str:
    """Command lines to copy."""
    blocks = (
        f'<figure><pre class="command">{escape(command)}</pre>'
        f"<figcaption>{escape(purpose)}</figcaption></figure>"
        for purpose, command in commands.items()
    )
    return _section("Runs to look at", "\n".join(blocks))


def _recording(recording: str | None) -> str:
    """The recording in a frame, with a link for a window of its own."""
    if recording is None:
        return ""
    link = quote(recording)
    return _section(
        "Recording",
        f'<figure><iframe src="{link}" title="Recording of the robot" loading="lazy"'
        " allowfullscreen></iframe>"
        '<p class="hint">Drag to turn, scroll to zoom; play, pause and scrub under'
        f' <em>Animations</em> in the controls. <a href="{link}" target="_blank">Open the recording'
        " in a tab of its own</a> (keep the file beside this page).</p></figure>",
    )


def _data_table(table: Table) -> str:
    """A table with its caption."""

    def cell(value: str | float) -> str:
        if isinstance(value, str):
            return f"<td>{escape(value)}</td>"
        return f'<td class="number">{value:.4g}</td>'

    def heading(name: str, below: Sequence[str | float]) -> str:
        is_number = bool(below) and not any(isinstance(value, str) for value in below)
        kind = ' class="number"' if is_number else ""
        return f"<th{kind}>{escape(name)}</th>"

    columns = list(zip(*table.rows, strict=True)) or [()] * len(table.head)
    head = "".join(map(heading, table.head, columns))
    rows = "\n".join(f"<tr>{''.join(map(cell, row))}</tr>" for row in table.rows)
    return (
        f'<figure><div class="scroll" tabindex="0"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>\n{rows}\n</tbody></table></div><figcaption><strong>{escape(table.title)}.</strong>"
        f" {escape(table.caption)}</figcaption></figure>"
    )


def _details(summary: str, text: str, diagram_svg: str | None) -> str:
    """What was run in full: scenario and block diagram, folded."""
    blocks = [f"<details><summary>{escape(summary)}</summary><pre>{escape(text)}</pre></details>"]
    if diagram_svg:
        # As an image nothing inside the SVG can act on the page.
        encoded = base64.b64encode(diagram_svg.encode("utf-8")).decode("ascii")
        blocks.append(
            '<details><summary>Block diagram</summary><div class="diagram">'
            f'<img src="data:image/svg+xml;base64,{encoded}" alt="Block diagram"></div></details>'
        )
    return _section("What was run", "\n".join(blocks))


def _spoken(name: str, unit: str = "") -> str:
    """``controller_tick_us_p99`` in ``us`` as ``Controller tick p99``; a torque in N is a force."""
    words = " ".join(word for word in name.split("_") if word and word != unit)
    if unit == "N":
        words = words.replace("torque", "force")
    return words[:1].upper() + words[1:]
