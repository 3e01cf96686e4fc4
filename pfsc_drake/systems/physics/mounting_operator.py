"""An operator who mounts a plate."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from pfsc_drake.physics.hand_model import HandModel, HandParameters, Place
from pfsc_drake.physics.mounting_hand import MountingHand
from pfsc_drake.physics.mounting_parameters import MountingHandParameters
from pfsc_drake.systems.physics.operator_hand import OperatorHand


class MountingOperator(OperatorHand):
    """A hand that grips, leads, searches, inserts and lets go, see :class:`MountingHand`.

    It sees the tool once per period, answers after its reaction delay, trembles, and is limited in
    force as :class:`OperatorHand` is.

    Ports, beside those of :class:`OperatorHand`:
        held (input): Share of the gripper's cups that hold, shape (1,).
        vacuum (output): 1 while it has the vacuum on, shape (1,).
        phase (output): :class:`MountingPhase`, shape (1,).

    State, beside: discrete, of the hand, shape (11,).

    Args:
        parameters: Properties of the hand; its waypoints lead.
        mounting: How it goes about.
        goal: Tool point and orientation when the plate is seated, shapes (3,) and (3, 3).
        pin_length: Of the plate [m].
        period: Sampling time [s].
        place: See :class:`OperatorHand`.

    Raises:
        InputError: See :class:`OperatorHand`.
    """

    def __init__(
        self,
        parameters: HandParameters,
        mounting: MountingHandParameters,
        goal: tuple[np.ndarray, np.ndarray],
        pin_length: float,
        period: float,
        place: Place | None = None,
    ) -> None:
        super().__init__(parameters, period, place)
        self._mounting = MountingHand(
            mounting, HandModel(parameters, place), *goal, pin_length, period
        )
        self._doing = self.DeclareDiscreteState(self._mounting.start())
        self._held = self.DeclareVectorInputPort("held", 1)
        memory = {self.discrete_state_ticket(self._doing)}
        self.DeclareVectorOutputPort("vacuum", 1, self._calc_vacuum, prerequisites_of_calc=memory)
        self.DeclareVectorOutputPort("phase", 1, self._calc_phase, prerequisites_of_calc=memory)

    def _state(self, context: Context) -> np.ndarray:
        return context.get_discrete_state(self._doing).value()

    def _calc_vacuum(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([float(self._mounting.vacuum(self._state(context)))])

    def _calc_phase(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([float(self._mounting.phase(self._state(context)))])

    def _answer(self, context: Context, pose: np.ndarray, twist: np.ndarray) -> np.ndarray:
        return self._mounting.wanted(self._state(context), context.get_time(), pose, twist)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        super()._update(context, state)
        pose = self._tool_pose.Eval(context)
        if np.isfinite(pose).all():
            after = self._mounting.step(
                self._state(context), context.get_time(), pose, float(self._held.Eval(context)[0])
            )
            state.set_value(self._doing, after)
