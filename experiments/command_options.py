"""Arguments and options that several commands take, and how their text is read."""

import glob
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.scenario_file import scenario_names
from pfsc_drake.checks import is_number
from pfsc_drake.errors import InputError, shortened, suggestion

if TYPE_CHECKING:
    from pydrake.lcm import DrakeLcm

# studies that run by their names, as a scenario does
IDENTIFICATION, TEACH_IN = "identify_comau", "teach_in"


def complete_scenario(incomplete: str) -> list[str]:
    """Return the shipped scenarios, YAML files and folders whose names go on like this.

    Args:
        incomplete: What has been written.
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


# what several commands take
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

Duration = Annotated[
    str | None,
    typer.Option(metavar="SECONDS", help="Simulated time in s, instead of the scenario's."),
]

Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")]

Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors and the last line.")]

Recording = Annotated[bool, typer.Option("--recording/--no-recording", help="Record the motion.")]

Lcm = Annotated[
    str,
    typer.Option(
        "--lcm", metavar="URL", help="LCM bus. Default: LCM_DEFAULT_URL, or LCM's own default"
    ),
]
Driver = Annotated[
    str, typer.Option(help="Whose messages: panda (drake-franka-driver) or iiwa (torques alone).")
]

_LONGEST = 1e6  # s, of anything
_BUSES = ("udpm", "tcpq", "memq")


def read_duration(text: str, longest: float = _LONGEST) -> float:
    """Return the value of ``--duration`` [s].

    Args:
        text: As it was written.
        longest: Largest value [s].

    Raises:
        InputError: If it is no positive number, or larger.
    """
    seconds = float(text) if is_number(text) else math.nan
    if not 0.0 < seconds <= longest:
        raise InputError(
            f"--duration {shortened(text)}: allowed: a positive number of seconds, at most "
            f"{longest:,.0f} s"
        )
    return seconds


def open_bus(url: str) -> "DrakeLcm":
    """Return the LCM bus of ``--lcm``.

    Args:
        url: As it was written; empty for LCM's default.

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
