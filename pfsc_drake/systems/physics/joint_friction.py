"""Coulomb and viscous friction of the joints."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from pfsc_drake.physics.friction import BristleFriction, FrictionDrift


class JointFriction(LeafSystem):
    """Friction torques (2.34), (2.41) beside the drive torques.

    ``tau_f = f_c sat(s + tau v / delta) + f_v v`` with the
    deflection s of the bristles as state; see :class:`BristleFriction` for the law and
    for what sticking means. For elastic joints the velocity is that of the motors and
    ``tau_f`` is ``tau_fM`` of (2.65b), for rigid joints it is that of the joints.

    Drives are limited in ``tau_d``, not in ``tau_d - tau_f``: connect ``resistance`` to the
    plant's generalized forces (through the transpose of the rows that give ``velocity`` from
    the plant's velocities), beside its actuation.

    With a continuous plant, integrate at the step the bristles were made for
    (:func:`~pfsc_drake.physics.friction.bristles_for_step`) or with error control. With a
    discrete plant s is integrated between its ticks; choose the bristles accordingly.

    Ports:
        velocity (input): ``v`` [rad/s or m/s], shape (N,).
        friction_torque (output): ``tau_f`` [Nm or N], shape (N,).
        resistance (output): ``-tau_f``, the generalized force on the joints, shape (N,).

    State:
        Continuous: deflection ``s`` in [-1, 1] of each joint's bristles, shape (N,);
        0 by default, see :meth:`set_load`.

    Args:
        friction: The law with its parameters, N joints.
        drift: How all of ``tau_f`` changes with time, if it does.
    """

    def __init__(self, friction: BristleFriction, drift: FrictionDrift | None = None) -> None:
        super().__init__()
        self._friction, self._drift = friction, drift
        n = friction.dimension
        self.DeclareContinuousState(n)
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        sources = {self._velocity.ticket(), self.xc_ticket()}
        if drift is not None:
            sources.add(self.time_ticket())
        self._torque = self.DeclareVectorOutputPort(
            "friction_torque", n, self._calc_torque, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "resistance", n, self._calc_resistance, prerequisites_of_calc=sources
        )

    def coefficients(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return f_c [Nm or N] and f_v [Nm s/rad or N s/m] over time, each (samples, N).

        Args:
            times: Shape (samples,) [s].
        """
        scale = np.ones(len(times)) if self._drift is None else self._drift.scale(times)
        return np.outer(scale, self._friction.coulomb), np.outer(scale, self._friction.viscous)

    def set_load(self, context: Context, torque: np.ndarray) -> None:
        """Let friction carry a load from the start, as in a joint that has been stuck.

        Args:
            context: Context of this system.
            torque: ``tau_f`` at rest [Nm or N], shape (N,); limited to ``f_c``.
        """
        context.SetContinuousState(self._friction.deflection(torque))

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        s = context.get_continuous_state_vector().CopyToVector()
        torque = self._friction.torque(s, self._velocity.Eval(context))
        if self._drift is not None:
            torque = self._drift.scale(context.get_time()) * torque
        output.SetFromVector(torque)

    def _calc_resistance(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(-self._torque.Eval(context))

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Calculate ``s'``; the framework calls this."""
        s = context.get_continuous_state_vector().CopyToVector()
        rate = self._friction.rate(s, self._velocity.Eval(context))
        derivatives.get_mutable_vector().SetFromVector(rate)
