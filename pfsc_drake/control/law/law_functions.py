"""Parts of a law as expressions: desired output motion, drive inputs, and faults."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import all_finite, all_of, any_of, first_of, where
from pfsc_drake.control.law.decoupling import DecouplingSolution, Restraint, Spare, scale_of
from pfsc_drake.control.law.exact_linearization import Relation
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.law.posture import Posture, posture_expressions
from pfsc_drake.control.law.stabilization import Stabilization
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices
from pfsc_drake.geometry.nearest_samples import ProjectionStatus
from pfsc_drake.robot.robot_model import RobotModel

# rad, of an error angle; from there on (3.38) is not defined
_LARGEST_ANGLE = math.pi / 2.0


class LawInputs(NamedTuple):
    """Inputs of a law, as expressions.

    Attributes:
        state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point: Laid out by the manifold's layout.
        relation: Relation of drives and virtual output, see :class:`Relation`.
        reference: Derivatives 0..r of the virtual output's reference by rows, shape ((r + 1) m,).
        integral: Integral of the virtual output's error, shape (m,).
        last_varying_input: Extrapolated part of the last sample's drive input, shape (N,).
        known: Whether there was a last sample, 1 or 0.
        tau_ext: External joint torques and derivatives up to order r - 2 by rows [Nm or N, per s,
            ..], shape (N max(r - 1, 0),).
        friction: ``tau_f`` to be compensated [Nm or N], shape (N,).
        last_output: Virtual output of the last sample, shape (m,), from which angles continue.
        posture: Derivatives 0..r of the posture reference by rows, shape ((r + 1) N,), or (0,) of
            a law without posture.
    """

    state: ca.SX
    manifold_point: ca.SX
    relation: ca.SX
    reference: ca.SX
    integral: ca.SX
    last_varying_input: ca.SX
    known: ca.SX
    tau_ext: ca.SX
    friction: ca.SX
    last_output: ca.SX
    posture: ca.SX

    @classmethod
    def symbols(cls, linearization: Linearization, *, has_posture: bool) -> "LawInputs":
        """Return symbols for a law.

        Args:
            linearization: The relation between drives and virtual output.
            has_posture: Whether redundant joints have a posture reference.
        """
        n, m = linearization.num_joints, linearization.num_outputs
        r = linearization.relative_degree
        point, relation = linearization.manifold.layout.size, Relation.size(linearization)
        posture = (r + 1) * n if has_posture else 0
        sizes = (4 * n, point, relation, (r + 1) * m, m, n, 1, n * max(r - 1, 0), n, m, posture)
        return cls(*[ca.SX.sym(name, k) for name, k in zip(cls._fields, sizes, strict=True)])


class Aim(NamedTuple):
    """Desired motion of the virtual output.

    Attributes:
        Y: Derivatives 0..r-1 of the virtual output in columns, shape (m, r).
        Y_p: Derivatives of the reference, shape (m, r).
        v: Desired r-th derivative of the virtual output, shape (m,).
        A: Decoupling matrix, shape (m, N).
        rhs: ``v - b``, shape (m,).
        motion: Derivatives 0..r-1 of the joint coordinates in columns, shape (N, r).
        angle: Largest error angle [rad].
    """

    Y: ca.SX
    Y_p: ca.SX
    v: ca.SX
    A: ca.SX
    rhs: ca.SX
    motion: ca.SX
    angle: ca.SX


class DriveRelation(NamedTuple):
    """Drive inputs as an affine function of the highest joint derivative ``x = q^(r)``.

    ``varying_input = gain x + drift`` is extrapolated by ``lead`` samples, ``offset`` is added.

    Attributes:
        gain: Shape (N, N).
        drift: Shape (N,).
        offset: Constant part, shape (N,).
        lead: Extrapolation in samples.
        last_varying_input: ``varying_input`` of the last sample, shape (N,).
    """

    gain: ca.SX
    drift: ca.SX
    offset: ca.SX
    lead: ca.SX
    last_varying_input: ca.SX

    def varying_input(self, x: ca.SX) -> ca.SX:
        """Return the extrapolated part of the drive input, shape (N,)."""
        return self.gain @ x + self.drift

    def input(self, x: ca.SX) -> ca.SX:
        """Return the drive input without limits, shape (N,)."""
        varying = self.varying_input(x)
        return varying + self.lead * (varying - self.last_varying_input) + self.offset


def aim_and_drives(
    u: LawInputs, linearization: Linearization, stabilization: Stabilization
) -> tuple[Aim, DriveRelation]:
    """Return the desired motion of the virtual output, and the relation of the drives.

    Args:
        u: Inputs of the law.
        linearization: Linearization of the relation.
        stabilization: Gains of the virtual output.
    """
    m, r = linearization.num_outputs, linearization.relative_degree
    Y, A, b, gain, drift, offset, motion = Relation.of(u.relation, linearization)
    y_p = ca.vertsplit(u.reference, m)
    if linearization.manifold.follows_time:
        # the reference point moves with time, and the errors relative to it vanish
        y_p = [ca.SX(m, 1)] * (r + 1)
    angle = ca.SX(0.0)
    turning = indices(linearization.manifold.coordinates, Kind.ROTATIONAL)
    if turning.stop:
        Y[turning, 0] += _whole_turns(u.last_output[turning] - Y[turning, 0])
        angle = ca.mmax(ca.fabs(Y[turning, 0] - y_p[0][turning]))
    v = stabilization.virtual_input(ca.horzsplit(Y), y_p, u.integral)
    lead = where(u.known, linearization.lead, 0.0)
    aim = Aim(Y, ca.horzcat(*y_p[:r]), v, A, v - b, motion, angle)
    return aim, DriveRelation(gain, drift, offset + u.friction, lead, u.last_varying_input)


def spare_motion(
    posture: Posture, robot: RobotModel, motion: Sequence[ca.SX], reference: ca.SX
) -> Spare:
    """Return the spare motion of redundant joints.

    Args:
        posture: Posture control of the joints.
        robot: The robot.
        motion: Derivatives 0..r-1 of the joint coordinates, each (N,).
        reference: Derivatives 0..r of the posture reference by rows, shape ((r + 1) N,).
    """
    n, restraint = robot.dimension, None
    terms = posture_expressions(posture, robot, motion, ca.vertsplit(reference, n))
    if posture.speeds is not None:
        velocity = motion[1] if len(motion) > 1 else None
        to_ends = posture.to_ends(motion[0])
        restraint = Restraint(terms.rest, velocity, posture.settling, posture.speeds, to_ends)
    scale = posture.scale
    scale = scale_of(terms.weight) if terms.weight.numel() else scale
    if not terms.slope.numel():
        return Spare(terms.desired, scale, restraint=restraint)
    return Spare(terms.desired, scale, terms.slope, terms.rate, restraint)


def rest_motion(stabilization: Stabilization, motion: Sequence[ca.SX]) -> Spare:
    """Return the desired motion by which joints come to rest at any position.

    It has the gains of the first coordinate except the position gain; error dynamics with real
    poles stay stable without it.

    Args:
        stabilization: Gains of the virtual output.
        motion: Derivatives 0..r-1 of the joint coordinates, each (N,).
    """
    desired = ca.SX(motion[0].numel(), 1)
    for gains, derivative in zip(stabilization.proportional[1:], motion[1:], strict=True):
        desired -= gains[0] * derivative
    return Spare(desired)


def limit_spare_motion(
    drives: DriveRelation, limits: np.ndarray, solution: DecouplingSolution
) -> ca.SX:
    """Return the highest joint derivative, with spare motion within the limits of the drives.

    Between the solution for joints that come to rest and the requested one, the largest share
    within the limits of the drives is used.

    Args:
        drives: Relation of the drives.
        limits: Limits of their inputs, shape (N,).
        solution: Requested solution.
    """
    x, rest = solution.x, solution.rest
    if rest is None:
        return x
    unlimited, least = drives.input(x), drives.input(rest)
    step, beyond = unlimited - least, ca.fabs(unlimited) > limits
    reserve = ca.DM(limits) - ca.sign(step) * least
    limited = ca.logic_and(beyond, step != 0.0)
    share = where(limited, reserve / where(limited, ca.fabs(step), 1.0), 1.0)
    # if the outputs alone need too much, a posture does not add to it
    share = ca.fmin(ca.fmax(ca.mmin(share), 0.0), 1.0)
    return where(any_of(beyond), rest + share * (x - rest), x)


def find_fault(
    u: LawInputs,
    linearization: Linearization,
    aim: Aim,
    usable: ca.SX,
    *,
    max_alpha: float,
    max_beyond_end: float,
) -> ca.SX:
    """Return the :class:`Fault` of a result, the root cause first.

    Args:
        u: Inputs of the law.
        linearization: The relation between drives and virtual output.
        aim: Desired motion of the virtual output.
        usable: Whether the decoupling matrix could be inverted, and all results are finite.
        max_alpha: End of the feasible neighbourhood (3.9) for the controller.
        max_beyond_end: Largest distance of the tool beyond an end of an open path [m].
    """
    layout = linearization.manifold.layout
    alpha, status = u.manifold_point[layout.alpha], u.manifold_point[layout.status]
    not_converged = status == float(ProjectionStatus.NOT_CONVERGED)
    # written so that NaN is a fault
    inside, beyond = alpha < max_alpha, _beyond_ends(linearization, aim, max_beyond_end)
    aligned = aim.angle < _LARGEST_ANGLE
    finite = all_finite(u.state, u.reference, u.integral, u.tau_ext, u.friction, u.posture)
    return first_of(
        (
            all_of(usable, inside, ca.logic_not(not_converged), aligned, ca.logic_not(beyond)),
            Fault.NONE,
        ),
        (ca.logic_not(finite), Fault.INPUT_NOT_FINITE),
        (not_converged, Fault.PROJECTION_FAILED),
        (aim.angle >= _LARGEST_ANGLE, Fault.ORIENTATION_ERROR),
        (beyond, Fault.BEYOND_END),
        (inside, Fault.SINGULAR),
        otherwise=Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD,
    )


def _beyond_ends(linearization: Linearization, aim: Aim, allowed: float) -> ca.SX:
    """Return whether a coordinate is beyond an end by more than the allowed distance [m]."""
    ends = [coordinate.ends for coordinate in linearization.manifold.coordinates]
    outside = [
        ca.logic_or(aim.Y[k, 0] < first - allowed, aim.Y[k, 0] > last + allowed)
        for k, (first, last) in enumerate(ends)
        if math.isfinite(last - first)
    ]
    return any_of(*outside) if outside else ca.SX(0.0)


def _whole_turns(angle: ca.SX) -> ca.SX:
    """Return the multiple of 2 pi nearest to each angle [rad]."""
    return 2.0 * math.pi * ca.floor(angle / (2.0 * math.pi) + 0.5)
