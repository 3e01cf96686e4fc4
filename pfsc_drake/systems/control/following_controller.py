"""The law that makes a robot follow a manifold, as a Drake system."""

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DependencyTicket,
    DiscreteValues,
    EventStatus,
    InputPort,
    LeafSystem,
    OutputPort,
)

from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw


class FollowingController(LeafSystem):
    """Exact linearization and stabilization along a manifold, see :class:`FollowingLaw`.

    With the virtual output ``yhat`` and relative degree r the closed loop is
    ``e^(r) + a_r e^(r-1) + ... + a_1 e + a_0 int e = 0``, ``e = yhat - yhat_p``.

    The integral is held while a drive is at its limit. After a fault (:class:`Fault`)
    the drives hold the links against gravity and brake; only a new initialization
    leaves that state.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point (input): Where on the manifold the tool is, e.g. from
            :class:`PathProjector`.
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,).
        tau_ext (input, optional): External joint torques and their derivatives up to order
            r - 2 by rows [Nm or N, per s, ..], shape ((r - 1) N,); zero if not connected.
            Only for r > 1.
        friction_torque (input, optional): ``tau_f`` that the drives are to overcome besides
            [Nm or N], shape (N,); zero if not connected, and in the safe state. Only for r > 1.
        drive_torque (output): Drive torques within their limits [Nm or N], shape (N,).
            For velocity servos (r = 1) it is called velocity_reference instead [rad/s or
            m/s]; the attribute ``drive_port`` holds the name.
        manifold_state (output): Derivatives 0..r-1 of ``yhat`` by rows, shape (r m,).
        virtual_input (output): ``v``, shape (m,).
        status (output): ``[fault, rcond, saturated drives]``, shape (3,).
        reference_velocity (output): Joint velocities that the reference asked for at the last
            tick, shape (N,) [rad/s or m/s], zero before; only of a law that tells them. It
            depends on the state alone: what is told the law may depend on it.
        law (output): All of these, laid out by the law's ``layout``; computed once per
            tick, the others are parts of it.

    State:
        Discrete: integral of the error, shape (m,); latched fault, shape (1,); whether
        the next is known, shape (1,); part of the drive input that is extrapolated over
        the hold, shape (N,); last ``joint_state`` without fault, shape (4N,); the reference
        velocity, if the law tells it.

    Args:
        law: The law.
        period: Sampling time [s].
    """

    def __init__(self, law: FollowingLaw, period: float) -> None:
        super().__init__()
        self._law, self.period, self.layout = law, period, law.layout
        linearization = law.linearization
        n, m = linearization.num_joints, linearization.num_outputs
        r = self.relative_degree = linearization.relative_degree
        self._integral, self._fault, self._known = slice(0, m), m, m + 1
        self._held, self._last_good = slice(m + 2, m + 2 + n), slice(m + 2 + n, m + 2 + 5 * n)
        told = self.layout.reference_velocity
        end = self._last_good.stop + told.stop - told.start
        self._velocity = slice(self._last_good.stop, end)
        memory = self.DeclareDiscreteState(end)
        self._joint_state: InputPort = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._manifold_point: InputPort = self.DeclareVectorInputPort(
            "manifold_point", linearization.manifold.layout.size
        )
        self._reference: InputPort = self.DeclareVectorInputPort("reference", (r + 1) * m)
        self._tau_ext: InputPort | None = None
        self._friction: InputPort | None = None
        sources = {
            self._joint_state.ticket(),
            self._manifold_point.ticket(),
            self._reference.ticket(),
            self.discrete_state_ticket(memory),
        }
        if r > 1:
            self._tau_ext = self.DeclareVectorInputPort("tau_ext", (r - 1) * n)
            self._friction = self.DeclareVectorInputPort("friction_torque", n)
            sources |= {self._tau_ext.ticket(), self._friction.ticket()}
        self._output: OutputPort = self.DeclareVectorOutputPort(
            "law", self.layout.size, self._calc_law, prerequisites_of_calc=sources
        )
        self.drive_port = "drive_torque" if r > 1 else "velocity_reference"
        self._declare_part(self.drive_port, self.layout.drive, sources)
        for name in ("manifold_state", "virtual_input", "status"):
            self._declare_part(name, getattr(self.layout, name), sources)
        if told.stop > told.start:
            self.DeclareVectorOutputPort(
                "reference_velocity",
                n,
                self._calc_reference_velocity,
                prerequisites_of_calc={self.discrete_state_ticket(memory)},
            )
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _declare_part(self, name: str, part: slice, sources: set[DependencyTicket]) -> None:
        def calc(context: Context, output: BasicVector) -> None:
            output.SetFromVector(self._output.Eval(context)[part])

        self.DeclareVectorOutputPort(
            name,
            part.stop - part.start,
            calc,
            prerequisites_of_calc=sources,
        )

    def fault(self, context: Context) -> Fault:
        """Return the fault that holds at the present instant."""
        return Fault(int(self._output.Eval(context)[self.layout.status][0]))

    def _calc_law(self, context: Context, output: BasicVector) -> None:
        memory = context.get_discrete_state_vector().value()
        state = self._joint_state.Eval(context)
        result = self._law.evaluate(
            state,
            self._manifold_point.Eval(context),
            self._reference.Eval(context),
            memory[self._integral],
            memory[self._held] if memory[self._known] else None,
            _value(self._tau_ext, context),
            _value(self._friction, context),
        )
        status = self.layout.status.start
        fault = memory[self._fault] or result[status]
        if fault:
            result[status] = fault
            result[self.layout.drive] = self._law.safe_drive(state, memory[self._last_good])
        output.SetFromVector(result)

    def _calc_reference_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state_vector().value()[self._velocity])

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        memory = state.get_mutable_value()
        memory[:] = 0.0
        joint_state = self._joint_state.Eval(context)
        memory[self._last_good] = np.where(np.isfinite(joint_state), joint_state, 0.0)
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        result = self._output.Eval(context)
        memory = state.get_mutable_value()
        fault = result[self.layout.status.start]
        if fault:
            memory[self._fault] = fault
            return
        memory[self._known] = 1.0
        memory[self._held] = result[self.layout.held]
        memory[self._last_good] = self._joint_state.Eval(context)
        memory[self._velocity] = result[self.layout.reference_velocity]
        saturated = result[self.layout.status.stop - 1]
        if self._law.stabilization.has_integral_part and not saturated:
            error = self._law.error(result, self._reference.Eval(context))
            memory[self._integral] += self.period * error


def _value(port: InputPort | None, context: Context) -> np.ndarray | None:
    """Return the value of an optional port, or None if there is none."""
    if port is None or not port.HasValue(context):
        return None
    return port.Eval(context)
