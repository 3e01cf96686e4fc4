"""The friction Kalman filter as a system."""

from pydrake.systems.framework import BasicVector, Context

from pfsc_drake.control.estimation.friction_kalman import FrictionKalmanFilter
from pfsc_drake.systems.control.estimator_system import EstimatorSystem
from pfsc_drake.systems.optional_input import value_or_none


class FrictionEstimator(EstimatorSystem):
    """Friction of the drives by the Kalman filter of App. A, see :class:`FrictionKalmanFilter`.

    Ports:
        (beside those of :class:`EstimatorSystem`)
        velocity (input, optional): For which the friction torque is wanted [rad/s or m/s],
            shape (N,); the motors' measured one if not connected.
        estimate (output): ``[tau_f, f_c, f_v]``, shape (3N,). It does not depend on
            ``drive_torque``, so that what drives the joints may depend on it.
        friction_torque (output): ``tau_f`` alone, shape (N,).

    Args:
        kalman: The filter.
        period: Its sampling time [s].
    """

    def __init__(self, kalman: FrictionKalmanFilter, period: float) -> None:
        super().__init__(kalman, period)
        self._kalman, n = kalman, kalman.num_joints
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        sources = self._sources | {self._velocity.ticket()}
        self._estimate = self.DeclareVectorOutputPort(
            "estimate", 3 * n, self._calc_estimate, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "friction_torque", n, self._calc_torque, prerequisites_of_calc=sources
        )

    def _calc_estimate(self, context: Context, output: BasicVector) -> None:
        velocity = value_or_none(self._velocity, context)
        memory = context.get_discrete_state_vector().value()
        output.SetFromVector(
            self._kalman.estimate(memory, self._joint_state.Eval(context), velocity)
        )

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._estimate.Eval(context)[: self._kalman.num_joints])
