"""What is watched of a scenario's joints, by its law and by its servos."""

import numpy as np

from diagrams.scenario import Scenario
from pfsc_drake.control.law.supervision import SupervisionParameters
from pfsc_drake.following import safety
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.physics.joint_encoders import encoder_resolution


def supervision(scenario: Scenario, robot: RobotModel) -> SupervisionParameters:
    """Return what is watched of a scenario's joints.

    Args:
        scenario: The scenario.
        robot: The robot as it is believed.

    Raises:
        InputError: If the encoders do not suit the robot.
    """
    encoders = scenario.encoders
    late = scenario.controller.sampling_time if encoders.difference_quotient else 0.0
    return safety.supervision(
        scenario.controller.law,
        scenario.faults,
        np.maximum(*encoder_resolution(robot, encoders)),
        encoders.filter_time + late,
    )
