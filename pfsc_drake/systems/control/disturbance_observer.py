"""Friction or external torques in the joints, from what the joints did."""

from pydrake.systems.framework import BasicVector, Context

from pfsc_drake.control.estimation.momentum_observer import MomentumObserver
from pfsc_drake.systems.control.estimator_system import EstimatorSystem


class DisturbanceObserver(EstimatorSystem):
    """Observer of torques in the joints that nothing measures, see :class:`MomentumObserver`.

    With the momenta of :func:`~pfsc_drake.control.estimation.generalized_momentum.drive_momentum`
    it finds the friction of the drives, with those of ``link_momentum`` the external torques.

    Ports:
        (beside those of :class:`EstimatorSystem`)
        estimate (output): The torque and its derivatives by rows, shape
            ((num_derivatives + 1) N,) [Nm or N, per s, ..]. It depends on the state and on
            ``joint_state`` alone, so that what drives the joints may depend on it.

    Args:
        observer: The observer.
        period: Its sampling time [s].
    """

    def __init__(self, observer: MomentumObserver, period: float) -> None:
        super().__init__(observer, period)
        self._observer = observer
        self.DeclareVectorOutputPort(
            "estimate",
            observer.num_values,
            self._calc_estimate,
            prerequisites_of_calc=self._sources,
        )

    def _calc_estimate(self, context: Context, output: BasicVector) -> None:
        memory = context.get_discrete_state_vector().value()
        output.SetFromVector(self._observer.estimate(memory, self._joint_state.Eval(context)))
