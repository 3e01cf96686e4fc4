"""Faults: the first one is latched, and switches the drives to the safe stop."""

import enum
from collections.abc import Sequence
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import first_of, latch, where


class Fault(enum.IntEnum):
    """Cause of the safe state, found by the law or another system."""

    NONE = 0
    INPUT_NOT_FINITE = 1
    PROJECTION_FAILED = 2
    OUTSIDE_FEASIBLE_NEIGHBOURHOOD = 3
    SINGULAR = 4
    MEASUREMENT_IMPLAUSIBLE = 5
    JOINT_LIMIT = 6
    DRIVE_SATURATED = 7
    ORIENTATION_ERROR = 8
    FORCE_SENSOR_LOST = 9
    FORCE_SENSOR_SATURATED = 10
    COMPLIANCE_INVALID = 11
    BUS_LOST = 12
    JOINT_SPEED = 13
    DRIVE_CHATTERS = 14
    PRESS_FORCE_LOST = 15
    STOP_REQUESTED = 16
    BEYOND_END = 17
    FORCE_SENSOR_JUMPED = 18

    @property
    def explanation(self) -> str:
        """Explanation in one phrase."""
        return _EXPLANATIONS[self]


_EXPLANATIONS = {
    Fault.NONE: "no fault",
    Fault.INPUT_NOT_FINITE: "a measured value or a reference is not a finite number",
    Fault.PROJECTION_FAILED: "the projection onto the path did not converge",
    Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD: "the tool left the feasible neighbourhood of the path",
    Fault.SINGULAR: "the decoupling matrix is close to singular",
    Fault.MEASUREMENT_IMPLAUSIBLE: "measured values of a joint contradict each other",
    Fault.JOINT_LIMIT: "a joint is at its limit",
    Fault.DRIVE_SATURATED: "a drive has been at its limit for too long",
    Fault.ORIENTATION_ERROR: "the tool is turned away from its reference by 90 deg or more",
    Fault.FORCE_SENSOR_LOST: "the force/torque sensor is lost",
    Fault.FORCE_SENSOR_SATURATED: "the force/torque sensor is at the end of its range",
    Fault.COMPLIANCE_INVALID: "force, impedance or reference of the compliance is not valid",
    Fault.BUS_LOST: "no reference was received over the bus for too long",
    Fault.JOINT_SPEED: "a joint is faster than its limit",
    Fault.DRIVE_CHATTERS: "a drive jumps between its limits",
    Fault.PRESS_FORCE_LOST: "the force on the workpiece is far from its reference",
    Fault.STOP_REQUESTED: "a stop was requested",
    Fault.BEYOND_END: "the tool went beyond an end of the path",
    Fault.FORCE_SENSOR_JUMPED: "the force/torque sensor has jumped as no force does",
}


class FaultLatch(Block):
    """Latch of the first fault of several kinds; only a new start clears it.

    Ports:
        (inputs): A fault each, shape (1,), 0 for none; of several in one sample the first counts.
        fault (output): The fault, from its first sample on, shape (1,).

    State:
        fault

    Args:
        causes: Names of the inputs, the root cause first.
    """

    def __init__(self, causes: Sequence[str]) -> None:
        self.inputs = {name: Port(1) for name in causes}
        self.outputs, self.states = {"fault": Port(1)}, {"fault": 1}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        found = [getattr(u, name) for name in self.inputs]
        return {"fault": latch(x.fault, first_of(*zip(found, found, strict=True), otherwise=0))}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the next states; omitted states do not change."""
        return {"fault": y.fault}


class FaultSwitch(Block):
    """Switch of the commands to the drives: the law, or after a fault the safe stop.

    Ports:
        drive (input): Command of the law, shape (N,).
        stop (input, optional): Command after a fault, shape (N,); zero if not connected.
        fault (input): Nonzero from the fault on, shape (1,).
        command (output): Command to the drives, shape (N,).

    Args:
        num_drives: N.
        unit: Unit of the commands.
    """

    def __init__(self, num_drives: int, unit: str = "") -> None:
        self.inputs = {
            "drive": Port(num_drives),
            "stop": Port(num_drives, optional=True),
            "fault": Port(1),
        }
        self.outputs, self.states = {"command": Port(num_drives, unit)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        stop = ca.DM(*u.drive.shape) if u.stop is None else u.stop
        return {"command": where(u.fault, stop, u.drive)}
