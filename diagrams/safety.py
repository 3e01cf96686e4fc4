"""How a scenario's robot is watched, stopped and held, by its law and by its servos."""

import numpy as np

from diagrams.scenario import ControllerParameters, FaultParameters, Scenario
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.supervision import SupervisionParameters
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.physics.joint_encoders import encoder_resolution

# s; a start beside the path takes a drive to its limit for some hundredths
_SATURATION_TIME = 0.2


def safe_state(
    parameters: ControllerParameters, robot: RobotModel, faults: FaultParameters
) -> SafeState:
    """Return how a robot is stopped and held after a fault.

    Args:
        parameters: Of the controller.
        robot: The robot as it is believed.
        faults: What the scenario says of faults.
    """
    effort = robot.gather("effort_limit") * parameters.effort_scale
    damping = parameters.brake_damping * np.where(np.isfinite(effort), effort, 0.0)
    return SafeState(damping, faults.hold_bandwidth, faults.effort_share)


def supervision(scenario: Scenario, robot: RobotModel) -> SupervisionParameters:
    """Return what is watched of a scenario's joints.

    Args:
        scenario: The scenario.
        robot: The robot as it is believed.

    Raises:
        InputError: If the encoders do not suit the robot.
    """
    faults, encoders = scenario.faults, scenario.encoders
    late = scenario.controller.sampling_time if encoders.difference_quotient else 0.0
    return SupervisionParameters(
        tolerance=faults.plausibility,
        resolution=np.maximum(*encoder_resolution(robot, encoders)),
        filter_time=encoders.filter_time + late,
        joint_limits=faults.joint_limits,
        saturation_time=_saturation_time(scenario),
        chatter_turns=faults.chatter_turns,
        overspeed=faults.overspeed,
    )


def _saturation_time(scenario: Scenario) -> float:
    """Return how long a drive may be at its limit [s]; 0 for ever."""
    given = scenario.faults.saturation_time
    if given is not None:
        return given
    return 0.0 if RELATIVE_DEGREE[scenario.controller.law] == 1 else _SATURATION_TIME
