"""Joint velocity control as a Drake system."""

import itertools
import math
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.program import Program
from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.safe_stop import SafeState, SafeStop
from pfsc_drake.control.law.supervision import Supervision, SupervisionParameters
from pfsc_drake.errors import InputError
from pfsc_drake.physics.velocity_servo import VelocityServoLaw
from pfsc_drake.robot.robot_model import RobotModel, gravity_function
from pfsc_drake.systems.can_fail import is_tick


class VelocityServo(LeafSystem):
    """Lets the joints follow reference velocities, ``q' = q'_ref`` (3.48).

    See :class:`VelocityServoLaw` for the law and
    :func:`~pfsc_drake.physics.velocity_servo.servo_gains` for its gains. The controlled
    velocity is that of the motors, the gravity torque that of the links.

    The output is a function of the inputs and the integral part; sample it with a hold of
    the same period in front of the plant. A path controller with a longer period needs a
    hold of its own in front of ``velocity_reference``, whose new value the servo takes up
    one servo period after the tick.

    An input that is not finite, a measurement that contradicts itself, if that is supervised, and
    a bus that is silent for too long are faults: from that instant on the servo stops the
    joints and holds them where they have come to rest (:class:`SafeStop`), whatever the
    reference. Only a new initialization leaves that state.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        velocity_reference (input): ``q'_ref`` [rad/s or m/s], shape (N,).
        silence (input, optional): For how long no new reference has come [s], shape (1,).
        drive_torque (output): ``tau_d`` within its limits [Nm or N], shape (N,).
        fault (output): a ``Fault``, shape (1,).

    State:
        Discrete: integral part [Nm or N], shape (N,), 0 at the start; latched fault, shape
        (1,); memory of the safe stop, and of the supervision.

    Args:
        robot: The robot as it is believed, N joints; its gravity torque and the viscous damping
            of its drives are fed forward.
        law: The law; its gains' period is the sampling time.
        safe_state: How to stop and hold; by default without more damping than that needs.
        supervision: What of the measurement is watched; nothing if omitted.
        longest_silence: How long a reference may be missing [s]; for ever if infinite.

    Raises:
        InputError: If the law is for another number of joints.
    """

    def __init__(
        self,
        robot: RobotModel,
        law: VelocityServoLaw,
        safe_state: SafeState | None = None,
        supervision: SupervisionParameters | None = None,
        longest_silence: float = math.inf,
    ) -> None:
        super().__init__()
        n = robot.dimension
        if law.gains.dimension != n:
            raise InputError(
                f"servo: gains for {law.gains.dimension} joints; the robot has {n} joints"
            )
        self._law, self._size = law, n
        period, self._longest_silence = law.gains.period, longest_silence
        settings = safe_state or SafeState(np.zeros(n))
        self._safe_stop = _Part(SafeStop(robot, law.limits, settings, period))
        self._supervision = None
        if supervision is not None:
            self._supervision = _Part(Supervision(robot, law.limits, supervision, period))
        watched = self._supervision.size if self._supervision else 0
        widths = np.cumsum([n, 1, self._safe_stop.size, watched]).tolist()
        self._fault, self._stop, self._watch = (slice(*ends) for ends in itertools.pairwise(widths))
        memory = self.DeclareDiscreteState(widths[-1])
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._reference = self.DeclareVectorInputPort("velocity_reference", n)
        self._silence = self.DeclareVectorInputPort("silence", 1)
        sources = {
            self._joint_state.ticket(),
            self._reference.ticket(),
            self._silence.ticket(),
            self.discrete_state_ticket(memory),
        }
        # torque and next memory, computed once per tick
        self._step = self.DeclareVectorOutputPort(
            "step", n + widths[-1], self._calc_step, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "drive_torque", n, self._calc_drive_torque, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, prerequisites_of_calc=sources)
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self._viscous = robot.viscous_damping
        function = BoundFunction(gravity_function(robot))
        self._q, self._gravity = function.arguments["q"], function.results["tau"]
        self._evaluate = function.evaluate

    @property
    def limits(self) -> np.ndarray:
        """Largest magnitudes of the drive torques [Nm or N], shape (N,)."""
        return self._law.limits

    def fault(self, context: Context) -> Fault:
        """See :class:`FailingSystem`."""
        return Fault(int(self._latched(context)[self._fault][0]))

    def suspects(self, context: Context) -> np.ndarray:
        """Return which measured values are not believed, nonzero if so, shape (4N,)."""
        return self._safe_stop.state(self._latched(context)[self._stop], "ignored")

    def _latched(self, context: Context) -> np.ndarray:
        """Return the memory with what is found at the present instant, if it is a tick."""
        if is_tick(context, self._law.gains.period):
            return self._step.Eval(context)[self._size :]
        return context.get_discrete_state_vector().value()

    def _calc_step(self, context: Context, output: BasicVector) -> None:
        n = self._size
        state, reference = self._joint_state.Eval(context), self._reference.Eval(context)
        before = context.get_discrete_state_vector().value()
        after, fault = before.copy(), before[self._fault][0]
        seen, suspects = 0.0, np.zeros(4 * n)
        if self._supervision is not None:
            ignored = self._safe_stop.state(before[self._stop], "ignored")
            found = self._supervision.step(before[self._watch], joint_state=state, ignored=ignored)
            after[self._watch], suspects = found["x_next"], found["suspects"]
            seen = float(found["fault"][0])
        fault = fault or self._found_fault(context, state, reference, seen)
        stop = self._safe_stop.step(
            before[self._stop], joint_state=state, fault=fault, suspects=suspects
        )
        after[self._stop] = stop["x_next"]
        if fault:
            torque = stop["torque"]
            after[self._fault] = fault
        else:
            self._q[:] = state[:n]
            self._evaluate()
            load = self._gravity + self._viscous * reference
            torque, after[:n] = self._law.torque(state[3 * n :], reference, load, before[:n])
        output.SetFromVector(np.concatenate([torque, after]))

    def _found_fault(
        self,
        context: Context,
        state: np.ndarray,
        reference: np.ndarray,
        seen: float,
    ) -> float:
        """Return a fault of this instant, the root cause first."""
        # a sum is finite only if all its terms are
        if not math.isfinite(state.sum() + reference.sum()):
            return Fault.INPUT_NOT_FINITE
        if seen:
            return seen
        if self._silence.HasValue(context):
            silence = self._silence.Eval(context)[0]
            return Fault.BUS_LOST if silence > self._longest_silence else Fault.NONE
        return Fault.NONE

    def _calc_drive_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._step.Eval(context)[: self._size])

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._step.Eval(context)[self._size :][self._fault])

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        joint_state = self._joint_state.Eval(context)
        memory = state.get_mutable_value()
        memory[:] = 0.0
        last = np.where(np.isfinite(joint_state), joint_state, 0.0)
        self._safe_stop.state(memory[self._stop], "last")[:] = last
        if self._supervision is not None:
            self._supervision.state(memory[self._watch], "last")[:] = last
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._step.Eval(context)[self._size :])


class _Part:
    """A block within the servo, whose state is a part of the servo's."""

    def __init__(self, block: Block) -> None:
        program = Program(Network.of(block))
        self.size = program.size
        self._states, self._bound = program.states, BoundFunction(program.step())

    def state(self, x: np.ndarray, name: str) -> np.ndarray:
        """Return a view of one of the states."""
        return x[self._states[name]]

    def step(self, x: np.ndarray, **inputs: Any) -> dict[str, np.ndarray]:
        """Return outputs and ``x_next``; arrays that are reused."""
        for name, value in ({"x": x} | inputs).items():
            self._bound.arguments[name][:] = value
        self._bound.evaluate()
        return self._bound.results
