"""``python -m identification information``: how well motions show the parameters of a robot."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from identification.options import Robot, Tool
from reporting.terminal import interruptible


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
    """Tell log det(X'X) and condition number of motions, of 1,000 samples of a period."""
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
            found = information(regressor, base, FourierTrajectory.load(file))
            console.print(
                f"{file.name}: log det {found.log_determinant:.1f}, condition number "
                f"{found.condition_number:.0f}, {found.base_parameters} parameters",
                soft_wrap=True,
                highlight=False,
            )
