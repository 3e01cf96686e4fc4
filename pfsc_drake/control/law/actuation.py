"""Actuation models: from the drive input to the joint motion, for every kind of drive.

With any kind of drive, the joints' motion is known from the state up to order
r - 1, and the drive input is affine in the joint derivative of order r, the
relative degree: ``u = gain q^(r) + drift + offset``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import casadi as ca
import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel

_FOR_RIGID = ("velocity_servo", "rigid")
_FOR_MIXED = (*_FOR_RIGID, "singular_perturbation")


@dataclass(frozen=True)
class DriveState:
    """Measured state of the drives and joints, as expressions.

    Attributes:
        q_J: Joint coordinates [rad or m], shape (N, 1).
        v_J: Joint velocities, shape (N, 1).
        q_M: Motor coordinates on the joint side, shape (N, 1).
        v_M: Motor velocities on the joint side, shape (N, 1).
        tau_ext: External joint torques and their time derivatives [Nm],
            orders 0..r-2, each (N, 1).
    """

    q_J: ca.SX
    v_J: ca.SX
    q_M: ca.SX
    v_M: ca.SX
    tau_ext: Sequence[ca.SX]


@dataclass(frozen=True)
class DrivenMotion:
    """Joint motion implied by the state, and the input that continues it.

    Attributes:
        q: Joint coordinates and their time derivatives, orders 0..r-1, each (N, 1).
        gain: Matrix of ``u = gain q^(r) + drift + offset``, shape (N, N).
        drift: Varying part of the input beside the gain, shape (N, 1).
        offset: Remaining part, already averaged over the sampling interval if the law
            respects the hold, shape (N, 1).
    """

    q: Sequence[ca.SX]
    gain: ca.SX
    drift: ca.SX
    offset: ca.SX


def velocity_servo(robot: RobotModel, state: DriveState) -> DrivenMotion:
    """Joint velocity servos (3.48), r = 1: the input is ``q'``. For joints of any kind."""
    n = robot.dimension
    return DrivenMotion([state.q_J], ca.SX.eye(n), ca.SX(n, 1), ca.SX(n, 1))


def rigid(robot: RobotModel, state: DriveState, *, changes: bool = False) -> DrivenMotion:
    """Rigid joints (2.42), r = 2: the inverse dynamics of (3.29).

    With elastic joints the law acts on motor coordinates, because with link
    coordinates the loop is unstable (Sec. 3.8.3). It applies to any mixture of rigid and
    elastic joints: motor and link coordinate of a rigid joint are equal.

    Args:
        robot: The robot.
        state: Its state.
        changes: Whether weight, Coriolis terms and damping change while the torque is held: all
            except external torques is then drift, to be extrapolated.
    """
    q, v = (state.q_J, state.v_J) if robot.is_rigid else (state.q_M, state.v_M)
    D_E = robot.mass_matrix(q)
    n_E = _link_torque(robot, [q, v, ca.SX(robot.dimension, 1)], 0)
    gain, viscous = D_E + ca.diag(robot.D_M), _viscous(robot) * v
    if changes:
        return DrivenMotion([q, v], gain, n_E + viscous, -state.tau_ext[0])
    return DrivenMotion([q, v], gain, ca.SX(*n_E.shape), n_E - state.tau_ext[0] + viscous)


def singular_perturbation(
    robot: RobotModel, state: DriveState, boundary_layer_damping: np.ndarray
) -> DrivenMotion:
    """Composite law for stiff elastic joints, r = 2: slow (3.70) plus fast (3.71).

    Rigid joints among them have no fast part.

    Args:
        robot: The robot.
        state: Its state.
        boundary_layer_damping: Diagonal of ``epsilon D_b`` [s], shape (N,).
    """
    if robot.is_rigid:
        _refuse(robot, "singular_perturbation")
    D_E = robot.mass_matrix(state.q_J)
    n_E = _link_torque(robot, [state.q_J, state.v_J, ca.SX(robot.dimension, 1)], 0)
    tau_J_rate = robot.springs * (state.v_M - state.v_J)
    fast = -ca.DM(boundary_layer_damping) * tau_J_rate
    return DrivenMotion(
        [state.q_J, state.v_J],
        D_E + ca.diag(robot.D_M),
        ca.SX(*n_E.shape),
        n_E - state.tau_ext[0] + fast + _viscous(robot) * state.v_M,
    )


def visco_elastic(robot: RobotModel, state: DriveState, sampling_time: float) -> DrivenMotion:
    """Visco-elastic joints (2.65), (2.66), r = 3, in the form that respects the hold.

    Every joint must be elastic: rigid ones among them would have another relative degree.

    The motor acceleration is constant over a sampling interval; it is chosen so that the
    joint torque's rate has reached tau_J' at the interval's end (implicit)::

        a_M = (tau_J' - K_s (v_M - v_J) + (K_d + K_s T_s) a_J) / (K_d + K_s T_s)

    As in :func:`elastic`, ``tau_J`` and ``a_J`` enter by their means over the interval,
    ``tau_J + T_s/2 tau_J'`` and ``a_J + T_s/2 q'''``, and ``tau_J'`` by its value at the
    interval's end: ``gain q''' + drift`` must be extrapolated by ``T_s``. Otherwise the error
    is of first order in T_s, 25 times as large on the bent lemniscate at 1.5 m/s.

    ``T_s = 0`` gives (3.58) as printed, whose zero dynamics (3.60) decay with
    K_s / K_d, often too fast for a sampled controller.

    Args:
        robot: The robot.
        state: Its state.
        sampling_time: Sampling time ``T_s`` of the controller [s].
    """
    _require_elastic(robot, "visco_elastic")
    K_s, K_d, D_M = ca.SX(robot.K_s), ca.DM(robot.K_d), ca.SX(robot.D_M)
    tau_J = K_s * (state.q_M - state.q_J) + K_d * (state.v_M - state.v_J)
    D_E = robot.mass_matrix(state.q_J)
    a_J = _link_acceleration(robot, state, D_E, tau_J)
    # tau_J' = D_E q''' + known
    known = _link_torque(robot, [state.q_J, state.v_J, a_J, ca.SX(*a_J.shape)], 1)
    known = known - state.tau_ext[1]
    K = K_d + K_s * sampling_time
    half, viscous = sampling_time / 2.0, _viscous(robot)
    # viscous damping takes the mean motor velocity, v_M + T_s/2 a_M
    D_v = D_M + half * viscous
    per_rate = D_v / K + half
    return DrivenMotion(
        [state.q_J, state.v_J, a_J],
        ca.diag(per_rate) @ D_E + half * ca.diag(D_v),
        per_rate * known,
        D_v * a_J + tau_J - D_v / K * K_s * (state.v_M - state.v_J) + viscous * state.v_M,
    )


def elastic(robot: RobotModel, state: DriveState, sampling_time: float) -> DrivenMotion:
    """Purely elastic joints (2.65), (2.67), r = 4: the exact law (3.65) for any number of axes.

    Every joint must be elastic, see :func:`visco_elastic`.

    ``a_M = a_J + K_s^-1 tau_J''``, ``tau_d = D_M a_M + tau_J``. While the torque is held,
    ``tau_J`` and ``a_J`` change at known rates; their mean values over the
    sampling interval replace the present ones. The rest, ``D_M K_s^-1 tau_J''``,
    is ``gain q^(4) + drift``; its rate would need one more derivative of everything, so
    that the controller extrapolates it from its last two values.

    Args:
        robot: The robot.
        state: Its state.
        sampling_time: Sampling time ``T_s`` of the controller [s]; 0 gives (3.65) as printed.
    """
    _require_elastic(robot, "elastic")
    K_s, D_M = ca.SX(robot.K_s), ca.SX(robot.D_M)
    tau_J = K_s * (state.q_M - state.q_J)
    tau_J_rate = K_s * (state.v_M - state.v_J)
    D_E = robot.mass_matrix(state.q_J)
    a_J = _link_acceleration(robot, state, D_E, tau_J)
    unknown = ca.SX(*a_J.shape)
    residual = _link_torque(robot, [state.q_J, state.v_J, a_J, unknown], 1) - state.tau_ext[1]
    jerk = ca.ldl_solve(tau_J_rate - residual, *ca.ldl(D_E))
    # the joint torque's second derivative is D_E q^(4) + known
    known = _link_torque(robot, [state.q_J, state.v_J, a_J, jerk, unknown], 2)
    known = known - state.tau_ext[2]
    first, second = sampling_time / 2, sampling_time**2 / 6
    # viscous damping takes the mean motor velocity, v_M + T_s/2 a_M
    viscous = _viscous(robot)
    D_v = D_M + first * viscous
    return DrivenMotion(
        [state.q_J, state.v_J, a_J, jerk],
        ca.diag(D_v / K_s + second) @ D_E + second * ca.diag(D_M),
        (D_v / K_s + second) * known,
        D_M * (a_J + first * jerk)
        + tau_J
        + first * tau_J_rate
        + viscous * (state.v_M + first * a_J),
    )


def _viscous(robot: RobotModel) -> ca.DM:
    """Return the viscous damping of the drives, (N, 1); zeros are structural."""
    return ca.sparsify(ca.DM(robot.viscous_damping))


def _link_acceleration(robot: RobotModel, state: DriveState, D_E: ca.SX, tau_J: ca.SX) -> ca.SX:
    """Solve (2.65a) for ``q_J''``."""
    n_E = _link_torque(robot, [state.q_J, state.v_J, ca.SX(robot.dimension, 1)], 0)
    return ca.ldl_solve(tau_J + state.tau_ext[0] - n_E, *ca.ldl(D_E))


def _link_torque(robot: RobotModel, derivatives: Sequence[ca.SX], order: int) -> ca.SX:
    """Return the time derivative of some order of the link-side inverse dynamics."""
    q = joint_jets(derivatives)
    return ca.vertcat(*[tau.derivative(order) for tau in robot.inverse_dynamics(q)])


def joint_jets(derivatives: Sequence[ca.SX]) -> list[Jet]:
    """Return one scalar jet per joint from ``q, q', q'', ...``, each (N, 1)."""
    return [
        Jet.from_derivatives([d[i] for d in derivatives]) for i in range(derivatives[0].numel())
    ]


def _require_elastic(robot: RobotModel, law: str) -> None:
    if not robot.is_elastic:
        _refuse(robot, law)


def _refuse(robot: RobotModel, law: str) -> NoReturn:
    """Raise an error with the unsuitable joints of a law, and the laws for the robot."""
    stiff = [name for name, k in zip(robot.names, robot.K_s, strict=True) if not np.isfinite(k)]
    suitable = _FOR_RIGID if robot.is_rigid else _FOR_MIXED
    raise InputError(
        f"law '{law}': needs a robot with elastic joints; rigid are {', '.join(stiff)}; "
        f"laws for this robot: {', '.join(suitable)}"
    )
