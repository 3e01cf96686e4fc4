"""What a command says when it has ended, and the exit status that belongs to it."""

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
    """Print text as it is, on one line however long."""
    console.print(text, highlight=False, markup=False, soft_wrap=True)


def number_table(*titles: str) -> Table:
    """Return a table of numbers, without rows.

    Args:
        titles: Of its columns.
    """
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    for title in titles:
        table.add_column(title, justify="right")
    return table


def print_warning(console: Console, sentence: str) -> None:
    """Print a warning, a line of its own."""
    console.print(f"\n[yellow]warning:[/] {escape(sentence)}", soft_wrap=True)


def print_run(console: Console, outcome: "RunOutcome", said: Sequence[str] = ()) -> None:
    """Print what came out of a run, as far as it is no reason for concern; quietly its last line.

    Args:
        console: Where to.
        outcome: What came out.
        said: Warnings that have been printed before.
    """
    console.print(_metrics_table(outcome.metrics))
    for warning in outcome.warnings:
        if warning not in said:
            print_warning(console, warning)
    if outcome.margins is not None:
        print_line(console, f"\nmargins: {outcome.margins}")
    _print_report(console, outcome.report)


def _print_report(console: Console, report: Path | None) -> None:
    """The last line, behind an empty one if others are shown."""
    print_page(Console(), f"{'' if console.quiet else chr(10)}Open the report", report)


def judge_run(outcome: "RunOutcome", out: Path, time: float) -> int:
    """Says in one line what went wrong in a run, if anything did; returns the exit status."""
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
    """Print one line of how it ended, if it did not end well, and return the exit status.

    Args:
        status: Exit status if all was written.
        ends: Why it did not end well, one phrase each.
        problems: What could not be written.
        out: Folder that holds everything logged until then, if that is to be said.
        interrupted: Whether the user stopped it.
    """
    if problems:
        status, ends = NOT_WRITTEN, [*ends, *(f"error: {problem}" for problem in problems)]
    elif ends and out is not None:
        ends[-1] += f", everything logged so far is kept in {out}"
    if ends:
        print_error("; ".join(ends), after_echo=interrupted)
    return status


def _missed(broken: Sequence[str]) -> str:
    """What was promised and not kept, as part of a line."""
    return f"missed: {'; '.join(broken)}"


def print_live(console: Console, session: "LiveSession") -> None:
    """What a live session has left."""
    for folder, outcome in session.kept.items():
        print_page(console, "Open the report", outcome.report)
        scenario = folder / "scenario.yaml"
        print_line(console, f"  again, to the last bit: python -m experiments run {scenario}")


def judge_live(session: "LiveSession") -> int:
    """Says in one line what went wrong in a session, if anything did; returns the exit status."""
    status, ends = 0, []
    if session.interrupted:
        status, ends = INTERRUPTED, [f"interrupted at t = {session.end:.3f} s"]
    if session.fault is not None:
        status, ends = FAULT, [f"fault: {session.fault}; stopped at t = {session.end:.3f} s"]
    for folder, outcome in session.kept.items():
        if outcome.broken:
            status = status or FAULT
            ends = [*ends, f"{folder.name} {_missed(outcome.broken)}"]
    problems = [kept.problem for kept in session.kept.values() if kept.problem is not None]
    out = [*session.kept][-1] if session.kept else None
    return _judge(status, ends, problems, out, session.interrupted)


def print_sweep(console: Console, outcome: "SweepOutcome") -> None:
    """What came out of a sweep; quietly its last line."""
    console.print(_metrics_table(outcome.metrics))
    for warning in outcome.warnings:
        print_warning(console, warning)
    for strikes, command in outcome.commands.items():
        print_line(console, f"\n{strikes}\n  {command}")
    _print_report(console, outcome.report)


def judge_sweep(outcome: "SweepOutcome", out: Path) -> int:
    """Says in one line why a sweep is not whole, if it is not; returns the exit status."""
    status, ends = 0, []
    done = f"{len(outcome.rows)} of {outcome.total} runs"
    if outcome.interrupted:
        status, ends = INTERRUPTED, [f"interrupted after {done}"]
    if outcome.stopped is not None:
        status, ends = FAULT, [f"fault: {outcome.stopped}; stopped after {done}"]
    if ends:
        ends = [f"{ends[0]}, which are kept in {out}; the same command goes on"]
    elif outcome.refusal is not None:
        status, ends = WRONG_INPUT, [f"error: no run could start: {outcome.refusal}"]
    problems = [] if outcome.problem is None else [outcome.problem]
    return _judge(status, ends, problems, None, outcome.interrupted)


def print_export(
    console: Console, controller: "CController", files: Sequence[Path], out: Path
) -> None:
    """What has been exported, in one line."""
    said = controller.interface()
    sizes = f"state {said['state_bytes']} bytes, tables {said['table_bytes']} bytes"
    print_line(console, f"{out}: {len(files)} files, {sizes}")


def judge_replay(console: Console, replay: "Replay", out: Path) -> int:
    """Tells what a controller in C made of its record; returns the exit status."""
    table = number_table("Ticks", "differing", "largest", "median [us]", "p99 [us]", "worst [us]")
    times = [f"{time:.2f}" for time in (replay.median, replay.p99, replay.worst)]
    table.add_row(str(replay.ticks), str(replay.differing), f"{replay.largest:.3g}", *times)
    console.print(table)
    if replay.differing:
        print_error(f"error: {out}: {replay.text.splitlines()[0]}")
        return WRONG_INPUT
    return 0


def judge_commands(console: Console, commands: "Commands") -> int:
    """Tells what drives would have been told; returns the exit status."""
    from pfsc_drake.codegen.c_controller import fault_sentences

    told = commands.told
    change = np.abs(np.diff(told, axis=0)).max(axis=0, initial=0.0)
    columns = {
        "first": told[0],
        "lowest": told.min(axis=0),
        "highest": told.max(axis=0),
        "largest change": change,
    }
    if commands.difference is not None:
        columns["from the log"] = commands.difference
    console.print(f"{commands.port} [{commands.unit}], {len(told)} ticks", markup=False)
    table = number_table("Drive", *columns)
    for i in range(told.shape[1]):
        table.add_row(str(i + 1), *(f"{values[i]:.5g}" for values in columns.values()))
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
    """The metrics with their targets, one line each."""
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
