"""Compliance as a system: from forces and an external reference to the loop's reference."""

from typing import Literal

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    InputPort,
    LeafSystem,
)

from pfsc_drake.control.compliance.impedance import (
    DAMPING,
    MASS,
    STIFFNESS,
    ImpedanceLaw,
    ImpedanceStatus,
)
from pfsc_drake.control.compliance.led_motion import LedMotion
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError

_NOT_STARTED, _RUNNING, _PRESET, _WAITING = 0.0, 1.0, 2.0, 3.0
# a constant impedance does not ask where
_NOWHERE = np.empty(0)


class ImpedanceFilter(LeafSystem):
    """Impedance ``m e'' + d e' + k e = tau``, ``e = y_p - y_d``, see :class:`ImpedanceLaw`.

    It stands between the external reference y_d and the position loop, which follows
    y_p (3.40)-(3.44). Neither y_p nor y_p' steps when the filter is engaged, when
    parameters change, or when the external reference does.

    The output follows from the state and ``desired_reference``; force and
    ``manifold_state`` enter the update only. So there is no algebraic loop through the
    controller or through a contact, and no delay in the position loop: y_d passes at
    once, and a force moves y_p after one period, as it does in the held impedance.

    Ports:
        desired_reference (input): Derivatives 0..p of y_d by rows, shape ((p + 1) m,),
            p being the law's ``desired_order``: max(r, 2) unless chosen otherwise.
        manifold_force (input): tau, shape (m,) [N, Nm]; from :class:`ManifoldForceTransform`.
        manifold_state (input): Derivatives 0..r-1 of yhat by rows, shape (r m,); for
            parameters that depend on eta or xi, and for ``start="actual"``.
        engaged (input, optional): Above 0.5, the default, forces count; else they are
            taken as zero, and y_p goes back to y_d as the springs pull it. Shape (1,).
        ready (input, optional): Until it first rises above 0.5, what yields rests where it
            started, whatever y_d and forces do: so that no coordinate is led by a sensor that is
            not tared. Then it goes on to y_d as its impedance does. Shape (1,).
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,); only with
            ``limits``.
        manifold_point (input): Where on the manifold the tool is; only with ``limits``.
        impedance (input, optional): Rows mass, damping, stiffness of every coordinate,
            shape (3 m,), in place of the law's own.
        reference (output): Derivatives 0..r of y_p by rows, shape ((r + 1) m,).
        status (output): :class:`ImpedanceStatus` of the last update, shape (1,).
        limit_force (output): By what forces the robot's own limits hold the hand, shape (kinds,)
            [N]; only with ``limits``.
        damping (output): d of the last interval, shape (m,) [N s/m, Nm s/rad].

    State:
        Discrete: y_p, y_p', and force, mass, damping, stiffness of the last interval, each
        (m,); whether started or waiting, engaged, status, each (1,); forces of the limits,
        shape (kinds,). Until it has started, y_p = y_d.

    Args:
        law: The law.
        start: Where y_p starts at initialization, and goes on from when ``engaged``
            rises: ``reference`` from y_d, then from y_p itself; ``actual`` from the
            measured yhat (and yhat' if r > 1, else y_d'), so that the loop, not active
            before, has no error. At initialization yhat may not be known yet; then
            it happens at the first tick, unless :meth:`set_motion` was called.
        limits: What the robot can do along the tangential coordinates, which then move no faster;
            nothing limits them if omitted.

    Raises:
        InputError: If ``start`` is neither.
    """

    def __init__(
        self,
        law: ImpedanceLaw,
        *,
        start: Literal["reference", "actual"] = "reference",
        limits: LedMotion | None = None,
    ) -> None:
        if start not in ("reference", "actual"):
            raise InputError(f"start of an impedance filter: {start!r}; reference or actual")
        super().__init__()
        self._law, self._at_actual, self.period = law, start == "actual", law.period
        m, r = law.num_outputs, law.relative_degree
        self._shape = (-1, m)
        self._filter, self._started, self._engaged_before = slice(0, 6 * m), 6 * m, 6 * m + 1
        self._status = 6 * m + 2
        self._limits, kinds = limits, len(limits.kinds) if limits else 0
        self._held = slice(6 * m + 3, 6 * m + 3 + kinds)
        initial = np.concatenate([law.start(np.zeros((2, m))).ravel(), np.zeros(3 + kinds)])
        memory = self.discrete_state_ticket(self.DeclareDiscreteState(initial))
        self._desired: InputPort = self.DeclareVectorInputPort(
            "desired_reference", (law.desired_order + 1) * m
        )
        self._force: InputPort = self.DeclareVectorInputPort("manifold_force", m)
        self._measured: InputPort = self.DeclareVectorInputPort("manifold_state", r * m)
        self._engaged: InputPort = self.DeclareVectorInputPort("engaged", 1)
        self._ready: InputPort = self.DeclareVectorInputPort("ready", 1)
        self._impedance: InputPort = self.DeclareVectorInputPort("impedance", 3 * m)
        self._joint_state: InputPort | None = None
        self._manifold_point: InputPort | None = None
        if limits is not None:
            self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * limits.num_joints)
            self._manifold_point = self.DeclareVectorInputPort("manifold_point", limits.point_size)
            self.DeclareVectorOutputPort(
                "limit_force", kinds, self._calc_limit_force, prerequisites_of_calc={memory}
            )
        self.DeclareVectorOutputPort(
            "reference",
            (r + 1) * m,
            self._calc_reference,
            prerequisites_of_calc={memory, self._desired.ticket()},
        )
        self.DeclareVectorOutputPort(
            "damping", m, self._calc_damping, prerequisites_of_calc={memory}
        )
        self.DeclareVectorOutputPort("status", 1, self._calc_status, prerequisites_of_calc={memory})
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(law.period, 0.0, self._update)

    def fault(self, context: Context) -> Fault:
        """Return the fault that holds since the last update."""
        status = context.get_discrete_state_vector().value()[self._status]
        return Fault.COMPLIANCE_INVALID if status != ImpedanceStatus.OK else Fault.NONE

    def set_motion(self, context: Context, position: np.ndarray, velocity: np.ndarray) -> None:
        """Choose where y_p starts, before initialization.

        Args:
            context: The filter's own.
            position: y_p, shape (m,) [m, rad].
            velocity: y_p', shape (m,) [m/s, rad/s].
        """
        memory = context.get_discrete_state_vector().value().copy()
        memory[self._filter] = self._law.start(np.array([position, velocity])).ravel()
        memory[self._started] = _PRESET
        context.SetDiscreteState(memory)

    def _calc_reference(self, context: Context, output: BasicVector) -> None:
        memory = context.get_discrete_state_vector().value()
        desired = self._desired.Eval(context).reshape(self._shape)
        if memory[self._started] == _NOT_STARTED:
            output.SetFromVector(desired.ravel()[: output.size()])
            return
        if memory[self._started] == _WAITING:
            output.SetFromVector(self._resting(memory, desired)[: output.size()])
            return
        reference = self._law.reference(memory[self._filter].reshape(self._shape), desired)
        output.SetFromVector(reference.ravel())

    def _resting(self, memory: np.ndarray, desired: np.ndarray) -> np.ndarray:
        """Return y_d, in coordinates that yield y_p at rest; flat."""
        state = memory[self._filter].reshape(self._shape)
        yields, reference = np.isfinite(state[3 + STIFFNESS]), desired.copy()
        reference[:, yields] = 0.0
        reference[0, yields] = state[0, yields]
        return reference.ravel()

    def _calc_status(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([context.get_discrete_state_vector().value()[self._status]])

    def _calc_limit_force(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state_vector().value()[self._held])

    def _calc_damping(self, context: Context, output: BasicVector) -> None:
        memory = context.get_discrete_state_vector().value()[self._filter]
        output.SetFromVector(memory.reshape(self._shape)[3 + DAMPING])

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        memory = state.get_mutable_value()
        memory[self._status], memory[self._engaged_before] = ImpedanceStatus.OK, 1.0
        if memory[self._started] == _PRESET:
            memory[self._started] = self._after_start(context)
            return EventStatus.Succeeded()
        memory[self._started] = _NOT_STARTED
        self._start(context, memory)
        return EventStatus.Succeeded()

    def _start(self, context: Context, memory: np.ndarray) -> None:
        """Start the motion where it shall start, or leave that to the next tick."""
        motion = self._desired.Eval(context).reshape(self._shape)[:2].copy()
        if self._at_actual:
            measured = self._measured.Eval(context).reshape(self._shape)[:2]
            motion[: len(measured)] = measured
        if np.isfinite(motion).all():
            memory[self._filter] = self._law.start(motion).ravel()
            memory[self._started] = self._after_start(context)

    def _after_start(self, context: Context) -> float:
        return _WAITING if self._ready.HasValue(context) else _RUNNING

    def _wait(self, context: Context, memory: np.ndarray) -> None:
        """Go on if all is ready, from rest."""
        m = self._law.num_outputs
        memory[m : 2 * m] = 0.0
        if self._ready.Eval(context)[0] > 0.5:
            memory[self._started] = _RUNNING

    def _update(self, context: Context, state: DiscreteValues) -> None:
        memory = state.get_mutable_value()
        engaged = not self._engaged.HasValue(context) or self._engaged.Eval(context)[0] > 0.5
        if engaged and self._at_actual and not memory[self._engaged_before]:
            memory[self._started] = _NOT_STARTED
        memory[self._engaged_before] = engaged
        if memory[self._started] == _NOT_STARTED:
            self._start(context, memory)
        if memory[self._started] == _NOT_STARTED:
            memory[self._status] = ImpedanceStatus.REFERENCE_NOT_FINITE
            return
        if memory[self._started] == _WAITING:
            self._wait(context, memory)
        if memory[self._started] == _WAITING:
            return
        desired = self._desired.Eval(context).reshape(self._shape)
        force = self._force.Eval(context) if engaged else np.zeros(self._law.num_outputs)
        before, parameters = memory[self._filter].reshape(self._shape), self._parameters(context)
        filter_state, status = self._law.update(before, desired, force, parameters)
        if self._limits is not None and status == ImpedanceStatus.OK:
            push, memory[self._held] = self._hold(context, self._limits, filter_state, force)
            if push is not force:
                filter_state, status = self._law.update(before, desired, push, parameters)
        memory[self._filter], memory[self._status] = filter_state.ravel(), status

    def _hold(
        self, context: Context, limits: LedMotion, state: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the force by which the robot can follow, and what of it is whose limit's.

        Args:
            context: Of this system.
            limits: What the robot can do.
            state: Of the filter, if nothing holds it.
            force: Of the hand.
        """
        assert self._joint_state is not None
        assert self._manifold_point is not None
        measured, n = self._joint_state.Eval(context), limits.num_joints
        along = limits.tangential
        speed, held = limits.allowed(
            measured[:n], measured[n : 2 * n], self._manifold_point.Eval(context), state[1, along]
        )
        if not held.any():
            return force, held
        return self._law.push_to(state, speed, force, along), held * state[3 + MASS, along].max()

    def _parameters(self, context: Context) -> np.ndarray:
        if self._impedance.HasValue(context):
            return self._impedance.Eval(context).reshape(self._shape)
        if self._law.is_constant:
            return self._law.impedance(_NOWHERE)
        return self._law.impedance(self._measured.Eval(context)[: self._law.num_outputs])
