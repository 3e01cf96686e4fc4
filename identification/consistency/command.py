"""``python -m identification printed``: from Tab. C.3 to the nearest consistent model."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from identification.output import check_folder
from reporting.commands import interruptible


def printed_command(
    out: Annotated[Path, typer.Option(help="Folder for the model.")] = Path("out/printed_model"),
    torque_weight: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="For how many measurements the torques on the motion of Tab. C.2 count; 0 for chi "
            "squared alone.",
        ),
    ] = None,
    widest: Annotated[
        bool,
        typer.Option(
            "--widest", help="Nothing known of bodies: tell the least chi squared, write no model."
        ),
    ] = False,
) -> None:
    """Find the consistent Comau Racer 1.4 nearest to Tab. C.3, and write its model."""
    from identification.consistency.printed import (
        TORQUE_WEIGHT,
        chi_squared_of_printed,
        least_to_printed,
        nearest_to_printed,
        printed_subject,
    )
    from identification.model.parameters import true_parameters
    from identification.steps import write_consistent

    with interruptible():
        console = Console()
        check_folder(out)
        subject = printed_subject()
        shipped = chi_squared_of_printed(subject, true_parameters(subject))
        weight = TORQUE_WEIGHT if torque_weight is None else torque_weight
        found = least_to_printed(subject) if widest else nearest_to_printed(subject, None, weight)
        console.print(
            f"chi squared of {len(found.base_values)} base parameters: found "
            f"{found.chi_squared:.1f}, shipped model {shipped:.1f}",
            highlight=False,
        )
        for i in np.argsort(-np.abs(found.deviations))[:5]:
            name = found.base_names[i].split()[0]
            console.print(
                f"{name}: {found.deviations[i]:+.3g} standard deviations off", highlight=False
            )
        # with nothing known of its bodies, it is no robot that anybody would believe
        for file in [] if widest else write_consistent(subject, found, out).files:
            console.print(str(file), soft_wrap=True, highlight=False)
