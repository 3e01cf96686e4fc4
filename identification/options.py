"""Options of the commands by groups, and parsers of their text."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pfsc_drake.errors import InputError, shorten

if TYPE_CHECKING:
    from identification.consistency.bounds import PhysicalBounds
    from identification.excitation.search import SearchOptions
    from identification.measurement.columns import Reading
    from identification.model.subject import Subject

Robot = Annotated[
    str, typer.Argument(help="Shipped robot, SDF or URDF file, or scenario with a robot.")
]
Tool = Annotated[
    bool, typer.Option("--tool/--no-tool", help="Include the tool of the shipped robot.")
]
Validation = Annotated[
    Path | None, typer.Option(help="Record of another motion, to choose friction and to predict.")
]
Bounds = Annotated[
    Path | None, typer.Option(help="Bounds of the links (YAML). Default: those shipped")
]
MOST_STARTS = 1000  # of an excitation's search
LONGEST_RUN = 3600.0  # s, of an excitation with all its periods


@dataclass
class ReadingOptions:
    """Names and units that the files lack or spell otherwise."""

    units: Annotated[
        list[str] | None,
        typer.Option("--unit", metavar="SIGNAL=UNIT", help="Unit that a file does not state."),
    ] = None
    names: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="FILE_NAME=SIGNAL", help="Other name in the file."),
    ] = None
    scales: Annotated[
        list[str] | None,
        typer.Option("--scale", metavar="SIGNAL=NUMBER", help="SI units per unit of the file."),
    ] = None

    def reading(self) -> "Reading":
        """Return the options for reading files; raises InputError if one has another form."""
        from identification.measurement.columns import Reading

        pairs = read_pairs(self.scales, "--scale")
        scale = {name: read_number(value, "--scale") for name, value in pairs}
        return Reading(
            dict(read_pairs(self.names, "--name")), dict(read_pairs(self.units, "--unit")), scale
        )


@dataclass
class RecordOptions:
    """Files with measured motions."""

    records: Annotated[list[Path], typer.Argument(help="Runs of one excitation: CSV, HDF5 or MAT.")]
    validation: Validation = None


@dataclass
class EvaluationOptions:
    """Evaluation of a measured motion."""

    period: Annotated[
        float | None, typer.Option(help="Period of the motion [s], if the files do not state it.")
    ] = None
    skip: Annotated[int, typer.Option(min=0, help="Periods at the start to leave out.")] = 1
    bandwidth: Annotated[
        float | None, typer.Option(help="Bandwidth [Hz]. Default: chosen from the torques")
    ] = None
    plain: Annotated[bool, typer.Option("--plain", help="Coulomb and viscous friction only.")] = (
        False
    )


@dataclass
class PageOptions:
    """Further content of a page."""

    bounds: Bounds = None
    excitation: Annotated[
        Path | None, typer.Option(help="excitation.yaml, to show the robot's motion on the page.")
    ] = None


@dataclass
class ModelOptions:
    """Ground truth of the robot's model."""

    simulated: Annotated[
        bool,
        typer.Option("--simulated", help="The robot's model is the ground truth: compare with it."),
    ] = False
    tool: Tool = False


@dataclass
class BoundsOptions:
    """Bounds of a robot's links."""

    bounds: Bounds = None
    total_mass: Annotated[
        str | None,
        typer.Option(
            metavar="LOW:HIGH",
            help="Mass of all links [kg], for a robot without other bounds.",
        ),
    ] = None
    margin: Annotated[
        float,
        typer.Option(
            help="With --total-mass: distance by which bodies extend beyond their joints [m]."
        ),
    ] = 0.1

    def read(self, subject: "Subject") -> "PhysicalBounds":
        """Return the bounds; raises InputError if they cannot be read or there are none."""
        from identification.consistency.bounds import bounds_from_geometry, bounds_of

        if self.total_mass is None:
            return bounds_of(subject, self.bounds)
        return bounds_from_geometry(
            subject, read_range(self.total_mass, "--total-mass"), self.margin
        )


@dataclass
class ExcitationOptions:
    """Excitation to search for."""

    criterion: Annotated[
        str, typer.Option(help="D: largest determinant; condition: smallest condition number.")
    ] = "D"
    harmonics: Annotated[str, typer.Option(help="Harmonics in use.")] = "1,3,5"
    period: Annotated[float, typer.Option(help="Period of the motion [s].")] = 10.0
    periods: Annotated[int, typer.Option(min=1, help="Number of periods in a run.")] = 5
    starts: Annotated[
        int, typer.Option(min=1, max=MOST_STARTS, help="Random motions to start from.")
    ] = 16
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first motion.")] = 0

    def check_duration(self) -> None:
        """Refuse a run that is too long for a robot; raises InputError."""
        if not self.period * self.periods <= LONGEST_RUN:
            raise InputError(
                f"--periods {self.periods} of {self.period:g} s: {self.period * self.periods:.4g} "
                f"s; allowed: a run of up to {LONGEST_RUN:g} s"
            )

    def search_options(self) -> "SearchOptions":
        """Return the options of the search; raises InputError if a harmonic is no integer."""
        from identification.excitation.search import SearchOptions

        harmonics = [read_integer(number, "--harmonics") for number in self.harmonics.split(",")]
        return SearchOptions(self.criterion, harmonics, self.period, self.starts, self.seed)


def read_pairs(options: list[str] | None, option: str) -> list[tuple[str, str]]:
    """Return names and values of a repeatable option.

    Raises:
        InputError: If one is not ``NAME=VALUE``.
    """
    pairs = []
    for text in options or []:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f"{option} {shorten(text)}: allowed: NAME=VALUE")
        pairs.append((name, value))
    return pairs


def read_number(text: str, option: str) -> float:
    """Return the number of an option.

    Raises:
        InputError: If it is not a number.
    """
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option} {shorten(text)}: allowed: a number") from None


def read_range(text: str, option: str) -> tuple[float, float]:
    """Return the two numbers of an option.

    Raises:
        InputError: If it is not ``LOW:HIGH``.
    """
    low, colon, high = text.partition(":")
    if not colon:
        raise InputError(f"{option} {shorten(text)}: allowed: LOW:HIGH")
    return read_number(low, option), read_number(high, option)


def read_integer(text: str, option: str) -> int:
    """Return the integer of an option.

    Raises:
        InputError: If it is not an integer.
    """
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{option} {shorten(text)}: allowed: integers, e.g. 1,3,5") from None
