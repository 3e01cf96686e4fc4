"""Weight of what a gripper holds, taken off the measured wrench."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem


class PayloadCompensation(LeafSystem):
    """Takes the weight of a payload off a wrench while it is held.

    ``f - h m g`` and ``tau - h (R_e p_TC) x m g``, h being the share of the payload that hangs on
    the gripper. What hung there while the sensor was tared is part of its bias, and h counts from
    there; that is right as long as the tool keeps its orientation, or nothing was held.

    Ports:
        wrench (input): At the tool point, world axes, shape (6,) [N, Nm], see
            :class:`ToolCompensation`.
        tool_pose (input): ``[y_t, R_e by rows]`` as measured, shape (12,).
        held (input): Share that is held, 0 to 1, shape (1,).
        tared (input): Above 0.5 once the sensor is tared, shape (1,).
        payload_free (output): The wrench without the payload, shape (6,) [N, Nm].

    State:
        Discrete: the share that was held when the sensor was tared, shape (1,).

    Args:
        mass: m, as believed [kg].
        p_TC: Its centre of mass in the tool's frame, as believed [m], shape (3,).
        gravity: g, world axes [m/s^2], shape (3,).
        period: Sampling time [s].
    """

    def __init__(self, mass: float, p_TC: np.ndarray, gravity: np.ndarray, period: float) -> None:
        super().__init__()
        self._weight, self._p_TC = mass * np.asarray(gravity), np.asarray(p_TC)
        self._at_taring = self.DeclareDiscreteState(1)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._pose = self.DeclareVectorInputPort("tool_pose", 12)
        self._held = self.DeclareVectorInputPort("held", 1)
        self._tared = self.DeclareVectorInputPort("tared", 1)
        inputs = (self._wrench, self._pose, self._held)
        memory = self.discrete_state_ticket(self._at_taring)
        self.DeclareVectorOutputPort(
            "payload_free",
            6,
            self._calc_payload_free,
            prerequisites_of_calc={memory, *(port.ticket() for port in inputs)},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc_payload_free(self, context: Context, output: BasicVector) -> None:
        wrench = self._wrench.Eval(context).copy()
        tared = context.get_discrete_state(self._at_taring).value()[0]
        share = self._held.Eval(context)[0] - tared
        if share != 0.0:
            arm = self._pose.Eval(context)[3:].reshape(3, 3) @ self._p_TC
            wrench[:3] -= share * self._weight
            wrench[3:] -= share * np.cross(arm, self._weight)
        output.SetFromVector(wrench)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        if self._tared.Eval(context)[0] < 0.5:
            state.set_value(self._at_taring, self._held.Eval(context))
