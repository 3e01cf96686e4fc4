"""A wrench that somebody else has measured, and the weight of a payload taken off it."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, is_finite, where
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
        """Return all outputs, and the inner values."""
        fault = where(all_finite(u.wrench), SensorFault.NONE, SensorFault.LOST)
        return {"measured": u.wrench, "sensor_fault": fault, "tared": ca.DM(1.0)}


class PayloadCompensation(Block):
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
        sensor_fault (input): A :class:`SensorFault`, shape (1,).
        payload_free (output): The wrench without the payload, shape (6,) [N, Nm].
        fault (output): The sensor's, which is lost too where the share is no number, shape (1,).

    State:
        Share that was held when the sensor was tared (``at_taring``).

    Args:
        mass: m, as believed [kg].
        p_TC: Its centre of mass in the tool's frame, as believed [m], shape (3,).
        gravity: g, world axes [m/s^2], shape (3,).
    """

    def __init__(self, mass: float, p_TC: np.ndarray, gravity: np.ndarray) -> None:
        self._weight, self._p_TC = mass * ca.DM(gravity), ca.DM(p_TC)
        self.inputs = {
            "wrench": Port(6, "N, Nm"),
            "tool_pose": Port(12, "m, 1"),
            "held": Port(1),
            "tared": Port(1),
            "sensor_fault": Port(1),
        }
        self.outputs = {"payload_free": Port(6, "N, Nm"), "fault": Port(1)}
        self.states = {"at_taring": 1}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        R_e = ca.reshape(u.tool_pose[3:], 3, 3).T
        load = ca.vertcat(self._weight, ca.cross(R_e @ self._p_TC, self._weight))
        return {
            "payload_free": u.wrench - (u.held - x.at_taring) * load,
            "fault": where(is_finite(u.held), u.sensor_fault, float(SensorFault.LOST)),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        return {"at_taring": where(u.tared < 0.5, u.held, x.at_taring)}
