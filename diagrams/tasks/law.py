"""The law of a scenario."""

import numpy as np

from diagrams.scenario import (
    ControllerParameters,
    GainParameters,
)
from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.law import PathLaw, SafeState
from pfsc_drake.control.law.linearization import (
    ActuationOptions,
    linearize_path,
)
from pfsc_drake.control.law.stabilization import CoordinateGains, Stabilization, gains_from_poles
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

_COORDINATES = {3: ("eta", "xi", "xi"), 6: ("eta", "xi", "xi", "phi", "phi", "phi")}


def make_law(parameters: ControllerParameters, chain: RobotModel, oriented: bool) -> PathLaw:
    """Return the path following law of a robot.

    Args:
        parameters: What the scenario says.
        chain: The robot.
        oriented: Whether the path has an orientation.

    Raises:
        InputError: If the law does not suit the robot, or its gains are missing or wrong.
    """
    law = parameters.law
    damping = parameters.boundary_layer_damping
    linearization = linearize_path(
        chain,
        law,
        oriented=oriented,
        options=ActuationOptions(parameters.sampling_time, np.array(damping) if damping else None),
        time_driven=parameters.manifold != "path",
    )
    if law not in parameters.gains:
        given = ", ".join(parameters.gains) or "none"
        raise InputError(f"controller.gains: no gains for the law '{law}'; given are {given}")
    by_kind = parameters.gains[law]
    names = _COORDINATES[linearization.num_outputs]
    relative_degree = linearization.relative_degree
    gains = [_gains(getattr(by_kind, name), relative_degree, law, name) for name in names]
    effort = chain.gather("effort_limit") * parameters.effort_scale
    limits = chain.gather("velocity_limit") if relative_degree == 1 else effort
    return PathLaw(
        chain,
        linearization,
        Stabilization(gains, relative_degree, names),
        DecouplingInverse(parameters.min_rcond),
        limits,
        parameters.max_alpha,
        SafeState(parameters.brake_damping * effort),
    )


def _gains(
    parameters: GainParameters, relative_degree: int, law: str, name: str
) -> CoordinateGains:
    if parameters.poles:
        return gains_from_poles(parameters.poles)
    if len(parameters.coefficients) == relative_degree:
        return CoordinateGains(tuple(parameters.coefficients), parameters.integral)
    raise InputError(
        f"controller.gains.{law}.{name}: {len(parameters.coefficients)} coefficients and no poles; "
        f"the law needs {relative_degree} of either"
    )
