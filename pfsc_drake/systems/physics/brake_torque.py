"""Torque of brakes with anchors."""

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    Diagram,
    DiagramBuilder,
    InputPortIndex,
    LeafSystem,
)
from pydrake.systems.primitives import ConstantVectorSource, PortSwitch

from pfsc_drake.physics.friction import BristleFriction


class BrakeTorque(Diagram):
    """Springs and dampers between motors and anchors, within limits.

    ``tau_b = k min(max(q_M - a + tau v_M, -g), g)`` with the stiffness ``k = f_c / delta`` and the
    relaxation ``tau`` of the bristles: the friction of
    :class:`~pfsc_drake.physics.friction.BristleFriction`, with anchors from
    :class:`~pfsc_drake.physics.holding_brakes.HoldingBrakes` at each tick. While all brakes are
    open (g = 0), nothing is computed in the stages of an integration.

    Ports:
        joint_state (input): Simulated ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        anchor, give (input): ``a`` and ``g`` of the brakes [rad or m], each (N,).
        resistance (output): ``-tau_b``, the generalized force on the motors [Nm or N], shape (N,).

    Args:
        friction: Holding torques ``f_c`` with their bristles, N joints.
    """

    def __init__(self, friction: BristleFriction) -> None:
        super().__init__()
        n = friction.dimension
        builder = DiagramBuilder()
        springs = builder.AddNamedSystem("springs", _BrakeSprings(friction))
        none = builder.AddNamedSystem("none", ConstantVectorSource(np.zeros(n)))
        acting = builder.AddNamedSystem("acting", PortSwitch(n))
        # a switch evaluates the selected input alone
        builder.Connect(none.get_output_port(), acting.DeclareInputPort("open"))
        builder.Connect(springs.GetOutputPort("torque"), acting.DeclareInputPort("closed"))
        builder.Connect(springs.GetOutputPort("closed"), acting.get_port_selector_input_port())
        for name in ("joint_state", "anchor", "give"):
            builder.ExportInput(springs.GetInputPort(name), name)
        builder.ExportOutput(acting.get_output_port(), "resistance")
        builder.BuildInto(self)


class _BrakeSprings(LeafSystem):
    """Torque of the springs, and the selector of a switch."""

    def __init__(self, friction: BristleFriction) -> None:
        super().__init__()
        n = friction.dimension
        self._stiffness, self._relaxation = friction.stiffness, friction.relaxation
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._anchor = self.DeclareVectorInputPort("anchor", n)
        self._give = self.DeclareVectorInputPort("give", n)
        self.DeclareAbstractOutputPort(
            "closed",
            lambda: Value(InputPortIndex(0)),
            self._calc_closed,
            prerequisites_of_calc={self._give.ticket()},
        )
        self.DeclareVectorOutputPort(
            "torque", n, self._calc_torque, prerequisites_of_calc={self.all_input_ports_ticket()}
        )

    def _calc_closed(self, context: Context, output: AbstractValue) -> None:
        # selector 0 is the open brake
        output.set_value(InputPortIndex(1 + int(self._give.Eval(context).any())))

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        _, _, q_M, v_M = self._joint_state.Eval(context).reshape(4, -1)
        give = self._give.Eval(context)
        moved = q_M - self._anchor.Eval(context) + self._relaxation * v_M
        output.SetFromVector(-self._stiffness * np.clip(moved, -give, give))
