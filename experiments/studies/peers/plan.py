"""Joint trajectories along a path: inverse kinematics, and Drake's time-optimal Toppra."""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.optimization import CalcGridPointsOptions, Toppra
from pydrake.multibody.plant import MultibodyPlant
from pydrake.trajectories import PiecewisePolynomial, Trajectory

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path
from pfsc_drake.robot.inverse_kinematics import ToolTarget, solve_pose
from pfsc_drake.robot.robot_model import RobotModel

# m, between poses that are solved for
_SPACING = 0.01
# of a path; with Drake's own 100 the last bit before it rests asks for 6 % more than the limits
_GRID = 1000


@dataclass(frozen=True)
class JointPlan:
    """A motion of joints along a path.

    Attributes:
        path: Joint coordinates over arc length [rad, m].
        progress: Arc length over time [m, s].
        begin: When it begins [s].
        pace: How much faster time passes for ``progress``, 1 for as it is.
    """

    path: Trajectory
    progress: Trajectory
    begin: float
    pace: float = 1.0

    @property
    def duration(self) -> float:
        """How long it moves [s]."""
        return (self.progress.end_time() - self.progress.start_time()) / self.pace

    def lasting(self, duration: float) -> "JointPlan":
        """Return the same motion, slower or faster all along, so that it lasts a time [s]."""
        pace = self.pace * self.duration / duration
        return JointPlan(self.path, self.progress, self.begin, pace)

    def sampled(self, ticks: int, period: float) -> np.ndarray:
        """Return joint coordinates and rates at the ticks, shape (T, 2, N).

        Args:
            ticks: Number of ticks T.
            period: Time between them [s].
        """
        times = np.clip(np.arange(ticks) * period - self.begin, 0.0, self.duration)
        moves = (times > 0.0) & (times < self.duration)
        samples = []
        for time, moving in zip((times * self.pace).tolist(), moves.tolist(), strict=True):
            s = float(self.progress.value(time)[0, 0])
            rate = float(self.progress.EvalDerivative(time, 1)[0, 0]) * self.pace * moving
            q = self.path.value(s)[:, 0]
            samples.append([q, self.path.EvalDerivative(s, 1)[:, 0] * rate])
        return np.array(samples)


def joint_path(
    robot: RobotModel, path: Path, begin: float, end: float, q_0: np.ndarray
) -> PiecewisePolynomial:
    """Return joints over arc length that lead the tool along a path, next to a posture.

    Args:
        robot: The robot, N joints.
        path: The path, with orientation.
        begin: Arc length where it starts [m].
        end: Arc length where it ends [m].
        q_0: The posture, shape (N,).

    Raises:
        InputError: If a pose on the way is out of reach.
    """
    places = np.linspace(begin, end, 1 + max(8, round((end - begin) / _SPACING)))
    joints = []
    for eta in places.tolist():
        position, R_d = path.pose(eta)
        joints.append(solve_pose(robot, ToolTarget(position, R_d), q_0, f"path at {eta:.4g} m"))
    return PiecewisePolynomial.CubicWithContinuousSecondDerivatives(places, np.transpose(joints))


def fastest(
    plant: MultibodyPlant, path: PiecewisePolynomial, begin: float, reserve: float
) -> JointPlan:
    """Return the fastest motion along a joint path by Drake's Toppra.

    The plant's limits of velocity, acceleration and torque hold at the grid points that Toppra
    chooses.

    Args:
        plant: The robot, finalized.
        path: Joint coordinates over arc length.
        begin: When it begins [s].
        reserve: Share of every limit that is left.

    Raises:
        InputError: If there is no such motion.
    """
    share = 1.0 - reserve
    grid = Toppra.CalcGridPoints(path, CalcGridPointsOptions(min_points=_GRID))
    toppra = Toppra(path, plant, grid)
    toppra.AddJointVelocityLimit(
        share * plant.GetVelocityLowerLimits(), share * plant.GetVelocityUpperLimits()
    )
    toppra.AddJointAccelerationLimit(
        share * plant.GetAccelerationLowerLimits(), share * plant.GetAccelerationUpperLimits()
    )
    toppra.AddJointTorqueLimit(
        share * plant.GetEffortLowerLimits(), share * plant.GetEffortUpperLimits()
    )
    progress = toppra.SolvePathParameterization()
    if progress is None:
        raise InputError("Toppra: found no motion along the path within the joints' limits")
    return JointPlan(path, progress, begin)
