"""What force sensor and compliance stop a robot for."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import first_of
from pfsc_drake.control.compliance.tool_compensation import SensorFault
from pfsc_drake.control.law.fault import Fault


class Alarms(Block):
    """Turns what force sensor and compliance tell into a fault.

    Ports:
        alarms (input, optional): A
            :class:`~pfsc_drake.control.compliance.tool_compensation.SensorFault`, whether the
            sensor is tared, before which its range does not matter, an
            :class:`~pfsc_drake.control.compliance.impedance.ImpedanceStatus`, and whether the
            force with which the robot presses is lost, shape (4,).
        fault (output): A :class:`~pfsc_drake.control.law.fault.Fault`, shape (1,).
    """

    def __init__(self) -> None:
        self.inputs = {"alarms": Port(4, optional=True)}
        self.outputs, self.states = {"fault": Port(1)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        if u.alarms is None:
            return {"fault": ca.DM(Fault.NONE)}
        sensor, tared, compliance, press_lost = ca.vertsplit(u.alarms)
        fault = first_of(
            (sensor == SensorFault.LOST, Fault.FORCE_SENSOR_LOST),
            (
                ca.logic_and(sensor == SensorFault.SATURATED, tared),
                Fault.FORCE_SENSOR_SATURATED,
            ),
            (compliance, Fault.COMPLIANCE_INVALID),
            (press_lost, Fault.PRESS_FORCE_LOST),
            otherwise=Fault.NONE,
        )
        return {"fault": fault}
