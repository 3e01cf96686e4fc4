"""Arguments and options that several commands take, and how their text is read."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pfsc_drake.errors import InputError, shortened

if TYPE_CHECKING:
    from identification.measurement.columns import Reading

Robot = Annotated[
    str, typer.Argument(help="Shipped robot, SDF or URDF file, or scenario with a robot.")
]
Tool = Annotated[
    bool, typer.Option("--tool/--no-tool", help="Whether the shipped robot carries its tool.")
]
Records = Annotated[list[Path], typer.Argument(help="Runs of one excitation: CSV, HDF5 or MAT.")]
Validation = Annotated[
    Path | None, typer.Option(help="Record of another motion, to choose friction and to predict.")
]
Bounds = Annotated[
    Path | None, typer.Option(help="What is known of the links (YAML). Default: what is shipped")
]
Excitation = Annotated[
    Path | None, typer.Option(help="excitation.yaml, to see the robot move on the page.")
]
Units = Annotated[
    list[str] | None,
    typer.Option("--unit", metavar="SIGNAL=UNIT", help="Unit that a file does not state."),
]
Names = Annotated[
    list[str] | None,
    typer.Option("--name", metavar="FILE_NAME=SIGNAL", help="What a file calls otherwise."),
]
Scales = Annotated[
    list[str] | None,
    typer.Option("--scale", metavar="SIGNAL=NUMBER", help="SI units per unit of the file."),
]
Simulated = Annotated[
    bool, typer.Option("--simulated", help="The robot's model is the truth: compare with it.")
]


def read_pairs(options: list[str] | None, option: str) -> list[tuple[str, str]]:
    """Return names and values of a repeatable option.

    Raises:
        InputError: If one is not ``NAME=VALUE``.
    """
    pairs = []
    for text in options or []:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f"{option} {shortened(text)}: allowed: NAME=VALUE")
        pairs.append((name, value))
    return pairs


def read_reading(
    names: list[str] | None, units: list[str] | None, scales: list[str] | None
) -> "Reading":
    """Return what options say of files.

    Raises:
        InputError: If one is not of its form.
    """
    from identification.measurement.columns import Reading

    scale = {name: read_number(value, "--scale") for name, value in read_pairs(scales, "--scale")}
    return Reading(dict(read_pairs(names, "--name")), dict(read_pairs(units, "--unit")), scale)


def read_number(text: str, option: str) -> float:
    """Return the number of an option.

    Raises:
        InputError: If it is none.
    """
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option} {shortened(text)}: allowed: a number") from None


def read_range(text: str, option: str) -> tuple[float, float]:
    """Return the two numbers of an option.

    Raises:
        InputError: If it is not ``LOW:HIGH``.
    """
    low, colon, high = text.partition(":")
    if not colon:
        raise InputError(f"{option} {shortened(text)}: allowed: LOW:HIGH")
    return read_number(low, option), read_number(high, option)


def read_integer(text: str, option: str) -> int:
    """Return the integer of an option.

    Raises:
        InputError: If it is none.
    """
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{option} {shortened(text)}: allowed: integers, e.g. 1,3,5") from None
