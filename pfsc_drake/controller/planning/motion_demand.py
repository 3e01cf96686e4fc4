"""What a task's motion asks of the drives, as they are believed."""

from collections.abc import Callable

import numpy as np

from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.planning.drive_demand import (
    DriveDemand,
    DriveLimits,
    allowed_demand,
    with_pace,
)
from pfsc_drake.control.planning.joint_course import CourseError, CourseFinder, CourseStart
from pfsc_drake.controller.believed import Coefficients
from pfsc_drake.controller.fault_description import describe_singularity
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.robot.coordinate_text import posture_text
from pfsc_drake.robot.robot_model import largest_speeds
from pfsc_drake.robot.singular_posture import singular_posture
from pfsc_drake.yaml.fields import spread

# share of joint speeds that is left where torques are commanded
_SPEED_RESERVE = 0.05
# of singular values of the tool's Jacobian: below, a singular place is the posture's fault
_SINGULAR = 0.02


class MotionDemand:
    """What the motions of one task ask of one robot.

    Args:
        options: Options of the controller; ``reference`` says what a motion leaves of the drives.
        task: What the tool is to do.
        law: The law that does it.
        start: Where the robot starts, near the first place of the reference.
        friction: Coefficients f_c and f_v that the drives overcome besides, each (N,), if any
            are believed.
        carrier: ``[p_WC, R_WC by rows]`` over time of the frame that carries the task's manifold,
            if one does; at rest at the ends.

    Attributes:
        robot: The robot as it is believed, N joints.
        demand: What a motion of its joints asks for.
        limits: What drives can do: torques, then speeds, shape (2N,).
    """

    def __init__(
        self,
        options: FollowerOptions,
        task: Task,
        law: FollowingLaw,
        start: CourseStart,
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
        found = task.place, task.evaluate, law.inverse, law.posture
        self._finder = CourseFinder(self.robot, *found, carried=carrier is not None)
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
        assert self._task.motion is not None  # else a hand guides the tool, or waypoints come
        return self._task.motion

    def course_of(
        self,
        motion: PiecewisePolynomialCurve,
        step: float,
        *,
        still: bool,
        added: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> tuple[float, np.ndarray]:
        """Return the joints' course on an even grid of a motion's time, and its step [s].

        Args:
            motion: Tangential coordinates over time.
            step: From sample to sample at most [s].
            still: Whether joints beyond the outputs only move with them, as little as they can.
            added: Derivatives 0..r that are added to those of the reference at times [s], shape
                (samples, r + 1, m), if any are.

        Raises:
            CourseError: If the joints cannot follow; says where.
        """
        times, reference = self._sampled(motion, step)
        if added is not None:
            reference += added(times)
        frames = self._frames(times)
        try:
            course = self._finder.find(self._start, reference, times, still=still, frames=frames)
        except CourseError as error:
            raise self._located(error, motion, float(times[1])) from None
        return float(times[1]), self._continued(course, times[1])

    def may_be_singular(
        self, motion: PiecewisePolynomialCurve, step: float, course: np.ndarray
    ) -> bool:
        """Return whether a singular place may lie between the samples of a course.

        The condition number of either side then leads there by the next sample.

        Args:
            motion: Tangential coordinates over time.
            step: As it was asked for.
            course: Its course.
        """
        times, reference = self._sampled(motion, step)
        led = course[:, : reference.shape[1]]
        rcond = self._finder.condition(self._start, led, reference, self._frames(times))
        ahead = np.minimum(2.0 * rcond[1:-1] - rcond[:-2], 2.0 * rcond[1:-1] - rcond[2:])
        return bool(np.any(ahead < self._law.inverse.min_rcond))

    def _located(
        self, error: CourseError, motion: PiecewisePolynomialCurve, step: float
    ) -> CourseError:
        """Return an error that says where on its way the robot cannot follow, and why."""
        time, q = step * (len(error.course) - 1), error.course[-1]
        where = self.where(motion, time)
        said = f"the joints do not reach the reference at {where}"
        if error.rcond is not None:
            said = f"{error} at {where}"
            place, tool = self._task.place, self._task.place.tool
            axes = {"tool_axis": tool.tool_axis, "yaw_axis": tool.yaw_axis}
            posture = singular_posture(self.robot, q, oriented=place.is_oriented, **axes)
            if posture.rcond < _SINGULAR:
                said = describe_singularity(self.robot, q, posture, f"singular at {where}")
        located = CourseError(said, error.rcond)
        located.course = error.course
        return located

    def where(self, motion: PiecewisePolynomialCurve, time: float) -> str:
        """Return what to call a place of a motion.

        Args:
            motion: Tangential coordinates over time.
            time: When it is there [s].
        """
        eta = motion.derivatives(np.array([time]), 0)[0, 0]
        value = f"{eta[0]:.3g}" if len(eta) == 1 else f"({eta[0]:.3g}, {eta[1]:.3g})"
        return f"eta = {value} m"

    def beyond_limits(
        self, motion: PiecewisePolynomialCurve, step: float, postures: np.ndarray
    ) -> list[str]:
        """Return which joint first passes a limit of its position, if one does, and where.

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
        """Return the motion of what carries the manifold, at rest after its end."""
        carrier = self._carrier
        if carrier is None:
            return None
        order, end = self._law.linearization.relative_degree, carrier.domain[1]
        frames = carrier.derivatives(np.minimum(times, end), order)
        frames[times > end, 1:] = 0.0
        return np.asarray(frames.reshape(len(times), -1))

    def _sampled(
        self, motion: PiecewisePolynomialCurve, step: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return even times and the reference of the virtual output then."""
        order, duration = self._law.linearization.relative_degree, motion.domain[1]
        times = np.linspace(0.0, duration, int(np.ceil(duration / step)) + 1)
        asked = motion.derivatives(times, order)
        reference = np.zeros((len(times), order + 1, len(self._task.place.coordinates)))
        reference[:, :, : asked.shape[2]] = asked
        return times, reference

    def _continued(self, course: np.ndarray, step: float) -> np.ndarray:
        """Return a course with as many derivatives as the demand depends on."""
        while course.shape[1] <= self.demand.derivatives:
            further = np.gradient(course[:, -1:], step, axis=0)
            course = np.concatenate([course, further], axis=1)
        return course[:, : self.demand.derivatives + 1]

    def bare_course_of(
        self, motion: PiecewisePolynomialCurve, step: float, course: np.ndarray
    ) -> np.ndarray:
        """Return a motion's course without what only a posture moves.

        Args:
            motion: Tangential coordinates over time.
            step: As it was asked for.
            course: Its course.
        """
        times, reference = self._sampled(motion, step)
        led = course[:, : reference.shape[1]]
        return self._continued(self._finder.bare(self._start, led, reference), times[1])

    def held_back(
        self, motion: PiecewisePolynomialCurve, step: float, course: np.ndarray
    ) -> np.ndarray:
        """Return joint speeds by those from which on the law holds a posture back, (samples, N).

        Args:
            motion: Tangential coordinates over time.
            step: As it was asked for.
            course: Its course.
        """
        reference = self._sampled(motion, step)[1]
        return self._finder.held_back(self._start, course[:, : reference.shape[1]], reference)

    def allowed(self, course: np.ndarray, reserve: float | None = None) -> np.ndarray:
        """Return what may be asked of the drives, (samples, 2N).

        Args:
            course: The joints' course, see :meth:`course_of`.
            reserve: Share of the torques that is left; that of the reference by default.
        """
        left = self._reserve.copy()
        if reserve is not None:
            left[: self.robot.dimension] = reserve
        return allowed_demand(self.at_rest(course), self.limits, left)

    def at_rest(self, course: np.ndarray) -> np.ndarray:
        """Return what the places of a course ask for at rest, (samples, 2N)."""
        return self.demand.of(with_pace(course, np.zeros((len(course), 4))))
