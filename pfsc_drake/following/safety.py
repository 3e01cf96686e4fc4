"""How a robot is watched, stopped and held, by its law and by its servos."""

import numpy as np

from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.supervision import SupervisionParameters
from pfsc_drake.following.believed import Believed
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.options.faults import FaultParameters
from pfsc_drake.robot.robot_model import RobotModel

# s; a start beside the path takes a drive to its limit for some hundredths
_SATURATION_TIME = 0.2


def safe_state(
    parameters: ControllerParameters, robot: RobotModel, faults: FaultParameters
) -> SafeState:
    """Return how a robot is stopped and held after a fault.

    Args:
        parameters: Of the controller.
        robot: The robot as it is believed.
        faults: What is a fault.
    """
    effort = robot.gather("effort_limit") * parameters.effort_scale
    damping = parameters.brake_damping * np.where(np.isfinite(effort), effort, 0.0)
    return SafeState(damping, faults.hold_bandwidth, faults.effort_share)


def supervision(law: str, faults: FaultParameters, believed: Believed) -> SupervisionParameters:
    """Return what is watched of a robot's joints.

    Args:
        law: Name of the law.
        faults: What is a fault.
        believed: The robot.
    """
    return SupervisionParameters(
        tolerance=faults.plausibility,
        resolution=np.broadcast_to(believed.resolution, believed.robot.dimension),
        filter_time=believed.filter_time,
        joint_limits=faults.joint_limits,
        saturation_time=_saturation_time(law, faults.saturation_time),
        chatter_turns=faults.chatter_turns,
        overspeed=faults.overspeed,
    )


def _saturation_time(law: str, given: float | None) -> float:
    """Return how long a drive may be at its limit [s]; 0 for ever."""
    if given is not None:
        return given
    return 0.0 if RELATIVE_DEGREE[law] == 1 else _SATURATION_TIME
