"""One sample of stop and hold of a robot, as a function."""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import is_finite
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel

# largest share of a velocity that sampled damping may remove in one period
_LARGEST_STEP = 0.3
# 1/s, correction rate of an integrated motor position by the link side
_CORRECTION = 10.0
# weight of the newest difference quotient of a position
_NEWEST = 0.6
# share of the damping with a differentiated velocity, which is late
_DIFFERENTIATED = 0.5
# share of the gains with measurements of only the link side of an elastic joint
_FAR_SIDE = 0.5
# s, longest time without control of a joint until brakes are requested
UNHELD = 0.05
# damping ratio of a simulated motor that follows its link
_FOLLOWING = 0.3


class StopMemory(NamedTuple):
    """Memory of a stop of N joints.

    Attributes:
        elapsed: Time since the fault [s], shape (1,).
        duration: Duration of the stop [s], shape (1,).
        q_0: Position of the links at the fault, shape (N,).
        v_0: Their velocity, shape (N,).
        offset: Deviation of the motors from their reference at the fault, shape (N,).
        offset_rate: Deviation of their velocity, shape (N,).
        inertia: Diagonal of ``D_E + D_M`` at the fault, shape (N,).
        position: Integrated position of the motors, shape (N,).
        rate: Rate of their position, differentiated, shape (N,).
        unheld: Time without control of a joint for lack of measurements [s], shape (1,).
        ignored: Implausible components of the state, nonzero if so, shape (4N,).
        last: State of the last sample, shape (4N,).
    """

    elapsed: Any
    duration: Any
    q_0: Any
    v_0: Any
    offset: Any
    offset_rate: Any
    inertia: Any
    position: Any
    rate: Any
    unheld: Any
    ignored: Any
    last: Any

    @classmethod
    def sizes(cls, num_joints: int) -> dict[str, int]:
        """Return the sizes of the fields.

        Args:
            num_joints: N.
        """
        sizes = [1, 1, *[num_joints] * 7, 1, 4 * num_joints, 4 * num_joints]
        return dict(zip(cls._fields, sizes, strict=True))


class Joints(NamedTuple):
    """Constants of the joints, each of shape (N,).

    Attributes:
        elastic: Whether a joint is elastic, 1 or 0.
        stiffness: Stiffness [Nm/rad or N/m], 0 of a rigid joint.
        compliance: Inverse of the stiffness, 0 of a rigid joint.
        D_M: Inertia of the motors [kg m^2 or kg].
        viscous: Friction of the motors [Nm s/rad or N s/m].
        limits: Limits of the drives' torques [Nm or N].
        damping: Least damping of every drive [Nm s/rad or N s/m].
    """

    elastic: ca.DM
    stiffness: ca.DM
    compliance: ca.DM
    D_M: ca.DM
    viscous: ca.DM
    limits: ca.DM
    damping: ca.DM

    @classmethod
    def of(cls, robot: RobotModel, limits: np.ndarray, damping: np.ndarray) -> "Joints":
        """Return the constants of a robot.

        Args:
            robot: The robot.
            limits: Limits of its drives' torques [Nm or N], shape (N,).
            damping: Least damping of every drive [Nm s/rad or N s/m], shape (N,).
        """
        elastic = robot.elastic_joints
        stiffness = np.where(elastic, robot.K_s, 0.0)
        compliance = np.where(elastic, 1.0 / robot.K_s, 0.0)
        constants = (stiffness, compliance, robot.D_M, robot.viscous_damping, limits, damping)
        return cls(*[ca.DM(np.asarray(x, dtype=float)) for x in (elastic, *constants)])


@once_per_content()
def stopping_step(
    robot: RobotModel, joints: Joints, bandwidth: float, period: float
) -> ca.Function:
    """Return ``(elapsed, .., last, state, suspects) -> (drive, elapsed, .., last)``.

    See :class:`SafeStop`; ``elapsed, .., last`` are the fields of :class:`StopMemory`, now and one
    period later. ``drive`` are the drives' torques within their limits, shape (N,); NaN or
    infinite components of the state only affect the memory.

    Args:
        robot: Nominal model of the robot, N joints.
        joints: Constants of its joints.
        bandwidth: ``omega`` of the position hold [rad/s].
        period: Sampling time [s].
    """
    n, sizes = robot.dimension, StopMemory.sizes(robot.dimension)
    memory = StopMemory(*[ca.SX.sym(name, size) for name, size in sizes.items()])
    state, suspects = ca.SX.sym("state", 4 * n), ca.SX.sym("suspects", 4 * n)
    now, last = ca.vertsplit(state, n), ca.vertsplit(memory.last, n)
    good = ca.vertsplit(ca.logic_and(is_finite(state), memory.ignored == 0.0), n)
    far = joints.elastic * good[0] * (1.0 - good[2]) * (1.0 - good[3])

    T = memory.duration
    distance, fading, slope = _stop(ca.fmin(memory.elapsed / T, 1.0))
    v_0 = memory.v_0
    q_r, v_r, a_r = memory.q_0 + v_0 * (T * distance), v_0 * fading, v_0 * (slope / T)
    tau_J = inverse_dynamics(robot, q_r, v_r, a_r)
    reference = q_r + tau_J * joints.compliance + fading * memory.offset
    rate_r = v_r + fading * memory.offset_rate
    forward = tau_J + joints.D_M * a_r + joints.viscous * v_r

    q_M, v_M, share, braking = _motors(memory, now, good, far, joints)
    K_p, K_v = _gains(memory.inertia, joints, bandwidth, period)
    unlimited = forward + share * K_p * (reference - q_M) + braking * K_v * (rate_r - v_M)
    drive = ca.fmin(ca.fmax(unlimited, -joints.limits), joints.limits)

    # by the link's position, with the planned deflection of the spring
    away = ca.if_else(good[0], now[0] + (reference - q_r) - q_M, 0.0)
    drawn = ca.if_else(good[2], 0.0, period * _CORRECTION * away)
    simulated = v_M + period * _motor_acceleration(drive, now, q_M, v_M, joints)
    position = ca.if_else(far, q_M + period * simulated, q_M + period * v_M + drawn)
    # rigid joints measure their motors' positions on either side
    own = ca.logic_or(good[2], joints.elastic)
    newest = ca.if_else(own, now[2] - last[2], now[0] - last[0]) / period
    rate = memory.rate + _NEWEST * (newest - memory.rate)
    rate = ca.if_else(far, simulated, ca.if_else(is_finite(rate), rate, 0.0))

    # a joint that is measured again within the longest time is controlled again
    is_controlled = ca.logic_and(ca.mmin(share) > 0.0, memory.unheld < UNHELD)
    after = memory._replace(
        elapsed=memory.elapsed + period,
        position=position,
        rate=rate,
        unheld=ca.if_else(is_controlled, 0.0, memory.unheld + period),
        ignored=ca.fmax(memory.ignored, suspects),
        last=state,
    )
    return ca.Function(
        "stopping_step",
        [*memory, state, suspects],
        ca.cse([ca.densify(x) for x in (drive, *after)]),
        [*sizes, "state", "suspects"],
        ["drive", *(f"next_{name}" for name in sizes)],
    )


def inverse_dynamics(robot: RobotModel, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
    """Return ``tau_J``, shape (N,).

    Args:
        robot: Nominal model of the robot, N joints.
        q: Joint coordinates, shape (N,).
        v: Joint velocities, shape (N,).
        a: Joint accelerations, shape (N,).
    """
    motion = [Jet.from_derivatives([q[i], v[i], a[i]]) for i in range(robot.dimension)]
    return ca.vertcat(*[jet.coefficients[0] for jet in robot.inverse_dynamics(motion)])


def _stop(x: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return distance, rate and slope of a stop at a share of its time: rate 1 - 3 x^2 + 2 x^3."""
    return x - x**3 + 0.5 * x**4, 1.0 - 3.0 * x**2 + 2.0 * x**3, 6.0 * (x**2 - x)


def _gains(inertia: ca.SX, joints: Joints, omega: float, period: float) -> tuple[ca.SX, ca.SX]:
    """Return ``K_p`` [Nm/rad] and ``K_v`` [Nm s/rad], each (N,)."""
    damping = ca.fmax(2.0 * omega * inertia, joints.damping)
    # inertia that a torque accelerates within a period
    nearest = ca.if_else(joints.elastic, joints.D_M, inertia)
    K_v = ca.fmin(damping, _LARGEST_STEP * nearest / period)
    # a nearly clamped motor does not damp the link on its spring
    oscillating = ca.sqrt(joints.stiffness * ca.fmax(inertia - joints.D_M, 0.0))
    K_v = ca.if_else(joints.elastic, ca.fmin(K_v, oscillating), K_v)
    return inertia * ca.fmin(omega, K_v / (2.0 * inertia)) ** 2, K_v


def _motor_acceleration(
    torque: ca.SX, now: list[ca.SX], q_M: ca.SX, v_M: ca.SX, joints: Joints
) -> ca.SX:
    """Return the acceleration of simulated motors, shape (N,)."""
    D_M = ca.if_else(joints.D_M > 0.0, joints.D_M, ca.inf)
    damping = 2.0 * _FOLLOWING * ca.sqrt(joints.stiffness * joints.D_M)
    following = damping * (v_M - ca.if_else(is_finite(now[1]), now[1], 0.0))
    return (torque - joints.viscous * v_M - joints.stiffness * (q_M - now[0]) - following) / D_M


def _motors(
    memory: StopMemory,
    now: list[ca.SX],
    good: list[ca.SX],
    far: ca.SX,
    joints: Joints,
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return the motors' positions and velocities, and shares of the gains, each (N,)."""
    q_J, v_J, q_M, v_M = now
    has_q_J, has_v_J, has_q_M, has_v_M = good
    rigid = 1.0 - joints.elastic
    position = ca.if_else(rigid * has_q_J, q_J, memory.position)
    position = ca.if_else(has_q_M, q_M, position)
    near, by_link = ca.logic_or(has_q_M, rigid * has_q_J), rigid * has_v_J
    has_velocity = ca.logic_or(has_v_M, by_link)
    velocity = ca.if_else(has_v_M, v_M, ca.if_else(by_link, v_J, memory.rate))
    known = ca.logic_or(has_velocity, near)
    velocity = ca.if_else(ca.logic_or(known, far), velocity, 0.0)
    share = ca.if_else(known, 1.0, _FAR_SIDE * far)
    braking = ca.if_else(has_velocity, 1.0, ca.if_else(near, _DIFFERENTIATED, _FAR_SIDE * far))
    return position, velocity, share, braking
