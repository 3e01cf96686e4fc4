"""The command ``init``: a first scenario for a model and points of the user's own."""

import logging
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from experiments.command_options import Quiet
from experiments.outcomes import print_line, print_warning
from pfsc_drake.checks import is_number
from pfsc_drake.errors import InputError
from reporting.progress import ProgressDisplay
from reporting.terminal import interruptible


@dataclass
class Chosen:
    """Choices of the user."""

    tool_frame: Annotated[str, typer.Option(help="Frame of the model that follows the points.")] = (
        ""
    )
    law: Annotated[
        str, typer.Option(help="velocity_servo, rigid, elastic, ... Default: by the model's data.")
    ] = ""
    unit: Annotated[
        str, typer.Option(help="Unit of the points: m, mm, cm, inch. Default: m or mm.")
    ] = ""
    orientation: Annotated[
        str,
        typer.Option(
            help="Direction of the tool's z axis if the file has none: down, forward, up; free: "
            "position only."
        ),
    ] = ""
    base_position: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="Position of the robot's base in the world [m].")
    ] = ""

    def position(self) -> tuple[float, ...]:
        """Return the position of the base [m], empty for the origin.

        Raises:
            InputError: If it is not made of three numbers.
        """
        words = self.base_position.split(",") if self.base_position else []
        if words and (len(words) != 3 or not all(is_number(word) for word in words)):
            raise InputError(
                f"--base-position {self.base_position}: allowed: three numbers X,Y,Z [m]"
            )
        return tuple(float(word) for word in words)


def init_command(
    model: Annotated[str, typer.Argument(help="URDF, SDF or MJCF file, or a shipped model.")],
    points: Annotated[str, typer.Argument(help="CSV file with columns x,y,z and more.")],
    *,
    out: Annotated[
        Path | None, typer.Option(help="Scenario to write. Default: MODEL_POINTS.yaml here")
    ] = None,
    chosen: Chosen,
    quiet: Quiet = False,
) -> None:
    """Write a scenario that runs, for your robot model and your points."""
    from experiments.new_scenario.first_scenario import InitOptions
    from experiments.new_scenario.new_scenario import create_scenario, new_file

    with interruptible():
        file = new_file(model, points, out, replace=False)
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console = Console(quiet=quiet)
        options = InitOptions(
            chosen.tool_frame, chosen.law, chosen.unit, chosen.orientation, chosen.position()
        )
        with ProgressDisplay(console, file.stem, None) as progress:
            new = create_scenario(model, points, file, options, progress=progress, ask=_ask)
        for key, value, reason in new.choices:
            console.print(
                f"{key:<22} [bold]{escape(value)}[/]  [dim]{escape(reason)}[/]", soft_wrap=True
            )
        for warning in new.warnings:
            print_warning(console, warning)
        print_line(console, new.summary)
        print_line(Console(), f"Written to {file}; next: pfsc run {shlex.quote(str(file))}")


def _ask(question: str, names: Sequence[str]) -> str:
    """Return one of several names; at a terminal the user chooses."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return names[0]
    typer.echo(f"{question}: {', '.join(names)}")
    return str(typer.prompt(question, default=names[0]))
