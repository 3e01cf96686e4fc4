"""Compliance: forces along a manifold, and the compliant reference of a position loop."""

import math
from typing import Any, Literal

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, any_of, first_of, unit, where
from pfsc_drake.control.compliance.impedance import (
    STIFFNESS,
    ImpedanceLaw,
    ImpedanceState,
    ImpedanceStatus,
)
from pfsc_drake.control.compliance.path_ends import PathEnds
from pfsc_drake.control.fixtures.contact_program import SLOTS, program_function
from pfsc_drake.control.fixtures.robot_limits import RobotLimits, limit_kinds, tightest_function
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import Manifold, indices, manifold_force_function
from pfsc_drake.errors import InputError


class ImpedanceFilter(Block):
    """Impedance ``m e'' + d e' + k e = tau``, ``e = y_p - y_d``, see :class:`ImpedanceLaw`.

    The filter is between the external reference y_d and the position loop, which follows
    y_p (3.40)-(3.44). Neither y_p nor y_p' steps when the filter is engaged, when
    parameters change, or when the external reference does.

    The reference depends on the state and ``desired_reference``; force and ``manifold_state``
    enter the update only. So there is no algebraic loop through the controller or through a
    contact, and no delay in the position loop: y_d passes without delay, and a force moves y_p
    after one period, as it does in the sampled impedance.

    Ports:
        desired_reference (input): Derivatives 0..p of y_d by rows, shape ((p + 1) m,),
            p being the law's ``desired_order``: max(r, 2) unless chosen otherwise.
        manifold_force (input): tau, shape (m,) [N, Nm]; from :class:`ManifoldForceTransform`.
        manifold_state (input): Derivatives 0..r-1 of yhat by rows, shape (r m,); for
            parameters that depend on eta or xi, and for ``start="actual"``.
        engaged (input, optional): Above 0.5, the default, forces are used; otherwise they are
            replaced by zero, and the springs return y_p to y_d. Shape (1,).
        ready (input, optional): Until it first rises above 0.5, compliant coordinates rest at their
            start values, independent of y_d and forces, so that a sensor that is not yet tared
            moves nothing. Then y_p follows its impedance. Shape (1,).
        impedance (input, optional): Rows mass, damping, stiffness of every coordinate,
            shape (3 m,); replaces the law's impedance.
        allowed_speed (input, optional): Speed limit of the coordinates ``free``: the part of
            ``desired_speed`` that the robot can follow [m/s]. From :class:`GuidedMotion`.
        reference (output): Derivatives 0..r of y_p by rows, shape ((r + 1) m,).
        status (output): :class:`ImpedanceStatus` of the last update, shape (1,).
        damping (output): d of the last interval, shape (m,) [N s/m, Nm s/rad].
        desired_speed (output): y_p' of the coordinates ``free`` at the next tick without limits,
            then the largest of their masses [m/s, kg]; NaN while nothing moves. Only if there are
            such coordinates.

    State:
        y_p (``position``), y_p' (``velocity``), and force and impedance of the last interval;
        flags ``started``, ``waits``, ``engaged``; status. Until it has started, y_p = y_d.

    Args:
        law: The law.
        start: Value of y_p at the start and when ``engaged`` rises: ``reference``: y_d, then y_p
            itself; ``actual``: the measured yhat (and yhat' if r > 1, else y_d'), so that the loop,
            not active before, has no error. The filter starts at the first finite value.
        free: Coordinates whose speed may be limited; none if omitted.
        ends: Ends of an open path, between which y_p stays; None if there are none.

    Raises:
        InputError: If ``start`` is unknown.
    """

    def __init__(
        self,
        law: ImpedanceLaw,
        *,
        start: Literal["reference", "actual"] = "reference",
        free: slice | None = None,
        ends: PathEnds | None = None,
    ) -> None:
        if start not in ("reference", "actual"):
            raise InputError(f"start of an impedance filter: {start!r}; reference or actual")
        self._law, self._at_actual, self._free = law, start == "actual", free
        self._ends = ends
        m, r = law.num_outputs, law.relative_degree
        self.inputs = {
            "desired_reference": Port((law.desired_order + 1) * m, "m, rad, per s, .."),
            "manifold_force": Port(m, "N, Nm"),
            "manifold_state": Port(r * m, "m, rad, per s, .."),
            "engaged": Port(1, optional=True),
            "ready": Port(1, optional=True),
            "impedance": Port(3 * m, "kg, N s/m, N/m", optional=True),
        }
        self.outputs = {
            "reference": Port((r + 1) * m, "m, rad, per s, .."),
            "status": Port(1),
            "damping": Port(m, "N s/m, Nm s/rad"),
        }
        if free is not None:
            count = free.stop - free.start
            self.inputs["allowed_speed"] = Port(count, "m/s", optional=True)
            self.outputs["desired_speed"] = Port(count + 1, "m/s, kg")
        flags = ("started", "waits", "engaged", "status")
        self.states = {"position": m, "velocity": m, "force": m, "impedance": 3 * m}
        self.states |= dict.fromkeys(flags, 1)

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        motion = self._start_motion(u)
        known = all_finite(motion)
        state = self._law.start(where(known, motion, 0.0))
        waits = 0.0 if u.ready is None else 1.0
        return state._asdict() | {"started": known, "waits": waits, "engaged": 1.0}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        m, r = self._law.num_outputs, self._law.relative_degree
        state, desired = _state(x), u.desired_reference[: (r + 1) * m]
        # compliant coordinates at rest
        compliant = ca.vertsplit(x.impedance, m)[STIFFNESS] < ca.inf
        rest = ca.vertcat(x.position, ca.DM.zeros(r * m))
        resting = where(ca.repmat(compliant, r + 1, 1), rest, desired)
        reference = first_of(
            (ca.logic_not(x.started), desired),
            (x.waits, resting),
            otherwise=self._law.reference(state, u.desired_reference),
        )
        outputs = {"reference": reference, "status": x.status, "damping": x.impedance[m : 2 * m]}
        if self._free is None:
            return outputs
        now, moves, _ = self._continued_state(x, u)
        later, status = self._next_state(now, u)
        mass = ca.mmax(ca.vertsplit(later.impedance, m)[0][self._free])
        valid = where(ca.logic_and(moves, status == ImpedanceStatus.OK), 1.0, math.nan)
        speed = valid * later.velocity[self._free]
        return outputs | {"desired_speed": ca.vertcat(speed, mass)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        now, moves, flags = self._continued_state(x, u)
        later, status = self._next_state(now, u)
        if self._free is not None and u.allowed_speed is not None:
            known = all_finite(y.desired_speed)
            speed = where(known, u.allowed_speed, later.velocity[self._free])
            push = self._law.push_to(later, speed, later.force, self._free)
            limited, limited_status = self._next_state(now, u, push)
            later = ImpedanceState(
                *[where(known, a, b) for a, b in zip(limited, later, strict=True)]
            )
            status = where(known, limited_status, status)
        motion = {
            name: where(moves, getattr(later, name), getattr(now, name)) for name in later._fields
        }
        awaited = where(flags["started"], ImpedanceStatus.OK, ImpedanceStatus.REFERENCE_NOT_FINITE)
        return motion | flags | {"status": where(moves, status, awaited)}

    def _start_motion(self, u: Values) -> Any:
        """Return ``[y_p, y_p']`` at the start, shape (2 m,)."""
        size = 2 * self._law.num_outputs
        if not self._at_actual:
            return u.desired_reference[:size]
        measured = u.manifold_state[: min(size, self.inputs["manifold_state"].size)]
        return ca.vertcat(measured, u.desired_reference[measured.numel() : size])

    def _continued_state(self, x: Values, u: Values) -> tuple[ImpedanceState, Any, dict[str, Any]]:
        """Return the present state, whether it moves, and the next flags."""
        now, engaged, started = _state(x), self._engaged(u), x.started
        if self._at_actual:
            rises = ca.logic_and(engaged, ca.logic_not(x.engaged))
            started = ca.logic_and(started, ca.logic_not(rises))
        motion = self._start_motion(u)
        begins = all_of(ca.logic_not(started), all_finite(motion))
        anew = self._law.start(where(all_finite(motion), motion, 0.0))
        now = ImpedanceState(*[where(begins, a, b) for a, b in zip(anew, now, strict=True)])
        started, waits = ca.logic_or(started, begins), ca.MX(0.0)
        if u.ready is not None:
            waited = ca.logic_or(x.waits, begins)
            now = now._replace(velocity=where(waited, 0.0, now.velocity))
            waits = ca.logic_and(waited, ca.logic_not(u.ready > 0.5))
        flags = {"started": started, "waits": waits, "engaged": engaged}
        return now, ca.logic_and(started, ca.logic_not(waits)), flags

    def _engaged(self, u: Values) -> Any:
        return ca.DM(1.0) if u.engaged is None else u.engaged > 0.5

    def _next_state(
        self, now: ImpedanceState, u: Values, force: Any = None
    ) -> tuple[ImpedanceState, Any]:
        """Return the state one period later and its status; by default of the measured force."""
        if force is None:
            force = where(self._engaged(u), u.manifold_force, 0.0)
        impedance = u.impedance
        if impedance is None and not self._law.is_constant:
            impedance = self._law.impedance(u.manifold_state[: self._law.num_outputs])
        later, status = self._law.update(now, u.desired_reference, force, impedance)
        if self._ends is not None:
            later = self._ends.hold(now, later, u.desired_reference, impedance)
        return later, status


def _state(x: Values) -> ImpedanceState:
    return ImpedanceState(x.position, x.velocity, x.force, x.impedance)


class ManifoldForceTransform(Block):
    """External wrench to generalized forces along a manifold, see :meth:`Manifold.force`.

    For a path (3.41), (3.44), (3.45): ``tau_par = e_par . f / beta``, ``tau_perp = e_perp . f``,
    ``tau_cross = e_cross . f``, ``tau_phi = T_ZYX'(phi_pd) R_d' mu``. NaN and infinite values pass
    through.

    Ports:
        wrench (input): Force [N] and torque [Nm] on the tool at the tool point, world
            axes, shape (6,).
        manifold_point (input): Projection of the tool onto the manifold, e.g. from
            :class:`Projector`.
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,); from
            :class:`ImpedanceFilter`. Only for manifolds with rotational coordinates.
        manifold_force (output): Forces along the coordinates, shape (m,) [N, Nm]; for a path
            ``(tau_par, tau_perp, tau_cross[, tau_phi])``.

    Args:
        manifold: The manifold.
        with_turning: Whether a torque acts along eta where the manifold's orientation
            turns, see :func:`turning_force`. (3.41) has no such term; with it the
            forces are those of the virtual work.
    """

    def __init__(self, manifold: Manifold, *, with_turning: bool = False) -> None:
        m, layout = len(manifold.coordinates), manifold.layout
        self._m, self._force = m, manifold_force_function(manifold, with_turning=with_turning)
        self.inputs = {"wrench": Port(6, "N, Nm"), "manifold_point": Port(layout.size)}
        if any(coordinate.kind is Kind.ROTATIONAL for coordinate in manifold.coordinates):
            self.inputs["reference"] = Port((layout.order + 1) * m, "m, rad, per s, ..")
        self.outputs, self.states = {"manifold_force": Port(m, "N, Nm")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        angles = u.reference[: self._m] if "reference" in self.inputs else ca.DM.zeros(self._m)
        return {"manifold_force": self._force(u.wrench, u.manifold_point, angles)}


# below it a limit does not depend on the motion along the manifold
_ACROSS = 1e-6


class GuidedMotion(Block):
    """Limits a speed along a path or a surface to the speeds that the robot can follow.

    With the directions t of the tangential coordinates, a limit ``n w >= -beta`` of the tool's
    velocity (:class:`RobotLimits`) becomes a limit of ``eta'``, ``(n t) eta' >= -beta``. Near the
    manifold ``y' = t eta'``; the transversal motion, which the position loop causes, is assumed to
    continue as measured. Under the twelve tightest limits :func:`program_function` finds the motion
    closest to the desired one.

    Ports:
        desired_speed (input): Speeds of the tangential coordinates, then their mass, shape
            (count + 1,) [m/s, kg]; from :class:`ImpedanceFilter`. NaN and infinite values pass
            through.
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        manifold_point (input): Projection of the tool onto the manifold.
        allowed_speed (output): Limited speeds of the tangential coordinates, shape (count,) [m/s].
        limit_force (output): Forces of the robot's limits against the operator in the last
            interval, by kind, shape (kinds,) [N].

    State:
        limit_force: The output.

    Args:
        limits: Limits of the tool's velocity.
        manifold: The path or surface.
        period: Sampling time [s].

    Attributes:
        tangential: Indices of the tangential coordinates.
        kinds: Kinds of limits, see :func:`limit_kinds`, each once.
    """

    expands = False  # the program skips rare cases

    def __init__(self, limits: RobotLimits, manifold: Manifold, period: float) -> None:
        self._limits, self._axes = limits, manifold.axes
        self._program = program_function(period)
        self.tangential = indices(manifold.coordinates, Kind.TANGENTIAL)
        self._count = self.tangential.stop - self.tangential.start
        every = limit_kinds(limits.num_joints)
        self.kinds = list(dict.fromkeys(every))
        # 1 where a limit is of a kind
        self._of_kind = ca.DM([[one == kind for kind in self.kinds] for one in every])
        self.inputs = {
            "desired_speed": Port(self._count + 1, "m/s, kg"),
            "joint_state": Port(4 * limits.num_joints, "rad, rad/s or m, m/s"),
            "manifold_point": Port(manifold.layout.size),
        }
        self.outputs = {
            "allowed_speed": Port(self._count, "m/s"),
            "limit_force": Port(len(self.kinds), "N"),
        }
        self.states = {"limit_force": len(self.kinds)}
        self.inner = {"deceleration": len(self.kinds)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values.

        ``deceleration``: by each kind of limit [m/s^2].
        """
        desired = u.desired_speed[: self._count]
        speed, deceleration = self._limit_speed(u.joint_state, u.manifold_point, desired)
        return {
            "allowed_speed": where(any_of(deceleration), speed, desired),
            "limit_force": x.limit_force,
            "deceleration": deceleration,
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        moves, mass = all_finite(u.desired_speed[: self._count]), u.desired_speed[self._count]
        return {"limit_force": where(moves, mass * y.deceleration, x.limit_force)}

    def _limit_speed(self, joint_state: Any, point: Any, desired: Any) -> tuple[Any, Any]:
        """Return the motion closest to the desired one within the limits, and their effect.

        Args:
            joint_state: Measured joint state, shape (4N,).
            point: The manifold's point.
            desired: ``eta'`` [m/s], shape (1,) or (2,).

        Returns:
            ``eta'``, and the deceleration by each kind of limit [m/s^2], shape (kinds,); zeros if
            an input is NaN or infinite.
        """
        n, unused = self._limits.num_joints, 3 - self._count
        limits = self._limits.function(joint_state[:n], joint_state[n : 2 * n])
        rows = limits[:, 1:4] @ self._axes(point)[:, : self._count]
        size = ca.sqrt(ca.sum2(rows**2))
        number = where(size > _ACROSS, limits[:, 0], -1.0)
        units = ca.horzcat(rows, limits[:, 4]) / ca.repmat(size, 1, self._count + 1)
        units = where(ca.repmat(number >= 0.0, 1, self._count + 1), units, 0.0)
        n_t = ca.horzcat(units[:, :-1], ca.DM.zeros(units.shape[0], unused))
        target = ca.vertcat(desired, ca.DM.zeros(unused))
        pick = tightest_function(units.shape[0], SLOTS)
        picked = pick(ca.horzcat(number, n_t, units[:, -1]), target)
        # no beta is negative: rest is always feasible, and no slot has to be relaxed
        number, no = picked[:, 0], ca.DM.zeros(SLOTS)
        velocity, forces, _ = self._program(
            1.0, target, number >= 0.0, picked[:, 1:4], no, picked[:, 4], no, no
        )
        chosen = ca.horzcat(*[unit(number[i], self._of_kind.shape[0]) for i in range(SLOTS)])
        return velocity[: self._count], self._of_kind.T @ (chosen @ forces)
