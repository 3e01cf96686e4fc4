"""The command line: ``excite`` a robot, ``simulate`` the experiment, ``estimate`` from files.

``consistent`` writes a model, ``report`` writes the page again, ``elastic`` identifies elastic
joints, ``information`` evaluates motions. Exit status: 0 done; 2 wrong input, one line on stderr; 4
results could not be written; 130 interrupted.
"""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from identification.elastic.command import elastic_command
from identification.options import (
    BoundsOptions,
    EvaluationOptions,
    ExcitationOptions,
    ModelOptions,
    PageOptions,
    ReadingOptions,
    RecordOptions,
    Robot,
    Tool,
    Validation,
    read_number,
    read_pairs,
)
from identification.output import check_folder
from pfsc_drake.errors import InputError
from reporting.progress import fraction_display
from reporting.terminal import flatten_options, interruptible, run_app, show_page

if TYPE_CHECKING:
    from identification.model.subject import Subject

MOST_RUNS = 1000  # of an experiment

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="From a robot to its model: excitation, experiment, estimation, consistency.",
)


@app.command("excite")
@flatten_options
def excite_command(
    robot: Robot,
    *,
    out: Annotated[Path | None, typer.Option(help="Default: out/ROBOT_excitation")] = None,
    motion: ExcitationOptions,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            metavar="NAME=VALUES",
            help="velocity, acceleration or effort of all joints, one number or one for each: "
            "acceleration=30 or velocity=1,1,2. Default: those of the model",
        ),
    ] = None,
    cell: Annotated[Path | None, typer.Option(help="Obstacles around the robot (YAML).")] = None,
    tool: Tool = False,
) -> None:
    """Find a motion that excites all parameters within all limits."""
    from identification.excitation.limits import chosen_limits
    from identification.excitation.search import search
    from identification.steps import RECORDING, save_excitation

    with interruptible():
        motion.check_duration()
        console, subject, folder = _begin(robot, tool, out, "excitation")
        within = chosen_limits(
            subject,
            {
                name: [read_number(value, "--limit") for value in values.split(",")]
                for name, values in read_pairs(limits, "--limit")
            },
        )
        options = motion.search_options()
        with fraction_display(console, "excitation") as progress:
            found = search(subject, options, within, cell, progress)
        save_excitation(subject, found, folder, motion.periods, within)
        console.print(
            f"log det {found.information.log_determinant:.2f}, condition number "
            f"{found.information.condition_number:.0f}, {found.information.base_parameters} "
            f"parameters, {found.seconds:.0f} s",
            highlight=False,
        )
        for name, shares in found.verification.shares.items():
            console.print(f"{name}: up to {100.0 * shares.max():.1f} % of the limit")
        for name, margin in found.verification.margins.items():
            console.print(f"{name}: {margin:.3f} to spare")
        for warning in found.warnings:
            console.print(f"[yellow]warning:[/] {warning}")
        console.print(f"Written to {folder}; open {folder / RECORDING}", soft_wrap=True)


@app.command("simulate")
def simulate_command(
    robot: Robot,
    out: Annotated[Path | None, typer.Option(help="Default: out/ROBOT_runs")] = None,
    excitation: Annotated[
        Path | None, typer.Option(help="excitation.yaml. Default: the shipped one")
    ] = None,
    runs: Annotated[int, typer.Option(min=1, max=MOST_RUNS, help="Number of simulated runs.")] = 7,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first run.")] = 1,
    realistic: Annotated[
        bool,
        typer.Option(help="Coloured disturbance, and friction that differs from run to run."),
    ] = False,
    tool: Tool = False,
) -> None:
    """Simulate the experiment: rotors, friction, servo, encoders, noise; five periods a run."""
    from identification.measurement.imperfections import shipped_imperfections
    from identification.steps import load_excitation, simulate_runs

    with interruptible():
        console, subject, folder = _begin(robot, tool, out, "runs")
        trajectory = load_excitation(subject, excitation)
        faults = shipped_imperfections(subject.family)
        faults = faults.realistic() if realistic else faults
        with fraction_display(console, "experiment") as progress:
            seeds = range(seed, seed + runs)
            files = simulate_runs(subject, robot, trajectory, faults, folder, seeds, progress)
        for file in files:
            console.print(str(file), soft_wrap=True, highlight=False)


@app.command("estimate")
@flatten_options
def estimate_command(
    robot: Robot,
    measured: RecordOptions,
    *,
    out: Annotated[Path | None, typer.Option(help="Default: out/ROBOT_identification")] = None,
    evaluation: EvaluationOptions,
    shown: PageOptions,
    wording: ReadingOptions,
    model: ModelOptions,
) -> None:
    """Estimate base parameters from measured motions, and write identification.h5 and a page."""
    from identification.pages import identify
    from identification.report.tables import parameter_table, torque_table
    from identification.steps import MeasuredFiles
    from reporting.terminal import print_table

    with interruptible():
        console, subject, folder = _begin(robot, model.tool, out, "identification")
        files = MeasuredFiles(
            measured.records,
            measured.validation,
            wording.reading(),
            evaluation.period,
            evaluation.skip,
            evaluation.bandwidth,
        )
        with fraction_display(console, subject.name) as progress:
            findings, report = identify(
                subject,
                files,
                folder,
                shown,
                plain=evaluation.plain,
                simulated=model.simulated,
                progress=progress,
            )
        print_table(console, parameter_table(findings, words=False), most=12)
        print_table(console, torque_table(findings))
        for note in findings.notes:
            console.print(f"[yellow]note:[/] {note}", soft_wrap=True, highlight=False)
        raise typer.Exit(show_page("report", report))


@app.command("consistent")
@flatten_options
def consistent_command(
    robot: Robot,
    identification: Annotated[Path, typer.Argument(help="identification.h5, or its folder.")],
    *,
    out: Annotated[Path | None, typer.Option(help="Default: out/ROBOT_model")] = None,
    known: BoundsOptions,
    direct: Annotated[
        bool, typer.Option("--direct", help="In one step, from the torques of the first run.")
    ] = False,
    tool: Tool = False,
) -> None:
    """Find the physically consistent parameters, and write parameter file, SDF and URDF."""
    from identification.steps import find_model

    with interruptible():
        console, subject, folder = _begin(robot, tool, out, "model")
        found, written = find_model(subject, identification, known, direct, folder)
        console.print(
            f"chi squared {found.chi_squared:.4g} of {len(found.base_values)} base parameters",
            highlight=False,
        )
        for file in written.files:
            console.print(str(file), soft_wrap=True, highlight=False)


@app.command("report")
@flatten_options
def report_command(
    robot: Robot,
    folder: Annotated[Path, typer.Argument(help="Folder with identification.h5.")],
    *,
    validation: Validation = None,
    shown: PageOptions,
    model: ModelOptions,
    out: Annotated[Path | None, typer.Option(help="Default: FOLDER_report")] = None,
) -> None:
    """Write the page of an identification again, with optional further content."""
    from identification.pages import write_stored

    with interruptible():
        subject = _load(robot, model.tool)
        target = out or folder.with_name(f"{folder.name}_report")
        report = write_stored(subject, folder, validation, shown, model.simulated, target)
        raise typer.Exit(show_page("report", report))


app.command("elastic")(flatten_options(elastic_command))


@app.command("information")
def information_command(
    robot: Robot,
    excitations: Annotated[
        list[Path] | None,
        typer.Argument(
            help="excitation.yaml of motions. Default: all that are shipped with the robot"
        ),
    ] = None,
    tool: Tool = False,
) -> None:
    """Print log det(X'X) and condition number of motions, for 1,000 samples of a period."""
    from identification.excitation.criterion import information
    from identification.excitation.fourier import FourierTrajectory
    from identification.model.base import base_parameters
    from identification.model.regressor import Regressor
    from identification.model.subject import load_subject
    from identification.steps import shipped_excitations

    with interruptible():
        console, subject = Console(), load_subject(robot, tool=tool)
        regressor = Regressor(subject)
        base = base_parameters(regressor)
        for file in excitations or shipped_excitations(subject):
            motion, joints = FourierTrajectory.load(file), subject.dimension
            if motion.dimension != joints:
                raise InputError(
                    f"{file}: a motion of {motion.dimension} joints; allowed: of {joints}, which "
                    f"{subject.name} has (pfsc identify excite {subject.name})"
                )
            found = information(regressor, base, motion)
            console.print(
                f"{file.name}: log det {found.log_determinant:.1f}, condition number "
                f"{found.condition_number:.0f}, {found.base_parameters} parameters",
                soft_wrap=True,
                highlight=False,
            )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: Without the program's name; by default those of the process.

    Returns:
        Exit status, see the module.
    """
    return run_app(app, "python -m identification", arguments)


def _begin(
    robot: str, tool: bool, out: Path | None, results: str
) -> tuple[Console, "Subject", Path]:
    """Return a console, the robot, and the checked folder for results."""
    subject = _load(robot, tool)
    folder = out or Path("out") / f"{subject.name}_{results}"
    check_folder(folder)
    return Console(), subject, folder


def _load(robot: str, tool: bool) -> "Subject":
    """Return the robot, and print a note if its model was corrected."""
    from identification.model.subject import load_subject

    logging.getLogger("drake").setLevel(logging.CRITICAL)
    subject = load_subject(robot, tool=tool)
    if subject.note:
        Console().print(f"[yellow]note:[/] {subject.note}", soft_wrap=True, highlight=False)
    return subject
