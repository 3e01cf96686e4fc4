"""Printed outcome and exit status of commands."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from reporting.interruption import INTERRUPTED
from reporting.terminal import FAULT, NOT_WRITTEN, WRONG_INPUT, print_error, print_page

if TYPE_CHECKING:
    from experiments.controller_replay import Commands, Replay
    from experiments.finished_run import RunOutcome
    from experiments.live.session import LiveSession
    from experiments.sweep.sweep import SweepOutcome
    from pfsc_drake.codegen.c_controller import CController
    from reporting.metrics import Metric


def print_line(console: Console, text: str) -> None:
    """Print text without markup, on one line of any length."""
    console.print(text, highlight=False, markup=False, soft_wrap=True)


def number_table(*titles: str) -> Table:
    """Return a table of numbers, without rows.

    Args:
        titles: Titles of the columns.
    """
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    for title in titles:
        table.add_column(title, justify="right")
    return table


def print_warning(console: Console, sentence: str) -> None:
    """Print a warning on its own line."""
    console.print(f"\n[yellow]warning:[/] {escape(sentence)}", soft_wrap=True)


def print_run(console: Console, outcome: "RunOutcome", printed: Sequence[str] = ()) -> None:
    """Print metrics, warnings and report of a run; only the last line in quiet mode.

    Args:
        console: The console.
        outcome: Outcome of the run.
        printed: Warnings that have been printed before.
    """
    console.print(_metrics_table(outcome.metrics))
    for warning in outcome.warnings:
        if warning not in printed:
            print_warning(console, warning)
    if outcome.margins is not None:
        print_line(console, f"\nmargins: {outcome.margins}")
    _print_report(console, outcome.report)


def _print_report(console: Console, report: Path | None) -> None:
    """Print the last line, after an empty one if others are shown."""
    print_page(Console(), f"{'' if console.quiet else chr(10)}Open the report", report)


def judge_run(outcome: "RunOutcome", out: Path, time: float) -> int:
    """Print fault, interruption and missed requirements of a run; return the exit status."""
    status, ends = 0, []
    if outcome.interrupted:
        status, ends = INTERRUPTED, [f"interrupted at t = {time:.3f} s"]
    if outcome.fault is not None:
        stop = outcome.stop or f"ended at t = {time:.3f} s"
        status, ends = FAULT, [f"fault: {outcome.fault}; {stop}"]
    if outcome.broken:
        status, ends = status or FAULT, [*ends, _missed(outcome.broken)]
    problems = [] if outcome.problem is None else [outcome.problem]
    return _judge(status, ends, problems, out, outcome.interrupted)


def _judge(
    status: int, ends: list[str], problems: Sequence[str], out: Path | None, interrupted: bool
) -> int:
    """Print one line about an abnormal end, if any, and return the exit status.

    Args:
        status: Exit status if all results were written.
        ends: Reasons of an abnormal end, one phrase each.
        problems: Results that could not be written.
        out: Folder of the log up to then, if it is to be named.
        interrupted: Whether the user stopped it.
    """
    if problems:
        status, ends = NOT_WRITTEN, [*ends, *(f"error: {problem}" for problem in problems)]
    elif ends and out is not None:
        ends[-1] += f", log written to {out}"
    if ends:
        print_error("; ".join(ends), after_echo=interrupted)
    return status


def _missed(broken: Sequence[str]) -> str:
    """Return the missed requirements as part of a line."""
    return f"missed: {'; '.join(broken)}"


def print_live(console: Console, session: "LiveSession") -> None:
    """Print the saved takes of a live session."""
    for folder, outcome in session.takes.items():
        print_page(console, "Open the report", outcome.report)
        scenario = folder / "scenario.yaml"
        print_line(console, f"  replay, bit-identical: pfsc run {scenario}")


def judge_live(session: "LiveSession") -> int:
    """Print fault, interruption and missed requirements of a session; return the exit status."""
    status, ends = 0, []
    if session.interrupted:
        status, ends = INTERRUPTED, [f"interrupted at t = {session.end:.3f} s"]
    if session.fault is not None:
        status, ends = FAULT, [f"fault: {session.fault}; stopped at t = {session.end:.3f} s"]
    for folder, outcome in session.takes.items():
        if outcome.broken:
            status = status or FAULT
            ends = [*ends, f"{folder.name} {_missed(outcome.broken)}"]
    problems = [take.problem for take in session.takes.values() if take.problem is not None]
    out = [*session.takes][-1] if session.takes else None
    return _judge(status, ends, problems, out, session.interrupted)


def print_sweep(console: Console, outcome: "SweepOutcome") -> None:
    """Print metrics, warnings and report of a sweep; only the last line in quiet mode."""
    console.print(_metrics_table(outcome.metrics))
    for warning in outcome.warnings:
        print_warning(console, warning)
    for strikes, command in outcome.commands.items():
        print_line(console, f"\n{strikes}\n  {command}")
    _print_report(console, outcome.report)


def judge_sweep(outcome: "SweepOutcome", out: Path) -> int:
    """Print why a sweep is incomplete, if it is; return the exit status."""
    status, ends = 0, []
    done = f"{len(outcome.rows)} of {outcome.total} runs"
    if outcome.interrupted:
        status, ends = INTERRUPTED, [f"interrupted after {done}"]
    if outcome.stopped is not None:
        status, ends = FAULT, [f"fault: {outcome.stopped}; stopped after {done}"]
    if ends:
        ends = [f"{ends[0]}, written to {out}; repeat the command to continue"]
    elif outcome.refusal is not None:
        status, ends = WRONG_INPUT, [f"error: no run could start: {outcome.refusal}"]
    problems = [] if outcome.problem is None else [outcome.problem]
    return _judge(status, ends, problems, None, outcome.interrupted)


def print_export(
    console: Console, controller: "CController", files: Sequence[Path], out: Path
) -> None:
    """Print a summary of an export in one line."""
    interface = controller.interface()
    sizes = f"state {interface['state_bytes']} bytes, tables {interface['table_bytes']} bytes"
    print_line(console, f"{out}: {len(files)} files, {sizes}")


def judge_replay(console: Console, replay: "Replay", out: Path) -> int:
    """Print the comparison of a C controller with its record; return the exit status."""
    table = number_table("Ticks", "differing", "largest", "median [us]", "p99 [us]", "worst [us]")
    times = [f"{time:.2f}" for time in (replay.median, replay.p99, replay.worst)]
    table.add_row(str(replay.ticks), str(replay.differing), f"{replay.largest:.3g}", *times)
    console.print(table)
    if replay.differing:
        print_error(f"error: {out}: {replay.text.splitlines()[0]}")
        return WRONG_INPUT
    return 0


def judge_commands(console: Console, commands: "Commands") -> int:
    """Print the drive commands of a replay; return the exit status."""
    from pfsc_drake.codegen.c_controller import fault_sentences

    values = commands.values
    change = np.abs(np.diff(values, axis=0)).max(axis=0, initial=0.0)
    columns = {
        "first": values[0],
        "lowest": values.min(axis=0),
        "highest": values.max(axis=0),
        "largest change": change,
    }
    if commands.difference is not None:
        columns["from the log"] = commands.difference
    console.print(f"{commands.port} [{commands.unit}], {len(values)} ticks", markup=False)
    table = number_table("Drive", *columns)
    for i in range(values.shape[1]):
        table.add_row(str(i + 1), *(f"{column[i]:.5g}" for column in columns.values()))
    console.print(table)
    if commands.assumed:
        print_line(console, commands.assumed)
    print_line(console, f"all outputs: {commands.file}")
    if commands.fault:
        why = fault_sentences()[int(commands.fault)]
        print_error(f"fault: {why}, from t = {commands.fault_time:.3f} s on")
        return FAULT
    return 0


def _metrics_table(metrics: Mapping[str, "Metric"]) -> Table:
    """Return a table of metrics with their targets."""
    from reporting.metrics import format_quantity

    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column("Metric", no_wrap=True)
    table.add_column("Value", justify="right", no_wrap=True)
    table.add_column("Target")
    colours = {"met": "green", "missed": "red", "no value": "red", "not judged": "yellow"}
    for name, metric in metrics.items():
        target = escape(metric.target or "")
        if metric.bound is not None:
            comparison, number = metric.bound
            target = f"{comparison} {format_quantity(number, metric.unit)}"
        value = format_quantity(metric.value, metric.unit)
        if verdict := metric.verdict:
            target += f" [{colours[verdict]}]{verdict}[/]"
        table.add_row(name, value, target)
    return table
