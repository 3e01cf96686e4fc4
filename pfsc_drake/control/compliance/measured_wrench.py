"""A wrench that somebody else has measured."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.compliance.tool_compensation import SensorFault


class MeasuredWrench(Block):
    """A measured wrench, the load of the tool taken off already, with what stops the robot.

    Ports:
        wrench (input): ``[force, torque]`` on the tool at the tool point, world axes, shape (6,)
            [N, Nm].
        measured (output): The same.
        sensor_fault (output): A :class:`SensorFault`, shape (1,): ``LOST`` where a component is no
            finite number.
        tared (output): 1, shape (1,).
    """

    def __init__(self) -> None:
        self.inputs, self.states = {"wrench": Port(6, "N, Nm")}, {}
        self.outputs = {"measured": Port(6, "N, Nm"), "sensor_fault": Port(1), "tared": Port(1)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        fault = where(all_finite(u.wrench), SensorFault.NONE, SensorFault.LOST)
        return {"measured": u.wrench, "sensor_fault": fault, "tared": ca.DM(1.0)}
