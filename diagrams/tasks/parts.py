"""Parts of a path following station, made from a scenario's parameters."""

from pathlib import Path as FilePath
from typing import Literal, cast

import numpy as np

from diagrams.scenario.schema import (
    BentLemniscate,
    Circle,
    ControllerParameters,
    GainParameters,
    Line,
    OrientationParameters,
    PathParameters,
    Waypoints,
)
from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.law import PathLaw, SafeState
from pfsc_drake.control.law.linearization import (
    RELATIVE_DEGREE,
    ActuationOptions,
    linearize_path,
)
from pfsc_drake.control.law.stabilization import CoordinateGains, Stabilization, gains_from_poles
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Curve,
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    interpolate_orientation,
    path_from_waypoints,
    read_waypoints,
    zyx_to_quaternion,
    zyz_to_quaternion,
)
from pfsc_drake.robot.robot_model import RobotModel

_EULER = {"zyx": zyx_to_quaternion, "zyz": zyz_to_quaternion}
_COORDINATES = {3: ("eta", "xi", "xi"), 6: ("eta", "xi", "xi", "phi", "phi", "phi")}


def make_path(parameters: PathParameters, law: str, folder: FilePath) -> Path:
    """Return the path, smooth enough for the law.

    Args:
        parameters: What the scenario says.
        law: Key of ``RELATIVE_DEGREE``; decides the class C^(r+1) of splines.
        folder: Where relative file names start.

    Raises:
        InputError: If the path cannot be made or is not smooth enough.
    """
    smoothness = RELATIVE_DEGREE[law] + 1
    shape = parameters.shape
    if isinstance(shape, Waypoints):
        table = read_waypoints(folder / shape.file)
        path = path_from_waypoints(
            table,
            smoothness=shape.smoothness or smoothness,
            closed=shape.closed,
            parametrization=cast(Literal["chord", "centripetal"], shape.parametrization),
        )
        if parameters.orientation.keyframes:
            orientation = _orientation(parameters.orientation, path.position, smoothness)
            path = Path(path.position, orientation)
    else:
        position = _position(shape)
        path = Path(position, _orientation(parameters.orientation, position, smoothness))
    path.require_smoothness(smoothness, f"the law '{law}'")
    return path


def _position(shape: BentLemniscate | Circle | Line) -> Curve:
    if isinstance(shape, Circle):
        return FourierCurve.circle(shape.center, shape.radius, shape.axis_u, shape.axis_v)
    if isinstance(shape, Line):
        return PiecewisePolynomialCurve.line(shape.start, shape.end)
    return FourierCurve.bent_lemniscate()


def _orientation(
    parameters: OrientationParameters, position: Curve, smoothness: int
) -> OrientationCurve | None:
    """Return the interpolated keyframes, or None if there are none."""
    keyframes = parameters.keyframes
    if not keyframes:
        return None
    to_quaternion = _EULER[parameters.convention]
    quaternions = to_quaternion(np.deg2rad([keyframe.angles_deg for keyframe in keyframes]))
    if len(keyframes) == 1:
        return OrientationCurve.fixed(quaternions[0], position.domain)
    begin, end = position.domain
    fractions = np.array([keyframe.theta for keyframe in keyframes])
    if position.closed:
        fractions = np.append(fractions, fractions[0] + 1.0)
        quaternions = np.vstack([quaternions, quaternions[:1]])
    span = fractions[-1] - fractions[0]
    if fractions[0] != 0.0 or not np.isclose(span, 1.0):
        raise InputError(
            f"orientation keyframes: theta runs from {fractions[0]:g} to {fractions[-1]:g}; "
            "it must run from 0 to 1 (on closed paths the first keyframe stands for 1 too)"
        )
    return interpolate_orientation(
        quaternions,
        begin + fractions * (end - begin),
        smoothness=smoothness,
        closed=position.closed,
    )


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
