"""Arguments and options shared by several commands, and parsers of their text."""

import glob
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.scenario_file import ScenarioFile, expand_home, read_scenario, scenario_names
from pfsc_drake.checks import is_number
from pfsc_drake.errors import InputError, shorten, suggestion

if TYPE_CHECKING:
    from pydrake.lcm import DrakeLcm

# studies that run by their names, as a scenario does
IDENTIFICATION, TEACH_IN = "identify_comau", "teach_in"


def complete_scenario(incomplete: str) -> list[str]:
    """Return the shipped scenarios, YAML files and folders that complete a name.

    Args:
        incomplete: Beginning of the name.
    """
    head, slash, tail = incomplete.rpartition("/")
    folder = Path(head or slash or ".").expanduser()
    try:
        files = sorted(folder.glob(f"{glob.escape(tail)}*"))
    except (OSError, ValueError):
        files = []
    found = [name for name in scenario_names() if name.startswith(incomplete)]
    found += [f"{head}{slash}{file.name}" for file in files if file.suffix in (".yaml", ".yml")]
    return found + [f"{head}{slash}{file.name}/" for file in files if file.is_dir()]


# shared by several commands
ScenarioName = Annotated[
    str,
    typer.Argument(
        help="Name of a shipped scenario, or path of a YAML file.",
        autocompletion=complete_scenario,
    ),
]

Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.PATH=VALUE", help="Override a key; repeatable."),
]

Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors and the last line.")]

BusUrl = Annotated[
    str,
    typer.Option(
        "--lcm", metavar="URL", help="LCM bus. Default: LCM_DEFAULT_URL, or LCM's own default"
    ),
]

_LONGEST = 1e6  # s, of anything
_BUSES = ("udpm", "tcpq", "memq")


@dataclass
class ChosenScenario:
    """A scenario with changes."""

    scenario: ScenarioName
    overrides: Overrides = None

    def read(self, studies: Sequence[str] = ()) -> ScenarioFile:
        """Return the scenario as read, see :func:`~experiments.scenario_file.read_scenario`."""
        return read_scenario(self.scenario, self.overrides or [], studies)


@dataclass
class TimedScenario(ChosenScenario):
    """A scenario with changes and a duration."""

    duration: Annotated[
        str | None,
        typer.Option(metavar="SECONDS", help="Simulated time in s, instead of the scenario's."),
    ] = None

    @property
    def seconds(self) -> float | None:
        """The duration [s], None for the scenario's."""
        return None if self.duration is None else read_duration(self.duration)


@dataclass
class Drawn:
    """Drawing options of a run."""

    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True
    recording: Annotated[
        bool, typer.Option("--recording/--no-recording", help="Record the motion.")
    ] = True


@dataclass
class Bus:
    """LCM bus and message set of a robot."""

    lcm: BusUrl = ""
    driver: Annotated[
        str,
        typer.Option(help="Message set: panda (drake-franka-driver) or iiwa (torques only)."),
    ] = "panda"


def folder_or(out: Path | None, name: str) -> Path:
    """Return the folder of ``--out``.

    Args:
        out: Value of the option, or None.
        name: Name of the folder in ``out`` otherwise.
    """
    return Path("out") / name if out is None else expand_home(out)


def read_duration(text: str, longest: float = _LONGEST) -> float:
    """Return the value of ``--duration`` [s].

    Args:
        text: Value of the option.
        longest: Largest value [s].

    Raises:
        InputError: If it is not a positive number, or larger.
    """
    seconds = float(text) if is_number(text) else math.nan
    if not 0.0 < seconds <= longest:
        raise InputError(
            f"--duration {shorten(text)}: allowed: a positive number of seconds, at most "
            f"{longest:,.0f} s"
        )
    return seconds


def open_bus(url: str) -> "DrakeLcm":
    """Return the LCM bus of ``--lcm``.

    Args:
        url: Value of the option; empty for LCM's default.

    Raises:
        InputError: If there is no such kind of bus.
    """
    from pydrake.lcm import DrakeLcm

    # LCM itself would go on without a bus
    if url and url.partition("://")[0] not in _BUSES:
        allowed = ", ".join(f"{bus}://..." for bus in _BUSES)
        nearest = suggestion(url.partition("://")[0], _BUSES)
        raise InputError(f"--lcm {url}: no such bus; allowed: {allowed}{nearest}")
    return DrakeLcm(url)
