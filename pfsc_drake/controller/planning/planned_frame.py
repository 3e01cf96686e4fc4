"""Planned motion of a workpiece that a robot holds."""

import numpy as np

from pfsc_drake.controller.planning.motion_demand import MotionDemand
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.robot.robot_model import pose_function

# s, between the samples of the trajectory
_STEP = 4e-3


def planned_frame(
    demand: MotionDemand, motion: PiecewisePolynomialCurve, placement: np.ndarray
) -> PiecewisePolynomialCurve:
    """Return ``[p_WC, R_WC by rows]`` of a workpiece in planned motion over time, of class C^6.

    Args:
        demand: Demand of the robot that holds it, whose tool frame is the workpiece frame.
        motion: Its tangential reference over time.
        placement: Nominal pose of the base relative to the actual one, ``[p, R by rows]``, (12,).

    Raises:
        InputError: If the robot's joints cannot follow the reference.
    """
    try:
        step, trajectory = demand.trajectory_of(motion, _STEP, still=False)
    except InputError as error:
        raise InputError(f"reference: the robot's trajectory along its path is {error}") from None
    times = step * np.arange(len(trajectory))
    pose = np.array(pose_function(demand.robot).map(len(trajectory))(trajectory[:, 0].T)).T
    p, R = placement[:3], placement[3:].reshape(3, 3)
    turned = R @ pose[:, 3:].reshape(-1, 3, 3)
    values = np.hstack([p + pose[:, :3] @ R.T, turned.reshape(-1, 9)])
    return PiecewisePolynomialCurve.between_rests(times, values)
