"""A gripper with suction cups, between a tool and loose plates."""

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.physics.suction import SuctionParameters, cups_function, free_cups


class SuctionGripper(LeafSystem):
    """Cups that push, seize, hold and let go of plates, see :func:`cups_function`.

    What takes hold and lets go does so at events, once per period.

    Ports:
        tool_motion (input): ``[y_t, R_e by rows, v, w]``, shape (18,), see :class:`ToolMotion`.
        plate_state (input): ``[q, v]`` of K free bodies of a MultibodyPlant, shape (13 K,).
        vacuum (input): Above 0.5 there is one, shape (1,).
        wrench (output): ``[force, torque]`` on the tool at the tool point, world axes, shape (6,)
            [N, Nm].
        applied_spatial_force (output): For the port of that name of the plates' plant.
        held (output): Share of the cups that hold, 0 to 1, shape (1,).

    State:
        Discrete: of the cups, shape (4n,).

    Args:
        parameters: The n cups.
        half_size: Half length and half width of the plates [m], shape (2,).
        bodies: The K plates in their plant.
        period: Sampling time [s].
        held: State of the cups at the start; None if they hold nothing.
    """

    def __init__(
        self,
        parameters: SuctionParameters,
        half_size: np.ndarray,
        bodies: list[BodyIndex],
        period: float,
        held: np.ndarray | None = None,
    ) -> None:
        super().__init__()
        count, size = len(parameters.cups), 6 * len(bodies)
        self._wrench, self._pushes = slice(0, 6), slice(6, 6 + size)
        self._next = slice(6 + size, 6 + size + 4 * count)
        self._result = np.zeros(6 + size + 4 * count)
        function = BoundFunction(
            cups_function(parameters, half_size, len(bodies)),
            wrench=self._result[self._wrench],
            pushes=self._result[self._pushes],
            next=self._result[self._next],
        )
        self._evaluate, self._arguments = function.evaluate, list(function.arguments.values())
        self._applied = [ExternallyAppliedSpatialForce() for _ in bodies]
        for applied, body in zip(self._applied, bodies, strict=True):
            applied.body_index, applied.p_BoBq_B = body, np.zeros(3)
        self._memory = self.DeclareDiscreteState(free_cups(count) if held is None else held)
        memory = self.discrete_state_ticket(self._memory)
        self._inputs = [
            self.DeclareVectorInputPort("tool_motion", 18),
            self.DeclareVectorInputPort("plate_state", 13 * len(bodies)),
            self.DeclareVectorInputPort("vacuum", 1),
        ]
        everything = {memory, *(port.ticket() for port in self._inputs)}
        self._evaluation = self.DeclareVectorOutputPort(
            "evaluation",
            len(self._result),
            self._calc_evaluation,
            prerequisites_of_calc=everything,
        )
        self.DeclareVectorOutputPort(
            "wrench", 6, self._calc_wrench, prerequisites_of_calc=everything
        )
        self.DeclareAbstractOutputPort(
            "applied_spatial_force",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc_applied,
            prerequisites_of_calc=everything,
        )
        self.DeclareVectorOutputPort("held", 1, self._calc_held, prerequisites_of_calc={memory})
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc_evaluation(self, context: Context, output: BasicVector) -> None:
        self._arguments[0][:] = context.get_discrete_state(self._memory).value()
        for argument, port in zip(self._arguments[1:], self._inputs, strict=True):
            argument[:] = port.Eval(context)
        self._evaluate()
        output.SetFromVector(self._result)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._evaluation.Eval(context)[self._wrench])

    def _calc_applied(self, context: Context, output: Value) -> None:
        pushes = self._evaluation.Eval(context)[self._pushes].reshape(-1, 6)
        for applied, push in zip(self._applied, pushes, strict=True):
            applied.F_Bq_W = SpatialForce(tau=push[3:], f=push[:3])
        output.set_value(self._applied)

    def _calc_held(self, context: Context, output: BasicVector) -> None:
        plates = context.get_discrete_state(self._memory).value()[::4]
        output.SetFromVector([float(np.mean(plates >= 0.0))])

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._memory, self._evaluation.Eval(context)[self._next])
