"""One tick of a robot that is being stopped and held, as a function."""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import is_finite
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel

# largest part of a velocity that sampled damping may take off in one period
_LARGEST_STEP = 0.3
# 1/s, by which an integrated motor position is drawn to what the link side says
_CORRECTION = 10.0
# weight of the newest difference quotient of a position
_NEWEST = 0.6
# of the damping where the velocity is differentiated, which takes its time
_DIFFERENTIATED = 0.5
# of the gains where only the link side of an elastic joint is seen
_FAR_SIDE = 0.5
# s, the longest time for which a joint may be held by nothing until brakes are requested
UNHELD = 0.05
# damping ratio by which a motor that is not seen is thought to follow its link
_FOLLOWING = 0.3


class StopMemory(NamedTuple):
    """What is remembered of a stop of N joints.

    Attributes:
        elapsed: Since the fault [s], shape (1,).
        duration: Duration of the stop [s], shape (1,).
        q_0: Position of the links at the fault, shape (N,).
        v_0: Their velocity, shape (N,).
        offset: By how much the motors were beside their reference at the fault, shape (N,).
        offset_rate: The same of their velocity, shape (N,).
        inertia: Diagonal of ``D_E + D_M`` at the fault, shape (N,).
        position: Position of the motors, as far as it is integrated, shape (N,).
        rate: Rate of their position, differentiated, shape (N,).
        unheld: For how long nothing has held some joint, of which nothing is measured [s],
            shape (1,).
        ignored: What of the state is not to be believed, nonzero if so, shape (4N,).
        last: State of the last tick, shape (4N,).
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
        """Return how many elements each has.

        Args:
            num_joints: N.
        """
        sizes = [1, 1, *[num_joints] * 7, 1, 4 * num_joints, 4 * num_joints]
        return dict(zip(cls._fields, sizes, strict=True))


class Joints(NamedTuple):
    """Constants of the joints, each of shape (N,).

    Attributes:
        elastic: Whether a joint is, 1 or 0.
        stiffness: [Nm/rad or N/m], 0 of a rigid joint.
        compliance: Its inverse, 0 of a rigid joint.
        D_M: Inertia of the motors [kg m^2 or kg].
        viscous: Friction of the motors [Nm s/rad or N s/m].
        limits: Limits of the drives' torques [Nm or N].
        damping: Damping of every drive at least [Nm s/rad or N s/m].
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
        """Return those of a robot.

        Args:
            robot: The robot.
            limits: Limits of its drives' torques [Nm or N], shape (N,).
            damping: Damping of every drive at least [Nm s/rad or N s/m], shape (N,).
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
    period later. ``drive`` are the drives' torques within their limits, shape (N,); of a state
    that is not finite only the memory tells.

    Args:
        robot: The robot as it is believed, N joints.
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
    way, fading, slope = _stop(ca.fmin(memory.elapsed / T, 1.0))
    v_0 = memory.v_0
    q_r, v_r, a_r = memory.q_0 + v_0 * (T * way), v_0 * fading, v_0 * (slope / T)
    tau_J = inverse_dynamics(robot, q_r, v_r, a_r)
    reference = q_r + tau_J * joints.compliance + fading * memory.offset
    rate_r = v_r + fading * memory.offset_rate
    forward = tau_J + joints.D_M * a_r + joints.viscous * v_r

    q_M, v_M, share, braking = _motors(memory, now, good, far, joints)
    K_p, K_v = _gains(memory.inertia, joints, bandwidth, period)
    wanted = forward + share * K_p * (reference - q_M) + braking * K_v * (rate_r - v_M)
    drive = ca.fmin(ca.fmax(wanted, -joints.limits), joints.limits)

    # of the link's position, with the spring's deflection as it is planned
    away = ca.if_else(good[0], now[0] + (reference - q_r) - q_M, 0.0)
    drawn = ca.if_else(good[2], 0.0, period * _CORRECTION * away)
    simulated = v_M + period * _motor_acceleration(drive, now, q_M, v_M, joints)
    position = ca.if_else(far, q_M + period * simulated, q_M + period * v_M + drawn)
    # rigid joints have their motors' positions on either side
    own = ca.logic_or(good[2], joints.elastic)
    newest = ca.if_else(own, now[2] - last[2], now[0] - last[0]) / period
    rate = memory.rate + _NEWEST * (newest - memory.rate)
    rate = ca.if_else(far, simulated, ca.if_else(is_finite(rate), rate, 0.0))

    # a joint that is seen again within the longest time is held again
    is_held = ca.logic_and(ca.mmin(share) > 0.0, memory.unheld < UNHELD)
    after = memory._replace(
        elapsed=memory.elapsed + period,
        position=position,
        rate=rate,
        unheld=ca.if_else(is_held, 0.0, memory.unheld + period),
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
        robot: The robot as it is believed, N joints.
        q: Joint coordinates, shape (N,).
        v: Their velocities, shape (N,).
        a: Their accelerations, shape (N,).
    """
    motion = [Jet.from_derivatives([q[i], v[i], a[i]]) for i in range(robot.dimension)]
    return ca.vertcat(*[jet.coefficients[0] for jet in robot.inverse_dynamics(motion)])


def _stop(x: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return way, rate and slope of a stop at a part of its time: rate 1 - 3 x^2 + 2 x^3."""
    return x - x**3 + 0.5 * x**4, 1.0 - 3.0 * x**2 + 2.0 * x**3, 6.0 * (x**2 - x)


def _gains(inertia: ca.SX, joints: Joints, omega: float, period: float) -> tuple[ca.SX, ca.SX]:
    """Return ``K_p`` [Nm/rad] and ``K_v`` [Nm s/rad], each (N,)."""
    damping = ca.fmax(2.0 * omega * inertia, joints.damping)
    # what a torque that is held over a period moves at once
    nearest = ca.if_else(joints.elastic, joints.D_M, inertia)
    K_v = ca.fmin(damping, _LARGEST_STEP * nearest / period)
    # a motor that is all but clamped lets the link swing on its spring
    swinging = ca.sqrt(joints.stiffness * ca.fmax(inertia - joints.D_M, 0.0))
    K_v = ca.if_else(joints.elastic, ca.fmin(K_v, swinging), K_v)
    return inertia * ca.fmin(omega, K_v / (2.0 * inertia)) ** 2, K_v


def _motor_acceleration(
    torque: ca.SX, now: list[ca.SX], q_M: ca.SX, v_M: ca.SX, joints: Joints
) -> ca.SX:
    """Return the acceleration of motors that are not seen, shape (N,)."""
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
    told = ca.logic_or(has_v_M, by_link)
    velocity = ca.if_else(has_v_M, v_M, ca.if_else(by_link, v_J, memory.rate))
    known = ca.logic_or(told, near)
    velocity = ca.if_else(ca.logic_or(known, far), velocity, 0.0)
    share = ca.if_else(known, 1.0, _FAR_SIDE * far)
    braking = ca.if_else(told, 1.0, ca.if_else(near, _DIFFERENTIATED, _FAR_SIDE * far))
    return position, velocity, share, braking
