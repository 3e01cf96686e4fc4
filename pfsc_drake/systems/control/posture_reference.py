"""The posture next to which a robot with more joints than outputs stays."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.control.compliance.yielding_posture import YieldingPosture
from pfsc_drake.systems.optional_input import value_or_none


class PostureReference(LeafSystem):
    """The posture reference ``q_0`` with its derivatives, see :class:`YieldingPosture`.

    It starts at rest where the joints are at initialization, and goes smoothly to its goal.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point (input): Where on the manifold the tool is.
        tau_ext (input, optional): External torques that the posture yields to, shape (N,)
            [Nm or N].
        posture_reference (output): Derivatives 0..r of ``q_0`` by rows, shape ((r + 1) N,).

    State:
        Discrete: the output; and in a second group the goal, shape (N,).

    Args:
        law: How the posture moves.
        num_joints: N.
        point_size: Of ``manifold_point``.
        period: Sampling time [s].
        goal: Where the posture goes, shape (N,) [rad or m]; None for where it starts.
    """

    def __init__(
        self,
        law: YieldingPosture,
        num_joints: int,
        point_size: int,
        period: float,
        goal: np.ndarray | None = None,
    ) -> None:
        super().__init__()
        self._law, self._n, self._given = law, num_joints, goal
        self._motion = self.DeclareDiscreteState(law.size)
        self._goal = self.DeclareDiscreteState(num_joints)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * num_joints)
        self._point = self.DeclareVectorInputPort("manifold_point", point_size)
        self._tau_ext = self.DeclareVectorInputPort("tau_ext", num_joints)
        self.DeclareStateOutputPort("posture_reference", self._motion)
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        q = self._joint_state.Eval(context)[: self._n]
        state.set_value(self._motion, self._law.start(q))
        state.set_value(self._goal, q if self._given is None else self._given)
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        after = self._law.update(
            context.get_discrete_state(self._motion).value(),
            self._joint_state.Eval(context)[: self._n],
            self._point.Eval(context),
            value_or_none(self._tau_ext, context),
            context.get_discrete_state(self._goal).value(),
        )
        state.set_value(self._motion, after)
