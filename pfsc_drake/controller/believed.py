"""Nominal model of a robot, with how well its motion is measured."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.estimation.link_errors import MotorEncoders
from pfsc_drake.robot.robot_model import RobotModel

# f_c [Nm or N] and f_v [Nm s/rad or N s/m], each (N,)
Coefficients = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Believed:
    """A robot as its controller knows it, and how well its motion is measured.

    Attributes:
        robot: The robot, N joints.
        friction: Coefficients f_c and f_v, if any are known.
        resolution: Resolution of the measured positions, shape (N,) [rad or m], or one for all.
        velocity_delay: How old measured velocities are [s]; a difference quotient is that of
            mid-interval.
        filter_time: By how much measured velocities are smoothed besides [s].
        motors: Encoders of the motors, for standard deviations of links that are not measured.
    """

    robot: RobotModel
    friction: Coefficients | None = None
    resolution: np.ndarray | float = 0.0
    velocity_delay: float = 0.0
    filter_time: float = 0.0
    motors: MotorEncoders | None = None
