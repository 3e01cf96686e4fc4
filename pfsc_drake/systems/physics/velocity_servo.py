"""Joint velocity control as a Drake system."""

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError
from pfsc_drake.physics.velocity_servo import VelocityServoLaw
from pfsc_drake.robot.robot_model import RobotModel, gravity_function


class VelocityServo(LeafSystem):
    """Lets the joints follow reference velocities, ``q' = q'_ref`` (3.48).

    See :class:`VelocityServoLaw` for the law and
    :func:`~pfsc_drake.physics.velocity_servo.servo_gains` for its gains. The controlled
    velocity is that of the motors, the gravity torque that of the links.

    The output is a function of the inputs and the integral part; sample it with a hold of
    the same period in front of the plant. A path controller with a longer period needs a
    hold of its own in front of ``velocity_reference``, whose new value the servo takes up
    one servo period after the tick.

    An input that is not finite is a fault (``Fault.INPUT_NOT_FINITE``): from that instant on
    the servo holds the links against gravity where it saw them last and brakes with what it
    knows of the velocities (:meth:`VelocityServoLaw.safe_torque`), whatever the reference.
    Only a new initialization leaves that state.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        velocity_reference (input): ``q'_ref`` [rad/s or m/s], shape (N,).
        drive_torque (output): ``tau_d`` within its limits [Nm or N], shape (N,).
        fault (output): a ``Fault``, shape (1,).

    State:
        Discrete: integral part [Nm or N], shape (N,), 0 at the start; latched fault, shape
        (1,); joint coordinates when last seen, shape (N,).

    Args:
        robot: The robot, N joints; its gravity torque and the viscous damping of its drives
            are fed forward.
        law: The law; its gains' period is the sampling time.

    Raises:
        InputError: If the law is for another number of joints.
    """

    def __init__(self, robot: RobotModel, law: VelocityServoLaw) -> None:
        super().__init__()
        n = robot.dimension
        if law.gains.dimension != n:
            raise InputError(
                f"servo: gains for {law.gains.dimension} joints; the robot has {n} joints"
            )
        self._law, self._size = law, n
        memory = self.DeclareDiscreteState(2 * n + 1)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._reference = self.DeclareVectorInputPort("velocity_reference", n)
        sources = {
            self._joint_state.ticket(),
            self._reference.ticket(),
            self.discrete_state_ticket(memory),
        }
        # torque and next memory, computed once per tick
        self._step = self.DeclareVectorOutputPort(
            "step", 3 * n + 1, self._calc_step, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "drive_torque", n, self._calc_drive_torque, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, prerequisites_of_calc=sources)
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(law.gains.period, 0.0, self._update)
        self._viscous = robot.viscous_damping
        function = BoundFunction(gravity_function(robot))
        self._q, self._gravity = function.arguments["q"], function.results["tau"]
        self._evaluate = function.evaluate

    @property
    def limits(self) -> np.ndarray:
        """Largest magnitudes of the drive torques [Nm or N], shape (N,)."""
        return self._law.limits

    def fault(self, context: Context) -> Fault:
        """Return the fault that holds at the present instant."""
        return Fault(int(self._step.Eval(context)[2 * self._size]))

    def _calc_step(self, context: Context, output: BasicVector) -> None:
        n = self._size
        state, reference = self._joint_state.Eval(context), self._reference.Eval(context)
        memory = context.get_discrete_state_vector().value()
        x, fault, seen = memory[:n], memory[n], memory[n + 1 :]
        # a sum is finite only if all its terms are
        if not math.isfinite(state.sum() + reference.sum()):
            fault = fault or Fault.INPUT_NOT_FINITE
        q_J, v_M = state[:n], state[3 * n :]
        self._q[:] = np.where(np.isfinite(q_J), q_J, seen) if fault else q_J
        self._evaluate()
        if fault:
            torque = self._law.safe_torque(v_M, self._gravity)
        else:
            load = self._gravity + self._viscous * reference
            torque, x = self._law.torque(v_M, reference, load, x)
        output.SetFromVector(np.concatenate([torque, x, [fault], self._q]))

    def _calc_drive_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._step.Eval(context)[: self._size])

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._step.Eval(context)[2 * self._size : 2 * self._size + 1])

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        q_J = self._joint_state.Eval(context)[: self._size]
        seen = np.where(np.isfinite(q_J), q_J, 0.0)
        state.set_value(np.concatenate([np.zeros(self._size + 1), seen]))
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._step.Eval(context)[self._size :])
