"""Demand of the motions of a task on the drives, by the nominal model."""

from collections.abc import Callable

import numpy as np

from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.planning.drive_demand import (
    DriveDemand,
    DriveLimits,
    allowed_demand,
    apply_scaling,
)
from pfsc_drake.control.planning.joint_trajectory import (
    TrajectoryError,
    TrajectoryFinder,
    TrajectoryStart,
)
from pfsc_drake.controller.fault_description import describe_singularity
from pfsc_drake.controller.nominal_robot import Coefficients
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.robot.coordinate_text import posture_text
from pfsc_drake.robot.robot_model import largest_speeds
from pfsc_drake.robot.singular_posture import singular_posture
from pfsc_drake.yaml.fields import spread

# share of joint speeds that is left where torques are commanded
_SPEED_RESERVE = 0.05
# of singular values of the tool's Jacobian: below, the posture is the cause of a singularity
_SINGULAR = 0.02


class MotionDemand:
    """Demand of the motions of one task on the drives of one robot.

    Args:
        options: Options of the controller; ``reference`` has the reserve of the drives.
        task: Task of the tool.
        law: Its law.
        start: Start of the robot, near the first point of the reference.
        friction: Coefficients f_c and f_v of the nominal model, each (N,), if there are any.
        carrier: ``[p_WC, R_WC by rows]`` over time of the moving frame of the task's manifold, if
            there is one; at rest at the ends.

    Attributes:
        robot: Nominal model of the robot, N joints.
        demand: Demand of a joint motion on the drives.
        limits: Limits of the drives: torques, then speeds, shape (2N,).
    """

    def __init__(
        self,
        options: FollowerOptions,
        task: Task,
        law: FollowingLaw,
        start: TrajectoryStart,
        friction: Coefficients | None,
        carrier: PiecewisePolynomialCurve | None = None,
    ) -> None:
        self._carrier, reference, controller = carrier, options.reference, options.controller
        assert reference is not None  # of a motion that is planned
        self._reference, self._period = reference, controller.sampling_time
        self._task, self._law, self._start = task, law, start
        self._posture = controller.posture
        self.robot, reserve = law.robot, reference.reserve
        f_c, f_v = friction or (np.zeros(self.robot.dimension),) * 2
        damping = spread(controller.boundary_layer_damping, self.robot.dimension)
        self.demand = DriveDemand(
            self.robot, controller.law, f_v, np.array(damping) if damping else None
        )
        found = task.projected_manifold, task.evaluate, law.inverse, law.posture
        self._finder = TrajectoryFinder(self.robot, *found, in_moving_frame=carrier is not None)
        effort = self.robot.gather("effort_limit") * controller.effort_scale
        effort = np.maximum(effort - f_c, 1e-3 * effort)
        speed = largest_speeds(self.robot)
        self.limits = DriveLimits(effort, speed).together
        # of speeds only servos run short; with torques, nothing but the motion decides over them
        of_speeds = reserve if law.linearization.relative_degree == 1 else _SPEED_RESERVE
        self._reserve = np.repeat([reserve, of_speeds], self.robot.dimension)

    @property
    def motion(self) -> PiecewisePolynomialCurve:
        """Motion that is planned."""
        assert self._task.motion is not None  # otherwise guided or streamed
        return self._task.motion

    def trajectory_of(
        self,
        motion: PiecewisePolynomialCurve,
        step: float,
        *,
        still: bool,
        added: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> tuple[float, np.ndarray]:
        """Return the joint trajectory on an even grid of a motion's time, and its step [s].

        Args:
            motion: Tangential coordinates over time.
            step: Largest step of the grid [s].
            still: Whether joints beyond the outputs only move with them, as little as they can.
            added: Derivatives 0..r that are added to those of the reference at times [s], shape
                (samples, r + 1, m), if any are.

        Raises:
            TrajectoryError: If the joints cannot follow; says where.
        """
        times, reference = self._sample(motion, step)
        if added is not None:
            reference += added(times)
        frames = self._frames(times)
        try:
            trajectory = self._finder.find(
                self._start, reference, times, still=still, frames=frames
            )
        except TrajectoryError as error:
            raise self._locate(error, motion, float(times[1])) from None
        return float(times[1]), self._extend(trajectory, times[1])

    def may_be_singular(
        self, motion: PiecewisePolynomialCurve, step: float, trajectory: np.ndarray
    ) -> bool:
        """Return whether a singular posture may lie between the samples of a trajectory.

        The condition number on either side, extrapolated by a sample, shows it.

        Args:
            motion: Tangential coordinates over time.
            step: Requested step [s].
            trajectory: Its joint trajectory.
        """
        times, reference = self._sample(motion, step)
        followed = trajectory[:, : reference.shape[1]]
        rcond = self._finder.condition(self._start, followed, reference, self._frames(times))
        ahead = np.minimum(2.0 * rcond[1:-1] - rcond[:-2], 2.0 * rcond[1:-1] - rcond[2:])
        return bool(np.any(ahead < self._law.inverse.min_rcond))

    def _locate(
        self, error: TrajectoryError, motion: PiecewisePolynomialCurve, step: float
    ) -> TrajectoryError:
        """Return an error that says where the robot cannot follow the motion, and why."""
        time, q = step * (len(error.trajectory) - 1), error.trajectory[-1]
        where = self.where(motion, time)
        message = f"the joints do not reach the reference at {where}"
        if error.rcond is not None:
            message = f"{error} at {where}"
            manifold, tool = self._task.projected_manifold, self._task.projected_manifold.tool
            axes = {"tool_axis": tool.tool_axis, "yaw_axis": tool.yaw_axis}
            posture = singular_posture(self.robot, q, oriented=manifold.is_oriented, **axes)
            if posture.rcond < _SINGULAR:
                message = describe_singularity(self.robot, q, posture, f"singular at {where}")
        located = TrajectoryError(message, error.rcond)
        located.trajectory = error.trajectory
        return located

    def where(self, motion: PiecewisePolynomialCurve, time: float) -> str:
        """Return the name of a point of a motion, for messages.

        Args:
            motion: Tangential coordinates over time.
            time: Time of the point [s].
        """
        eta = motion.derivatives(np.array([time]), 0)[0, 0]
        value = f"{eta[0]:.3g}" if len(eta) == 1 else f"({eta[0]:.3g}, {eta[1]:.3g})"
        return f"eta = {value} m"

    def beyond_limits(
        self, motion: PiecewisePolynomialCurve, step: float, postures: np.ndarray
    ) -> list[str]:
        """Return a message on the first joint that passes a position limit, if one does.

        Args:
            motion: Tangential coordinates over time.
            step: Step of the grid [s].
            postures: Joint coordinates on it, shape (samples, N).
        """
        lower, upper = self.robot.gather("position_limits").T
        beyond = (postures < lower) | (postures > upper)
        if not beyond.any():
            return []
        i = int(np.argmax(beyond.any(axis=1)))
        joint = int(np.argmax(beyond[i]))
        limit = posture_text(self.robot, np.clip(postures[i], lower, upper), [joint])
        return [
            f"joint {joint + 1} passes its limit, {limit}, at {self.where(motion, i * step)}, "
            f"after {i * step:.3g} s of the reference: start in another posture "
            "(start.posture_deg), or move the path"
        ]

    def _frames(self, times: np.ndarray) -> np.ndarray | None:
        """Return the motion of the manifold's frame, at rest after its end."""
        carrier = self._carrier
        if carrier is None:
            return None
        order, end = self._law.linearization.relative_degree, carrier.domain[1]
        frames = carrier.derivatives(np.minimum(times, end), order)
        frames[times > end, 1:] = 0.0
        return np.asarray(frames.reshape(len(times), -1))

    def _sample(
        self, motion: PiecewisePolynomialCurve, step: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return times of an even grid, and the reference of the virtual output on it."""
        order, duration = self._law.linearization.relative_degree, motion.domain[1]
        times = np.linspace(0.0, duration, int(np.ceil(duration / step)) + 1)
        requested = motion.derivatives(times, order)
        reference = np.zeros(
            (len(times), order + 1, len(self._task.projected_manifold.coordinates))
        )
        reference[:, :, : requested.shape[2]] = requested
        return times, reference

    def _extend(self, trajectory: np.ndarray, step: float) -> np.ndarray:
        """Return a trajectory with all derivatives that the demand depends on."""
        while trajectory.shape[1] <= self.demand.derivatives:
            further = np.gradient(trajectory[:, -1:], step, axis=0)
            trajectory = np.concatenate([trajectory, further], axis=1)
        return trajectory[:, : self.demand.derivatives + 1]

    def trajectory_without_posture(
        self, motion: PiecewisePolynomialCurve, step: float, trajectory: np.ndarray
    ) -> np.ndarray:
        """Return a motion's trajectory without the motion that only a posture adds.

        Args:
            motion: Tangential coordinates over time.
            step: Requested step [s].
            trajectory: Its joint trajectory.
        """
        times, reference = self._sample(motion, step)
        followed = trajectory[:, : reference.shape[1]]
        return self._extend(
            self._finder.without_posture(self._start, followed, reference), times[1]
        )

    def restraint_ratio(
        self, motion: PiecewisePolynomialCurve, step: float, trajectory: np.ndarray
    ) -> np.ndarray:
        """Return joint speeds by those from which on the law holds a posture back, (samples, N).

        Args:
            motion: Tangential coordinates over time.
            step: Requested step [s].
            trajectory: Its joint trajectory.
        """
        reference = self._sample(motion, step)[1]
        return self._finder.restraint_ratio(
            self._start, trajectory[:, : reference.shape[1]], reference
        )

    def allowed(self, trajectory: np.ndarray, reserve: float | None = None) -> np.ndarray:
        """Return the allowed demand on the drives, (samples, 2N).

        Args:
            trajectory: The joint trajectory, see :meth:`trajectory_of`.
            reserve: Reserved share of the torques; the reserve of the reference by default.
        """
        left = self._reserve.copy()
        if reserve is not None:
            left[: self.robot.dimension] = reserve
        return allowed_demand(self.at_rest(trajectory), self.limits, left)

    def at_rest(self, trajectory: np.ndarray) -> np.ndarray:
        """Return the demand at rest in the postures of a trajectory, (samples, 2N)."""
        return self.demand.of(apply_scaling(trajectory, np.zeros((len(trajectory), 4))))
