"""Exact input-output linearization of a robot along a path, compiled once."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.control import actuation
from pfsc_drake.control.actuation import DrivenMotion, DriveState, joint_jets
from pfsc_drake.control.path_coordinates import PathGeometry, path_coordinates
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PathPointLayout
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel

RELATIVE_DEGREE = {
    "velocity_servo": 1,
    "rigid": 2,
    "singular_perturbation": 2,
    "visco_elastic": 3,
    "elastic": 4,
}


@dataclass
class ActuationOptions:
    """What some of the actuation models need besides the robot.

    Attributes:
        sampling_time: Sampling time ``T_s`` of the controller [s] (``visco_elastic``,
            ``elastic``); 0 for a continuous controller.
        boundary_layer_damping: Diagonal of ``epsilon D_b`` [s], shape (N,)
            (``singular_perturbation``).
    """

    sampling_time: float = 1e-3
    boundary_layer_damping: np.ndarray | None = None


@dataclass(frozen=True)
class Linearization:
    """The affine relation between the drives and the virtual output's r-th derivative.

    ``yhat^(r) = A q^(r) + b`` and ``u = gain q^(r) + drift + offset``.

    Attributes:
        function: CasADi function ``(state, tau_ext, path_point) -> (Y, A, b, gain, drift,
            offset)``.
            ``state`` is ``[q_J, v_J, q_M, v_M]``, shape (4N,); ``tau_ext`` holds the
            external torques and their derivatives up to order r - 2, shape
            (N max(r - 1, 0),); ``path_point`` is laid out by ``layout``. ``Y`` holds the
            derivatives 0..r-1 of the virtual output in its columns, shape (m, r).
        relative_degree: ``r``.
        layout: Layout of the path point.
        num_joints: ``N``.
        num_outputs: ``m``, 3 (position) or 6 (position and orientation).
        extrapolated: Whether ``gain q^(r) + drift`` is to be extrapolated to the middle
            of the sampling interval.
    """

    function: ca.Function
    relative_degree: int
    layout: PathPointLayout
    num_joints: int
    num_outputs: int
    extrapolated: bool


def linearize_path(
    robot: RobotModel,
    law: str,
    *,
    oriented: bool,
    options: ActuationOptions | None = None,
) -> Linearization:
    """Derive the path following law of a robot, see (3.28), (3.50), (3.57), (3.64).

    Args:
        robot: The robot.
        law: Actuation model that the law is made for, a key of ``RELATIVE_DEGREE``.
        oriented: Whether the tool's orientation follows the path too.
        options: What the actuation model needs besides.

    Raises:
        InputError: If the law is unknown, or does not suit the robot or the path.
    """
    if law not in RELATIVE_DEGREE:
        raise InputError(f"law '{law}': unknown; allowed are {', '.join(RELATIVE_DEGREE)}")
    r, n, m = RELATIVE_DEGREE[law], robot.dimension, 6 if oriented else 3
    if n != m:
        raise InputError(
            f"law '{law}': {n} joints for {m} outputs "
            f"({'position and orientation' if oriented else 'position only'}); "
            "they must be as many"
        )
    layout = PathPointLayout(r, oriented)
    state, tau_ext = ca.SX.sym("state", 4 * n), ca.SX.sym("tau_ext", n * max(r - 1, 0))
    point = ca.SX.sym("path_point", layout.size)
    external = ca.vertsplit(tau_ext, n) if r > 1 else []
    q_J, v_J, q_M, v_M = ca.vertsplit(state, n)
    measured = DriveState(q_J, v_J, q_M, v_M, external)
    options = options or ActuationOptions()
    motion = _driven_motion(robot, law, measured, options)
    path = _path_geometry(layout, point)

    q = joint_jets([*motion.q, ca.SX(n, 1)])
    output = _virtual_output(robot, q, path)
    Y = ca.horzcat(*[ca.vertcat(*[y.derivative(k) for y in output]) for k in range(r)])
    b = ca.vertcat(*[y.derivative(r) for y in output])
    drives = [motion.gain, motion.drift, motion.offset]
    results = [Y, _decoupling_matrix(robot, motion, path), b, *drives]
    function = ca.Function(
        f"path_{law}",
        [state, tau_ext, point],
        [ca.densify(e) for e in ca.cse(results)],
        ["state", "tau_ext", "path_point"],
        ["Y", "A", "b", "gain", "drift", "offset"],
    )
    extrapolated = law == "elastic" and options.sampling_time > 0.0
    return Linearization(function, r, layout, n, m, extrapolated)


def _driven_motion(
    robot: RobotModel, law: str, state: DriveState, options: ActuationOptions
) -> DrivenMotion:
    if law in ("visco_elastic", "elastic") and not 0.0 <= options.sampling_time < np.inf:
        raise InputError(
            f"sampling_time: {options.sampling_time}; must be zero or a positive number of seconds"
        )
    if law == "visco_elastic":
        if options.sampling_time == 0.0 and not np.all(robot.K_d > 0.0):
            raise InputError(
                f"joint damping: {robot.K_d}; the law 'visco_elastic' needs positive values "
                "when sampling_time is 0"
            )
        return actuation.visco_elastic(robot, state, options.sampling_time)
    if law == "elastic":
        return actuation.elastic(robot, state, options.sampling_time)
    if law == "singular_perturbation":
        damping = options.boundary_layer_damping
        if damping is None or np.shape(damping) != (robot.dimension,) or not np.min(damping) > 0:
            raise InputError(
                f"boundary_layer_damping: {damping}; the law 'singular_perturbation' needs "
                f"{robot.dimension} positive values [s]"
            )
        return actuation.singular_perturbation(robot, state, damping)
    models = {
        "velocity_servo": actuation.velocity_servo,
        "rigid": actuation.rigid,
    }
    return models[law](robot, state)


def _path_geometry(layout: PathPointLayout, point: ca.SX) -> PathGeometry:
    quaternion = ca.vertsplit(point[layout.quaternion], 4) if layout.oriented else []
    return PathGeometry(
        eta=point[layout.eta],
        normal=point[layout.normal],
        position=ca.vertsplit(point[layout.position], 3),
        quaternion=quaternion,
    )


def _virtual_output(robot: RobotModel, q: list[Jet], path: PathGeometry) -> list[Jet]:
    return path_coordinates(*robot.tool_pose(q), path)


def _decoupling_matrix(robot: RobotModel, motion: DrivenMotion, path: PathGeometry) -> ca.SX:
    """Return ``A = d yhat / dq`` (3.22): the virtual output's rate is ``A q'``."""
    rate = ca.SX.sym("rate", robot.dimension)
    output = _virtual_output(robot, joint_jets([motion.q[0], rate]), path)
    return ca.jacobian(ca.vertcat(*[y.coefficients[1] for y in output]), rate)
