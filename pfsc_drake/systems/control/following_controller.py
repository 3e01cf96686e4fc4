"""The law that makes a robot follow a manifold, as a Drake system."""

import itertools
import math

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

from pfsc_drake.control.compliance.tool_load import SensorFault
from pfsc_drake.control.law.chatter import Chatter
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.safe_stop import SafeStop
from pfsc_drake.control.law.supervision import Supervision, SupervisionParameters
from pfsc_drake.systems.can_fail import is_tick
from pfsc_drake.systems.optional_input import value_or_none

# attributes of an enumeration are looked up slowly, and numpy's numbers compared slowly with them
_LOST, _SATURATED = float(SensorFault.LOST), float(SensorFault.SATURATED)
_NOT_FINITE = float(Fault.INPUT_NOT_FINITE)
# ticks at a limit that one tick within the limits makes up for
_FORGIVEN = 0.5


class FollowingController(LeafSystem):
    """Exact linearization and stabilization along a manifold, see :class:`FollowingLaw`.

    With the virtual output ``yhat`` and relative degree r the closed loop is
    ``e^(r) + a_r e^(r-1) + ... + a_1 e + a_0 int e = 0``, ``e = yhat - yhat_p``.

    The integral is held while a drive is at its limit. After a fault (:class:`Fault`)
    the drives stop the robot and hold it where it has come to rest (:class:`SafeStop`), velocity
    servos get the reference zero; only a new initialization leaves that state.

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
        posture_reference (input): Derivatives 0..r of the posture reference by rows, shape
            ((r + 1) N,); only of a law for more joints than outputs.
        alarms (input, optional): What the robot is to stop for, shape (4,): a
            :class:`~pfsc_drake.control.compliance.tool_load.SensorFault`, whether the sensor is
            tared, before which its range does not matter, an
            :class:`~pfsc_drake.control.compliance.impedance.ImpedanceStatus`, and whether the
            force with which it presses is lost.
        drive_torque (output): Drive torques within their limits [Nm or N], shape (N,).
            For velocity servos (r = 1) it is called velocity_reference instead [rad/s or
            m/s]; the attribute ``drive_port`` holds the name.
        manifold_state (output): Derivatives 0..r-1 of ``yhat`` by rows, shape (r m,).
        virtual_input (output): ``v``, shape (m,).
        status (output): ``[fault, rcond, saturated drives]``, shape (3,).
        fault (output): A :class:`Fault`, shape (1,).
        reference_velocity (output): Joint velocities that the reference asked for at the last
            tick, shape (N,) [rad/s or m/s], zero before; only of a law that tells them. It
            depends on the state alone: what is told the law may depend on it.
        law (output): All of these, laid out by the law's ``layout``.
        evaluation (output): The same, and with supervision what :meth:`Supervision.evaluate`
            returns; computed once per tick, all others are parts of it.

    State:
        Discrete: integral of the error, shape (m,); latched fault, shape (1,); whether
        the next is known, shape (1,); part of the drive input that is extrapolated over
        the hold, shape (N,); ``joint_state`` of the last tick, shape (4N,); virtual output of
        the last tick, shape (m,); memory of the safe stop, and of the supervision; for how many
        ticks each drive has been at its limit, less half of those since at which it was not, shape
        (N,); the reference velocity, if the law tells it; memory of :class:`Chatter`, shape (2N,).

    Args:
        law: The law.
        period: Sampling time [s].
        supervision: What is watched of joints and drives; nothing if omitted.
    """

    def __init__(
        self,
        law: FollowingLaw,
        period: float,
        supervision: SupervisionParameters | None = None,
    ) -> None:
        super().__init__()
        self._law, self.period, self.layout = law, period, law.layout
        linearization = law.linearization
        n, m = linearization.num_joints, linearization.num_outputs
        r = self.relative_degree = linearization.relative_degree
        self._integral, self._fault, self._known = slice(0, m), m, m + 1
        start = self.layout.manifold_state.start
        self._first_output = slice(start, start + m)
        self._safe_stop = SafeStop(law.robot, law.limits, law.safe_state, period)
        self._supervision = None
        if supervision is not None:
            effort = law.limits if r > 1 else law.robot.gather("effort_limit")
            self._supervision = Supervision(law.robot, effort, supervision, period)
        watched = self._supervision.size if self._supervision else 0
        turns = supervision.chatter_turns if supervision is not None else 0
        self._chatter = Chatter(n, turns or math.inf, period)
        told = self.layout.reference_velocity
        told_size, chatter = told.stop - told.start, self._chatter.size
        sizes = [n, 4 * n, m, self._safe_stop.size, watched, n, told_size, chatter]
        widths = np.cumsum([m + 2, *sizes]).tolist()
        parts = [slice(*ends) for ends in itertools.pairwise(widths)]
        self._held, self._last, self._output_before, self._stop, *parts = parts
        self._watch, self._saturated, self._velocity, self._turns = parts
        memory = self.DeclareDiscreteState(widths[-1])
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
        self._alarms: InputPort = self.DeclareVectorInputPort("alarms", 4)
        sources.add(self._alarms.ticket())
        self._posture: InputPort | None = None
        if law.posture is not None:
            self._posture = self.DeclareVectorInputPort("posture_reference", (r + 1) * n)
            sources.add(self._posture.ticket())
        if r > 1:
            self._tau_ext = self.DeclareVectorInputPort("tau_ext", (r - 1) * n)
            self._friction = self.DeclareVectorInputPort("friction_torque", n)
            sources |= {self._tau_ext.ticket(), self._friction.ticket()}
        size = self.layout.size
        self._seen = slice(size, size + 1 + 12 * n if self._supervision else size)
        # written at every evaluation
        self._values = np.zeros(self._seen.stop)
        self._of_law, self._of_supervision = self._values[:size], self._values[self._seen]
        self._output: OutputPort = self.DeclareVectorOutputPort(
            "evaluation", self._seen.stop, self._calc_evaluation, prerequisites_of_calc=sources
        )
        self._declare_part("law", slice(0, size), sources)
        self.drive_port = "drive_torque" if r > 1 else "velocity_reference"
        self._declare_part(self.drive_port, self.layout.drive, sources)
        for name in ("manifold_state", "virtual_input", "status"):
            self._declare_part(name, getattr(self.layout, name), sources)
        self._status = self.layout.status.start
        self._declare_part("fault", slice(self._status, self._status + 1), sources)
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
        """See :class:`FailingSystem`."""
        if is_tick(context, self.period):
            return Fault(int(self._output.Eval(context)[self._status]))
        return Fault(int(context.get_discrete_state_vector().value()[self._fault]))

    def set_last_state(self, context: Context, joint_state: np.ndarray) -> None:
        """Let a state be that of the last tick, before which nothing has been compared.

        Args:
            context: The controller's own.
            joint_state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        """
        memory = context.get_discrete_state_vector().value().copy()
        memory[self._last], memory[self._watch] = joint_state, 0.0
        context.SetDiscreteState(memory)

    def suspects(self, context: Context) -> np.ndarray:
        """Return which measured values are not believed, nonzero if so, shape (4N,)."""
        memory = context.get_discrete_state_vector().value()
        latched = self._safe_stop.suspects(memory[self._stop])
        if not is_tick(context, self.period):
            return latched
        return np.maximum(latched, self._suspects(self._output.Eval(context)))

    def _calc_evaluation(self, context: Context, output: BasicVector) -> None:
        memory = context.get_discrete_state_vector().value()
        state, result = self._joint_state.Eval(context), self._of_law
        latched, known = memory.item(self._fault), memory.item(self._known)
        result[:] = self._law.evaluate(
            state,
            self._manifold_point.Eval(context),
            self._reference.Eval(context),
            memory[self._integral],
            memory[self._held] if known else None,
            value_or_none(self._tau_ext, context),
            value_or_none(self._friction, context),
            memory[self._output_before],
            None if self._posture is None else self._posture.Eval(context),
        )
        if self._supervision is not None:
            self._of_supervision[:] = self._supervision.evaluate(
                state,
                memory[self._last],
                memory[self._watch],
                known,
                self._safe_stop.suspects(memory[self._stop]) if latched else None,
            )
        status = self._status
        fault = latched or self._found_fault(context, memory, result.item(status))
        if fault:
            result[status] = fault
            stop = memory[self._stop]
            if not latched:
                stop = self._start_stop(memory, state, self._suspects(self._values))
            result[self.layout.drive] = 0.0
            if self.relative_degree > 1:
                result[self.layout.drive] = self._safe_stop.drive(stop, state)
        output.SetFromVector(self._values)

    def _found_fault(self, context: Context, memory: np.ndarray, of_law: float) -> float:
        """Return a fault of this instant, the root cause first."""
        if of_law == _NOT_FINITE:
            return of_law
        if self._supervision is not None:
            seen = self._of_supervision.item(0)
            if seen:
                return seen
            ticks = self._supervision.saturated_ticks
            if ticks < math.inf and memory[self._saturated].max() >= ticks:
                return float(Fault.DRIVE_SATURATED)
            if self._chatter.chattering(memory[self._turns]).any():
                return float(Fault.DRIVE_CHATTERS)
        if self._alarms.HasValue(context):
            sensor, tared, compliance, press = self._alarms.Eval(context).tolist()
            if sensor == _LOST:
                return float(Fault.FORCE_SENSOR_LOST)
            if sensor == _SATURATED and tared:
                return float(Fault.FORCE_SENSOR_SATURATED)
            if compliance:
                return float(Fault.COMPLIANCE_INVALID)
            if press:
                return float(Fault.PRESS_FORCE_LOST)
        return of_law

    @staticmethod
    def _counted(before: np.ndarray, at_limit: np.ndarray) -> np.ndarray:
        """Count ticks at a limit, and down by half a tick at others.

        So drives that go from limit to limit and back are found as well.
        """
        return np.where(at_limit, before + 1.0, np.maximum(before - _FORGIVEN, 0.0))

    def _suspects(self, evaluation: np.ndarray) -> np.ndarray:
        """Return which measured values are implausible, nonzero if so, shape (4N,)."""
        if self._supervision is None:
            return np.zeros(self._last.stop - self._last.start)
        return self._supervision.suspects(evaluation[self._seen])

    def _start_stop(
        self, memory: np.ndarray, state: np.ndarray, suspects: np.ndarray
    ) -> np.ndarray:
        return self._safe_stop.start(memory[self._last], state, suspects)

    def _calc_reference_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state_vector().value()[self._velocity])

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        memory = state.get_mutable_value()
        memory[:] = 0.0
        joint_state = self._joint_state.Eval(context)
        memory[self._last] = np.where(np.isfinite(joint_state), joint_state, 0.0)
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        result, joint_state = self._output.Eval(context), self._joint_state.Eval(context)
        before, memory = context.get_discrete_state_vector().value(), state.get_mutable_value()
        if self._supervision is not None:
            memory[self._watch] = self._supervision.next_memory(result[self._seen])
        fault = result.item(self._status)
        memory[self._last] = joint_state
        if fault:
            suspects, stop = self._suspects(result), before[self._stop]
            if not before[self._fault]:
                stop = self._start_stop(before, joint_state, suspects)
            memory[self._fault] = fault
            memory[self._stop] = self._safe_stop.advance(stop, joint_state, suspects)
            return
        memory[self._known] = 1.0
        memory[self._held] = result[self.layout.held]
        memory[self._output_before] = result[self._first_output]
        memory[self._velocity] = result[self.layout.reference_velocity]
        saturated = result[self.layout.status.stop - 1]
        if saturated or before[self._saturated].any():
            at_limit = np.abs(result[self.layout.drive]) >= self._law.limits
            memory[self._saturated] = self._counted(before[self._saturated], at_limit)
        if saturated or before[self._turns].any():
            memory[self._turns] = self._chatter.advance(
                before[self._turns], result[self.layout.drive], self._law.limits
            )
        if self._law.stabilization.has_integral_part and not saturated:
            error = self._law.error(result, self._reference.Eval(context))
            memory[self._integral] += self.period * error
