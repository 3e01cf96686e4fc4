"""Joint velocity control as a Drake system."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from pfsc_drake.control.velocity_servo import VelocityServoLaw
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, gravity_function


class VelocityServo(LeafSystem):
    """Lets the joints follow reference velocities, ``q' = q'_ref`` (3.48).

    See :class:`VelocityServoLaw` for the law and
    :func:`~pfsc_drake.control.velocity_servo.servo_gains` for its gains. The controlled
    velocity is that of the motors, the gravity torque that of the links.

    The output is a function of the inputs and the integral part; sample it with a hold of
    the same period in front of the plant. A path controller with a longer period needs a
    hold of its own in front of ``velocity_reference``, whose new value the servo takes up
    one servo period after the tick.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        velocity_reference (input): ``q'_ref`` [rad/s or m/s], shape (N,).
        drive_torque (output): ``tau_d`` within its limits [Nm or N], shape (N,).

    State:
        Discrete: integral part [Nm or N], shape (N,), 0 at the start.

    Args:
        robot: The robot, N joints; its gravity torque is fed forward.
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
        integral = self.DeclareDiscreteState(n)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._reference = self.DeclareVectorInputPort("velocity_reference", n)
        self.DeclareVectorOutputPort(
            "drive_torque",
            n,
            self._calc_drive_torque,
            prerequisites_of_calc={
                self._joint_state.ticket(),
                self._reference.ticket(),
                self.discrete_state_ticket(integral),
            },
        )
        self.DeclarePeriodicDiscreteUpdateEvent(law.gains.period, 0.0, self._update)
        self._q, self._gravity = np.zeros(n), np.zeros(n)
        self._buffer, self._evaluate = gravity_function(robot).buffer()
        self._buffer.set_arg(0, self._q.data)
        self._buffer.set_res(0, self._gravity.data)

    def _torque(self, context: Context) -> tuple[np.ndarray, np.ndarray]:
        state = self._joint_state.Eval(context)
        self._q[:] = state[: self._size]
        self._evaluate()
        return self._law.torque(
            state[3 * self._size :],
            self._reference.Eval(context),
            self._gravity,
            context.get_discrete_state_vector().value(),
        )

    def _calc_drive_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._torque(context)[0])

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._torque(context)[1])
