"""What of a robot itself holds a hand, in words."""

import numpy as np

from diagrams.station import Station
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord
from pfsc_drake.control.fixtures.robot_limits import limit_kinds
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.singularity_name import singularity_name
from pfsc_drake.robot.singular_posture import singular_posture

_NEAR_SINGULAR = {
    "elbow": "elbow nearly stretched or folded",
    "wrist": "wrist nearly straight",
    "shoulder": "tool nearly above axis 1",
}
_NO_NAME = "posture nearly singular"
POSTURES = (*_NEAR_SINGULAR.values(), _NO_NAME)
_RECORD = GuidanceRecord(0)


def holding_limit(row: np.ndarray, joints: int) -> str | None:
    """Return the kind of limit that holds the tool most, see :func:`limit_kinds`, if one does.

    Args:
        row: A record of guidance, see :class:`GuidanceRecord`.
        joints: N.
    """
    regions = GuidanceRecord.regions_in(row.size)
    slots = row[_RECORD.fields["near"]].reshape(-1, len(SLOT))
    limits = slots[slots[:, SLOT.index("index")] >= regions]
    if not limits.size:
        return None
    hardest = limits[np.argmax(limits[:, SLOT.index("phi")])]
    if not hardest[SLOT.index("phi")] > 0.0:
        return None
    return limit_kinds(joints)[int(hardest[SLOT.index("index")]) - regions]


def hardest_limit(forces: np.ndarray, joints: int) -> str | None:
    """Return the kind of limit that holds a tool on a path or surface most, if one does.

    Args:
        forces: By kind [N].
        joints: N.
    """
    hardest = int(np.argmax(forces))
    return list(dict.fromkeys(limit_kinds(joints)))[hardest] if forces[hardest] > 0.0 else None


def joint_text(kind: str) -> str:
    """Return what a limit of a joint is called for people.

    Args:
        kind: ``speed_3`` or ``end_3``.
    """
    name, _, axis = kind.partition("_")
    return f"axis {axis} at its speed" if name == "speed" else f"axis {axis} near its end"


def posture_text(station: Station, q: np.ndarray) -> str:
    """Return what a posture that is nearly singular is called for people, one of ``POSTURES``.

    Args:
        station: The station.
        q: Joint coordinates, shape (N,).
    """
    robot, place, tool = station.part.belief.robot, station.task.place, station.task.place.tool
    if not isinstance(robot, SerialChain):
        return _NO_NAME
    posture = singular_posture(
        robot, q, oriented=place.is_oriented, tool_axis=tool.tool_axis, yaw_axis=tool.yaw_axis
    )
    return _NEAR_SINGULAR.get(singularity_name(robot, q, posture) or "", _NO_NAME)
