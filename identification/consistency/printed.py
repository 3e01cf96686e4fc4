"""``python -m identification printed``: the consistent set nearest to Tab. C.3."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from identification.consistency.bounds import PhysicalBounds, load_bounds
from identification.consistency.nearest import ConsistentParameters, Prediction, nearest_consistent
from identification.consistency.program import PRIOR_WEIGHT
from identification.excitation.fourier import FourierTrajectory
from identification.model.analytic_base import analytic_base, load_printed_identification
from identification.model.regressor import Regressor
from identification.model.subject import Subject, load_subject
from identification.options import check_folder
from pfsc_drake.robot.models.files import models_directory
from reporting.terminal import interruptible

# for how many measurements the motion of Tab. C.2 counts: its torques then are nearer to those of
# Tab. C.3 by a quarter to a half, for 1 % more of chi squared
TORQUE_WEIGHT = 100.0
_RATE = 100.0  # Hz, of the torques
# bounds that are hardly any [kg], [m], [m], and a prior's weight
_ANY_MASS, _ANY_EXTENT, _ANYWHERE, _HARDLY_ANY = (0.01, 1e3), 1e-4, 1.0, 1e-6


def printed_subject() -> Subject:
    """Return the robot of Tab. C.3, without tool."""
    return load_subject(load_printed_identification().name)


def chi_squared_of_printed(subject: Subject, parameters: np.ndarray) -> float:
    """Return chi squared of parameters to Tab. C.3, in units of the printed standard deviations.

    Args:
        subject: The Comau Racer 1.4 without tool.
        parameters: All of them, shape (n,).
    """
    table = load_printed_identification().base_parameters
    values = analytic_base(subject).values(parameters)
    return float(np.sum(((values - table.mean) / table.standard_deviation) ** 2))


def least_to_printed(subject: Subject) -> ConsistentParameters:
    """Return a consistent set with the least chi squared to Tab. C.3 that bodies can have.

    Bounds are so wide that masses and centres of mass are anywhere; it is no robot that anybody
    would believe, but tells how much of chi squared is due to the table.

    Args:
        subject: The Comau Racer 1.4 without tool.
    """
    bounds = load_bounds(load_printed_identification().name)
    for link in bounds.links:
        link.mass[:], link.least_extent = _ANY_MASS, _ANY_EXTENT
        link.center_of_mass.lower[:], link.center_of_mass.upper[:] = -_ANYWHERE, _ANYWHERE
    bounds.rotor_inertia.clear()
    return nearest_to_printed(subject, bounds, 0.0, _HARDLY_ANY)


def nearest_to_printed(
    subject: Subject,
    bounds: PhysicalBounds | None = None,
    torque_weight: float = TORQUE_WEIGHT,
    prior_weight: float = PRIOR_WEIGHT,
) -> ConsistentParameters:
    """Return the consistent parameters nearest to Tab. C.3.

    Chi squared counts the differences to the means in units of the printed standard deviations.

    Args:
        subject: The Comau Racer 1.4 without tool.
        bounds: What is known of its bodies; by default the shipped assumptions.
        torque_weight: For how many measurements the torques on the motion of Tab. C.2 count, in
            units of the noise of Tab. C.4; 0 for chi squared alone.
        prior_weight: Weight of the distance from the middle of the bounds beside chi squared.

    Raises:
        InputError: If the robot is another one.
    """
    printed = load_printed_identification()
    base, table = analytic_base(subject), printed.base_parameters
    folder = models_directory() / printed.name
    trajectory = FourierTrajectory.load(folder / "excitation.yaml")
    q, v, a = trajectory.motion(trajectory.sample_times(_RATE))
    prediction = Prediction(
        base.reduce(Regressor(subject).matrix(q, v, a)), printed.torque.noise_level, torque_weight
    )
    return nearest_consistent(
        base,
        table.mean,
        np.diag(table.standard_deviation**2),
        bounds or load_bounds(printed.name),
        prior_weight=prior_weight,
        prediction=prediction,
    )


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
