"""Why a law stops."""

import enum


class Fault(enum.IntEnum):
    """Why a law, or a system beside it, went to its safe state."""

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

    @property
    def explanation(self) -> str:
        """One phrase for people."""
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
    Fault.BUS_LOST: "no reference has come over the bus for too long",
    Fault.JOINT_SPEED: "a joint is faster than its limit",
    Fault.DRIVE_CHATTERS: "a drive jumps between its limits",
    Fault.PRESS_FORCE_LOST: "the force on the workpiece is far from its reference",
}
