"""What a robot can do, told to a filter that leads it along."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from pfsc_drake.control.compliance.led_motion import LedMotion


class MotionLimits(LeafSystem):
    """Takes back a speed along a manifold to what the robot can follow, see :class:`LedMotion`.

    Ports:
        wanted_speed (input): Of the tangential coordinates, then their mass, shape (count + 1,)
            [m/s, kg]; from :class:`ImpedanceFilter`. What is no number is left as it is.
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        manifold_point (input): Where on the manifold the tool is.
        allowed_speed (output): What of it the robot can follow, shape (count,) [m/s].
        limit_force (output): By what forces the robot's limits held the hand in the last interval,
            shape (kinds,) [N].

    State:
        Discrete: ``limit_force``.

    Args:
        limits: What the robot can do along the tangential coordinates.
        period: Sampling time [s].
    """

    def __init__(self, limits: LedMotion, period: float) -> None:
        super().__init__()
        self._limits, kinds = limits, len(limits.kinds)
        self._count = limits.tangential.stop - limits.tangential.start
        self._wanted = self.DeclareVectorInputPort("wanted_speed", self._count + 1)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * limits.num_joints)
        self._point = self.DeclareVectorInputPort("manifold_point", limits.point_size)
        memory = self.discrete_state_ticket(self.DeclareDiscreteState(kinds))
        sources = {p.ticket() for p in (self._wanted, self._joint_state, self._point)}
        self._found = self.DeclareVectorOutputPort(
            "found", self._count + kinds, self._calc_found, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "allowed_speed", self._count, self._calc_allowed, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "limit_force", kinds, self._calc_limit_force, prerequisites_of_calc={memory}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc_found(self, context: Context, output: BasicVector) -> None:
        measured, n = self._joint_state.Eval(context), self._limits.num_joints
        wanted = self._wanted.Eval(context)[: self._count]
        speed, held = self._limits.allowed(
            measured[:n], measured[n : 2 * n], self._point.Eval(context), wanted
        )
        output.SetFromVector(np.concatenate([speed if held.any() else wanted, held]))

    def _calc_allowed(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._found.Eval(context)[: self._count])

    def _calc_limit_force(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state_vector().value())

    def _update(self, context: Context, state: DiscreteValues) -> None:
        *speed, mass = self._wanted.Eval(context)
        if np.isfinite(speed).all():
            state.set_value(mass * self._found.Eval(context)[self._count :])
