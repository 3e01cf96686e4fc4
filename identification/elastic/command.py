"""``python -m identification elastic``: stiffness, damping and rotor inertia of each joint."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console

from identification.options import ReadingOptions, Robot, read_number
from identification.output import check_folder, make_folder, write_text
from reporting.progress import fraction_display
from reporting.terminal import interruptible

if TYPE_CHECKING:
    from identification.elastic.estimate import JointEstimate
    from reporting.page import Table


def elastic_command(
    robot: Robot,
    *,
    record: Annotated[
        Path | None,
        typer.Argument(
            help="CSV, HDF5 or MAT with positions of links and motors, and torques. Without: a "
            "simulated experiment, which is written beside the results"
        ),
    ] = None,
    locked: Annotated[
        bool, typer.Option("--locked", help="The links were locked, and the motors excited.")
    ] = False,
    viscous: Annotated[
        str | None,
        typer.Option(
            metavar="VALUES",
            help="Viscous friction of the drives with locked links, one number or one for "
            "each [Nm s/rad]; 0 attributes it to the damping of the joint.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Default: out/ROBOT_elastic")] = None,
    seed: Annotated[int, typer.Option(help="Seed of a simulated experiment.")] = 1,
    wording: ReadingOptions,
) -> None:
    """Estimate the elastic joints of a robot from signals of motors and links."""
    from identification.elastic.estimate import estimate_joints
    from identification.elastic.experiment import simulate_excited, simulate_locked
    from identification.measurement.files import read_record, write_record
    from identification.measurement.imperfections import shipped_imperfections
    from identification.model.subject import load_subject
    from identification.steps import load_excitation
    from reporting.terminal import print_table

    with interruptible():
        console, subject = Console(), load_subject(robot)
        if subject.note:
            console.print(f"[yellow]note:[/] {subject.note}", soft_wrap=True, highlight=False)
        folder = out or Path("out") / f"{subject.name}_elastic"
        check_folder(folder)
        if record is not None:
            measured = read_record(record, subject, None, wording.reading(), still=locked)
            make_folder(folder)
        else:
            make_folder(folder)
            faults = shipped_imperfections(subject.family)
            with fraction_display(console, subject.name) as progress:
                if locked:
                    measured = simulate_locked(subject, faults, seed=seed, progress=progress)
                else:
                    motion = load_excitation(subject, None)
                    measured = simulate_excited(
                        subject, motion, faults, seed=seed, progress=progress
                    )
            write_record(folder / "record.h5", measured, subject)
        known = None
        if locked:
            numbers = [read_number(x, "--viscous") for x in (viscous or "0").split(",")]
            known = np.full(subject.dimension, numbers[0]) if len(numbers) == 1 else numbers
        found = estimate_joints(
            measured, subject, locked=locked, viscous=None if known is None else np.array(known)
        )
        write_table(folder / "elastic_joints.csv", found)
        print_table(console, joint_table(found))
        console.print(f"Written to {folder / 'elastic_joints.csv'}", soft_wrap=True)


COLUMNS = ("joint", "parameter", "value", "standard_deviation", "relative_percent", "unit")
_UNITS = {
    "stiffness": ("Nm/rad", "N/m"),
    "damping": ("Nm s/rad", "N s/m"),
    "inertia": ("kg m^2", "kg"),
    "coulomb": ("Nm", "N"),
    "lag": ("Nm s", "N s"),
    "viscous": ("Nm s/rad", "N s/m"),
    "offset": ("Nm", "N"),
}


def parameter_unit(parameter: str, joint_unit: str) -> str:
    """Return the unit of a parameter.

    Args:
        parameter: One of :class:`~identification.elastic.estimate.JointEstimate`.
        joint_unit: ``rad`` or ``m``.
    """
    return _UNITS[parameter][joint_unit != "rad"]


def table_rows(estimates: Sequence["JointEstimate"]) -> list[tuple[str, str, float, float, str]]:
    """Return joint, parameter, value, standard deviation and unit, line by line."""
    return [
        (e.name, name, e.value(name), e.deviation(name), parameter_unit(name, e.unit))
        for e in estimates
        for name in e.parameters
    ]


def joint_table(estimates: Sequence["JointEstimate"]) -> "Table":
    """Return the parameters of joints with their standard deviations.

    Args:
        estimates: Estimates of the joints.
    """
    from reporting.page import Table

    rows: list[list[str | float]] = [
        [joint, name, value, deviation, 100.0 * deviation / abs(value) if value else np.inf, unit]
        for joint, name, value, deviation, unit in table_rows(estimates)
    ]
    head = ["joint", "parameter", "value", "standard deviation", "in %", "unit"]
    return Table("Elastic joints", "On the joint side.", head, rows)


def write_table(path: str | Path, estimates: Sequence["JointEstimate"]) -> None:
    """Write the parameters of joints with their standard deviations as CSV.

    Args:
        path: Path of the file, which is replaced.
        estimates: Estimates of the joints.

    Raises:
        InputError: If the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for joint, name, value, deviation, unit in table_rows(estimates):
        relative = 100.0 * deviation / abs(value) if value else np.inf
        numbers = (f"{value:.6g}", f"{deviation:.3g}", f"{relative:.3g}")
        writer.writerow((joint, name, *numbers, unit))
    write_text(Path(path), text.getvalue())
