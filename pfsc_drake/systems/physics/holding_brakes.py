"""Brakes on the motors, which hold a robot after a fault."""

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    ContinuousState,
    DiscreteValues,
    EventStatus,
    LeafSystem,
)

from pfsc_drake.physics.friction import BristleFriction

# s, in which the holding torque builds up
_RISE = 0.02


class HoldingBrakes(LeafSystem):
    """Dry friction on the motors that sets in some time after the first fault, and stays.

    ``tau_b = c(t) f_c sat(s + tau v / delta)``, with c from 0 to 1 in 20 ms from ``delay`` after
    the tick that sees a fault. Until then nothing acts. See :class:`BristleFriction` for how it
    holds at rest.

    Ports:
        velocity (input): Of the motors [rad/s or m/s], shape (N,).
        fault (input): Nonzero in one component if there is one, any size.
        resistance (output): ``-tau_b``, the generalized force on the motors [Nm or N], shape
            (N,).

    State:
        Continuous: deflection of each brake's bristles, shape (N,). Discrete: when they
        close [s], infinite before a fault, shape (1,).

    Args:
        friction: Holding torques ``f_c`` with their bristles, N joints.
        size: Of the port ``fault``.
        delay: From the fault until they close [s].
        period: Sampling time [s].
    """

    def __init__(self, friction: BristleFriction, size: int, delay: float, period: float) -> None:
        super().__init__()
        self._friction, self._delay = friction, delay
        n = friction.dimension
        self.DeclareContinuousState(n)
        self.DeclareDiscreteState(np.array([np.inf]))
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        self._fault = self.DeclareVectorInputPort("fault", size)
        self.DeclareVectorOutputPort(
            "resistance",
            n,
            self._calc_resistance,
            prerequisites_of_calc={
                self._velocity.ticket(),
                self.xc_ticket(),
                self.xd_ticket(),
                self.time_ticket(),
            },
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._open)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._notice)

    def _open(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.set_value(np.array([np.inf]))
        return EventStatus.Succeeded()

    def _notice(self, context: Context, state: DiscreteValues) -> None:
        closing = context.get_discrete_state_vector()[0]
        if closing == np.inf and self._fault.Eval(context).any():
            state.set_value(np.array([context.get_time() + self._delay]))

    def _share(self, context: Context) -> float:
        since = context.get_time() - context.get_discrete_state_vector()[0]
        return min(max(since / _RISE, 0.0), 1.0)

    def _calc_resistance(self, context: Context, output: BasicVector) -> None:
        share = self._share(context)
        if share == 0.0:
            output.SetFromVector(np.zeros(self._friction.dimension))
            return
        s = context.get_continuous_state_vector().CopyToVector()
        torque = self._friction.torque(s, self._velocity.Eval(context))
        output.SetFromVector(-share * torque)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Calculate ``s'``, zero while the brakes are open; the framework calls this."""
        s = context.get_continuous_state_vector().CopyToVector()
        rate = np.zeros_like(s)
        if self._share(context) > 0.0:
            rate = self._friction.rate(s, self._velocity.Eval(context))
        derivatives.get_mutable_vector().SetFromVector(rate)
