"""What a scenario's controller believes of the robot, and of how well its motion is measured."""

import numpy as np

from diagrams.scenario import Scenario
from pfsc_drake.following.law import Believed, Coefficients
from pfsc_drake.physics.joint_encoders import encoder_resolution
from pfsc_drake.robot.robot_model import RobotModel


def believed_robot(
    scenario: Scenario, robot: RobotModel, friction: Coefficients | None = None
) -> Believed:
    """Return what a scenario's controller believes.

    Args:
        scenario: The scenario.
        robot: The robot as it is believed.
        friction: Coefficients f_c and f_v that are believed, each (N,), if there are any.

    Raises:
        InputError: If the encoders do not suit the robot.
    """
    encoders, period = scenario.encoders, scenario.controller.sampling_time
    late = period if encoders.difference_quotient else 0.0
    return Believed(
        robot,
        friction,
        np.maximum(*encoder_resolution(robot, encoders)),
        velocity_delay=late / 2.0,
        filter_time=encoders.filter_time + late,
    )
