"""Options of the commands by groups, and how their text is read."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pfsc_drake.errors import InputError, shortened

if TYPE_CHECKING:
    from identification.consistency.bounds import PhysicalBounds
    from identification.excitation.search import SearchOptions
    from identification.measurement.columns import Reading
    from identification.model.subject import Subject

Robot = Annotated[
    str, typer.Argument(help="Shipped robot, SDF or URDF file, or scenario with a robot.")
]
Tool = Annotated[
    bool, typer.Option("--tool/--no-tool", help="Whether the shipped robot carries its tool.")
]
Validation = Annotated[
    Path | None, typer.Option(help="Record of another motion, to choose friction and to predict.")
]
Bounds = Annotated[
    Path | None, typer.Option(help="What is known of the links (YAML). Default: what is shipped")
]
MOST_STARTS = 1000  # of an excitation's search
LONGEST_RUN = 3600.0  # s, of an excitation with all its periods


@dataclass
class Wording:
    """What files say in other words or not at all."""

    units: Annotated[
        list[str] | None,
        typer.Option("--unit", metavar="SIGNAL=UNIT", help="Unit that a file does not state."),
    ] = None
    names: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="FILE_NAME=SIGNAL", help="What a file calls otherwise."),
    ] = None
    scales: Annotated[
        list[str] | None,
        typer.Option("--scale", metavar="SIGNAL=NUMBER", help="SI units per unit of the file."),
    ] = None

    def reading(self) -> "Reading":
        """Return what the options say of files; raises InputError if one is not of its form."""
        from identification.measurement.columns import Reading

        pairs = read_pairs(self.scales, "--scale")
        scale = {name: read_number(value, "--scale") for name, value in pairs}
        return Reading(
            dict(read_pairs(self.names, "--name")), dict(read_pairs(self.units, "--unit")), scale
        )


@dataclass
class Measured:
    """Files with measured motions."""

    records: Annotated[list[Path], typer.Argument(help="Runs of one excitation: CSV, HDF5 or MAT.")]
    validation: Validation = None


@dataclass
class Evaluation:
    """How a measured motion is evaluated."""

    period: Annotated[
        float | None, typer.Option(help="Of the motion [s], if the files do not state it.")
    ] = None
    skip: Annotated[int, typer.Option(min=0, help="Periods at the start to leave out.")] = 1
    bandwidth: Annotated[
        float | None, typer.Option(help="Of the motion [Hz]. Default: what torques tell")
    ] = None
    plain: Annotated[bool, typer.Option("--plain", help="Coulomb and viscous friction only.")] = (
        False
    )


@dataclass
class Shown:
    """What a page shows beside the estimate."""

    bounds: Bounds = None
    excitation: Annotated[
        Path | None, typer.Option(help="excitation.yaml, to see the robot move on the page.")
    ] = None


@dataclass
class Model:
    """What the robot's model is."""

    simulated: Annotated[
        bool,
        typer.Option("--simulated", help="The robot's model is the truth: compare with it."),
    ] = False
    tool: Tool = False


@dataclass
class Known:
    """What is known of a robot's links."""

    bounds: Bounds = None
    total_mass: Annotated[
        str | None,
        typer.Option(
            metavar="LOW:HIGH",
            help="Mass of all links [kg], of a robot of which nothing else is known.",
        ),
    ] = None
    margin: Annotated[
        float, typer.Option(help="With it: how far bodies reach beyond their joints [m].")
    ] = 0.1

    def read(self, subject: "Subject") -> "PhysicalBounds":
        """Return the bounds; raises InputError if they cannot be read or nothing is known."""
        from identification.consistency.bounds import bounds_from_geometry, bounds_of

        if self.total_mass is None:
            return bounds_of(subject, self.bounds)
        return bounds_from_geometry(
            subject, read_range(self.total_mass, "--total-mass"), self.margin
        )


@dataclass
class Motion:
    """The excitation that is searched for."""

    criterion: Annotated[
        str, typer.Option(help="D: largest determinant; condition: smallest condition number.")
    ] = "D"
    harmonics: Annotated[str, typer.Option(help="Of the fundamental frequency.")] = "1,3,5"
    period: Annotated[float, typer.Option(help="Of the motion [s].")] = 10.0
    periods: Annotated[int, typer.Option(min=1, help="How often it is to be run.")] = 5
    starts: Annotated[
        int, typer.Option(min=1, max=MOST_STARTS, help="Random motions to start from.")
    ] = 16
    seed: Annotated[int, typer.Option(min=0, help="Of the first one.")] = 0

    def check_duration(self) -> None:
        """Refuse a run that is longer than anybody lets a robot move; raises InputError."""
        if not self.period * self.periods <= LONGEST_RUN:
            raise InputError(
                f"--periods {self.periods} of {self.period:g} s: {self.period * self.periods:.4g} "
                f"s; allowed: a run of up to {LONGEST_RUN:g} s"
            )

    def search_options(self) -> "SearchOptions":
        """Return how to search; raises InputError if a harmonic is no integer."""
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
            raise InputError(f"{option} {shortened(text)}: allowed: NAME=VALUE")
        pairs.append((name, value))
    return pairs


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
