"""Nominal model of a robot, with properties of its encoders."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.estimation.link_errors import MotorEncoders
from pfsc_drake.robot.robot_model import RobotModel

# f_c [Nm or N] and f_v [Nm s/rad or N s/m], each (N,)
Coefficients = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class NominalRobot:
    """Nominal model of a robot for its controller, with properties of its encoders.

    Attributes:
        robot: The robot, N joints.
        friction: Coefficients f_c and f_v, if any are known.
        resolution: Resolution of the measured positions, shape (N,) [rad or m], or one for all.
        velocity_delay: Age of measured velocities [s]; half an interval for a difference quotient.
        filter_time: Time constant of a filter of measured velocities [s].
        motors: Encoders of the motors, for standard deviations of unmeasured links.
    """

    robot: RobotModel
    friction: Coefficients | None = None
    resolution: np.ndarray | float = 0.0
    velocity_delay: float = 0.0
    filter_time: float = 0.0
    motors: MotorEncoders | None = None
