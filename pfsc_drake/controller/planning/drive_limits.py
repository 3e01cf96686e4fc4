"""Plan of a motion within the limits of the drives, slowed down where they are exceeded."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices
from pfsc_drake.control.planning.drive_demand import Clock, apply_scaling, find_scaling
from pfsc_drake.control.planning.joint_trajectory import TrajectoryError, TrajectoryStart
from pfsc_drake.controller.nominal_robot import Coefficients
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.controller.planning.fastest_motion import FastestPlanner
from pfsc_drake.controller.planning.motion_demand import MotionDemand
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.errors import InputError, require
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.progress import Progress

# s, between the samples of a trajectory: at a glance, while it is checked, and while it is slowed
_GLANCED, _CHECKED, _SLOWED, _FINEST = 16e-3, 4e-3, 1e-3, 2.5e-4
# of the allowed demand, up to which a glance is enough
_AT_A_GLANCE = 0.65
# s, of motions that are planned; and the most samples of one
_LONGEST, _MOST = 1000.0, 100_000
# of the smallest radius, and of a change of speed, between samples; at a glance a multiple
_OF_RADIUS, _OF_RAMP = 1.0 / 12.0, 1.0 / 6.0
# s of the requested time, over which a change of the speed scaling is smoothed
_SMOOTHING = 0.04
# to which the speed scaling is found at which two robots would fit
_SCALING_TOLERANCE = 5e-3
# s, between the knots of a slowed reference
_KNOTS = 2e-3
# of a drive's torque, from which on holding still takes so much that no lower speed helps
_TOO_HEAVY = 0.95
# speed scaling below which a section counts as slowed
_SLOW = 0.99


def keep_drive_limits(
    options: FollowerOptions,
    task: Task,
    law: FollowingLaw,
    start: TrajectoryStart,
    friction: Coefficients | None,
    duration: float = 0.0,
    progress: Progress | None = None,
) -> None:
    """Give a task its plan, and the motion that the drives can follow, unless it has them.

    Hand guiding, streamed waypoints, and motions that are longer than any run are not planned.
    Nothing is slowed down on a manifold in a moving frame (``frame_motion``).

    Args:
        options: Options, with the demand on the drives that the motion may make.
        task: Task of the tool.
        law: Its law.
        start: Start of the robot, near the first point of the motion.
        friction: Coefficients f_c and f_v of the nominal model, each (N,), if there are any.
        duration: Duration of the run [s]; 0 for the duration of the motion.
        progress: Receives the fraction done and the name of the step.

    Raises:
        InputError: If the fastest motion is requested, and there is none.
    """
    limits, carrier = options.reference, options.frame_motion
    assert limits is not None  # otherwise nothing is planned
    fastest = limits.speed == "fastest"
    along = indices(task.projected_manifold.coordinates, Kind.TANGENTIAL)
    guided = not task.is_planned or bool(law.stabilization.is_free[along].any())
    if task.drive_plan is not None:
        return
    if guided:
        require(
            not fastest, "reference.speed", "fastest", "asked; a hand-guided motion is not planned"
        )
        return
    assert task.motion is not None  # of a planned task
    known = options, task, law, start, friction
    if fastest:
        task.drive_plan = FastestPlanner(*known).plan(progress=progress)
    elif task.motion.domain[1] <= _LONGEST:
        try:
            frame = None if carrier is None else carrier()
        except InputError as error:
            task.drive_plan = DrivePlanner(*known, duration=duration).unknown(str(error))
            return
        task.drive_plan = DrivePlanner(*known, frame, duration).plan()
    else:
        return
    task.motion = task.drive_plan.motion


class DrivePlanner(MotionDemand):
    """Planner of one motion of one robot.

    Args:
        options: See :class:`MotionDemand`, and all below.
        task: The task.
        law: Its law.
        start: Start of the robot.
        friction: Coefficients of the nominal model.
        carrier: Motion of the manifold's frame.
        duration: Duration of the run [s]; 0 for the duration of the motion.
    """

    def __init__(
        self,
        options: FollowerOptions,
        task: Task,
        law: FollowingLaw,
        start: TrajectoryStart,
        friction: Coefficients | None,
        carrier: PiecewisePolynomialCurve | None = None,
        duration: float = 0.0,
    ) -> None:
        super().__init__(options, task, law, start, friction, carrier)
        self._run_duration = duration

    @once_per_content()
    def plan(self) -> DrivePlan:
        """Return a plan of the requested motion, or of a slower one."""
        try:
            step, trajectory = self.trajectory(_GLANCED)
            if self.may_be_singular(self.motion, self._step(_GLANCED), trajectory):
                step, trajectory = self.trajectory(_SLOWED)
            fits = self.fits(trajectory, _AT_A_GLANCE)
            if not fits and self.fits(trajectory, 1.0):
                step, trajectory = self.trajectory(_CHECKED)
                fits = self.fits(trajectory, 1.0)
            if not fits:
                # a glance may overestimate the demand, above all of redundant joints
                step, trajectory = self.trajectory(_SLOWED)
                fits = self.fits(trajectory, 1.0)
            demand = self.demand.of(trajectory)
        except TrajectoryError as error:
            messages = self._beyond_limits(self._step(_GLANCED), error.trajectory, still=True)
            return self.unknown(str(error), messages)
        messages = self._beyond_limits(step, trajectory[:, 0], still=step > _CHECKED)
        messages += self._weight_beyond_reserve(step, trajectory)
        plan = self._plan_for(trajectory, demand, step, fits)
        return replace(plan, messages=[*messages, *plan.messages])

    def allowed(self, trajectory: np.ndarray, reserve: float | None = None) -> np.ndarray:
        """Return the allowed demand on the drives, infinite where a lower speed would not help.

        Args:
            trajectory: See :class:`MotionDemand`.
            reserve: See :class:`MotionDemand`.
        """
        too_heavy = np.abs(self.at_rest(trajectory)) >= _TOO_HEAVY * self.limits
        return np.where(too_heavy, np.inf, super().allowed(trajectory, reserve))

    def _weight_beyond_reserve(self, step: float, trajectory: np.ndarray) -> list[str]:
        """Return a message if holding still takes more torque than the reserve leaves."""
        n, reserve = self.robot.dimension, self._reference.reserve
        share = np.abs(self.at_rest(trajectory)[:, :n]) / self.limits[:n]
        i, axis = np.unravel_index(int(share.argmax()), share.shape)
        worst = float(share[i, axis])
        if worst <= 1.0 - reserve:
            return []
        location = self.where(self.motion, i * step)
        message = (
            f"holding still takes {100.0 * worst:.0f} % of the torque of axis {axis + 1} at "
            f"{location}, reference.reserve = {reserve:g} leaves {100.0 * (1.0 - reserve):.0f} %"
        )
        if worst >= 1.0:
            return [f"{message}: the robot cannot be held there, whatever its speed"]
        if worst >= _TOO_HEAVY:
            return [f"{message}: no lower speed changes that, and the motion is not slowed for it"]
        lower = np.floor(100.0 * (1.0 - worst)) / 100.0
        return [
            f"{message}: the motion is slow there for the remaining torque; reference.reserve = "
            f"{lower:g} would leave the weight, and less against disturbances"
        ]

    def _beyond_limits(self, step: float, postures: np.ndarray, *, still: bool) -> list[str]:
        """Return a message on the first joint that passes a limit, if one does."""
        motion = self.motion
        messages = self.beyond_limits(motion, step, postures)
        if not messages or not still or self._law.posture is None:
            return messages
        # a glance does not move redundant joints by themselves
        try:
            step, trajectory = self.trajectory(_SLOWED)
        except TrajectoryError as error:
            return self.beyond_limits(motion, self._step(_SLOWED), error.trajectory)
        return self.beyond_limits(motion, step, trajectory[:, 0])

    def _plan_for(
        self, trajectory: np.ndarray, demand: np.ndarray, step: float, fits: bool
    ) -> DrivePlan:
        """Return a plan of a feasible joint trajectory."""
        times, ones = step * np.arange(len(trajectory)), np.ones(len(trajectory))
        motion = self.motion
        requested = DrivePlan(times, demand, demand, self.limits, ones, motion, [])
        if fits:
            return requested
        if self._carrier is not None:
            return self.plan_with_common_scaling(requested, trajectory)
        if self._reference.limits == "warn":
            return self.plan_with_warning(requested, trajectory)
        return self.slow_down(requested, trajectory, step)

    def unknown(self, error: str, besides: Sequence[str] = ()) -> DrivePlan:
        """Return a plan of a motion without known demand, with further messages."""
        nothing, empty = np.zeros((0, len(self.limits))), np.zeros(0)
        message = f"whether the drives can follow the reference is not known: {error}"
        motion = self.motion
        return DrivePlan(empty, nothing, nothing, self.limits, empty, motion, [*besides, message])

    def trajectory(
        self, longest: float, added: Callable[[np.ndarray], np.ndarray] | None = None
    ) -> tuple[float, np.ndarray]:
        """Return the joint trajectory on an even grid of the requested time, and its step [s].

        Args:
            longest: Largest step of the grid [s].
            added: Derivatives 0..r that are added to those of the reference at times [s], shape
                (samples, r + 1, m), if any are.

        Raises:
            InputError: If the joints cannot follow.
        """
        still = longest > _CHECKED
        return self.trajectory_of(self.motion, self._step(longest), still=still, added=added)

    def _step(self, longest: float) -> float:
        """Return the largest step between samples [s]: narrow bends need a smaller one."""
        reference, glance = self._reference, longest > _CHECKED
        coarser = 1.0 / (3.0 * _OF_RADIUS) if glance else 1.0
        radius = getattr(self._task.shape, "smallest_radius", np.inf)
        bend = coarser * _OF_RADIUS * radius / reference.largest_velocity
        ramp = _OF_RAMP * reference.largest_velocity / reference.acceleration
        ramp = max(ramp, 2.0 * _SLOWED if glance else _SLOWED)
        if self._law.posture is not None and not glance:
            # it moves as fast as a sampled law lets it
            longest = min(longest, self._period)
        step = min(max(bend, min(_FINEST, longest)), ramp, longest)
        return max(float(step), self.motion.domain[1] / _MOST)

    def fits(self, trajectory: np.ndarray, share: float) -> bool:
        """Return whether the demand of a trajectory is within a share of the allowed one."""
        return bool(np.all(np.abs(self.demand.of(trajectory)) <= share * self.allowed(trajectory)))

    def slow_down(self, requested: DrivePlan, trajectory: np.ndarray, step: float) -> DrivePlan:
        """Return a plan that is slowed down where the drives need it."""
        reference, duration = self._reference, self.motion.domain[1]
        change = reference.acceleration / reference.largest_velocity
        allowed = self.allowed(trajectory)
        excess = self._excess(requested, allowed)
        try:
            scaling = find_scaling(self.demand, trajectory, step, allowed, change, _SMOOTHING)
        except InputError as error:
            return replace(requested, messages=[f"{excess}; and {error}"])
        clock = Clock(scaling.rates[:, 0], step)
        times, motion = clock.times, _rescale_time(self.motion, clock)
        demand = self.demand.of(apply_scaling(trajectory, scaling.rates))
        slow = scaling.rates[:, 0]
        sections = np.count_nonzero(np.diff((slow < _SLOW).astype(int), prepend=0) == 1)
        i = int(slow.argmin())
        speed = float(np.linalg.norm(self._rates(i * step))) * slow[i]
        message = (
            f"the reference is slowed to {speed:.3g} m/s in {sections} "
            f"section{'s' if sections > 1 else ''}, extended from {duration:.4g} s to "
            f"{times[-1]:.4g} s: " + excess
        )
        run_duration = self._run_duration
        if 0.0 < run_duration < times[-1]:
            message += f"; duration = {run_duration:g} s ends before it does"
        return DrivePlan(times, demand, requested.demand, requested.limits, slow, motion, [message])

    def plan_with_warning(self, requested: DrivePlan, trajectory: np.ndarray) -> DrivePlan:
        """Return the plan of the requested motion, with a message on the exceeded limit."""
        excess = self._excess(requested, self.allowed(trajectory))
        message = f"{excess}; reference.limits: respect would slow it down there"
        return replace(requested, messages=[message])

    def plan_with_common_scaling(self, requested: DrivePlan, trajectory: np.ndarray) -> DrivePlan:
        """Return the requested plan on a moving workpiece, with the scaling at which it would fit.

        Slowed alone the tool would meet the workpiece elsewhere. With a scaling c of both motions,
        speeds are c and accelerations c^2 of the requested ones, and the joint paths are the same.
        """
        allowed, fits, exceeds = self.allowed(trajectory), 0.0, 1.0
        rates = np.zeros((len(trajectory), 4))
        while exceeds - fits > _SCALING_TOLERANCE:
            rates[:, 0] = 0.5 * (fits + exceeds)
            demand = np.abs(self.demand.of(apply_scaling(trajectory, rates)))
            fits, exceeds = (
                (rates[0, 0], exceeds) if np.all(demand <= allowed) else (fits, rates[0, 0])
            )
        advice = "; no common scaling of both robots would fit either"
        if fits > 0.0:
            advice = (
                f"; it fits with {fits:.2f} of the velocities and {fits**2:.2f} of the "
                "accelerations of both robots"
            )
        return replace(requested, messages=[self._excess(requested, allowed) + advice])

    def _rates(self, time: float) -> np.ndarray:
        return self.motion.derivatives(np.array([time]), 1)[0, 1]

    def _excess(self, requested: DrivePlan, allowed: np.ndarray) -> str:
        """Return a message on the largest excess of the requested motion."""
        ratio = np.abs(requested.demand) / allowed
        i, column = np.unravel_index(int(ratio.argmax()), ratio.shape)
        share = np.abs(requested.demand[i, column]) / requested.limits[column]
        kind = "torque" if column < len(self.limits) // 2 else "speed"
        where = self.where(self.motion, requested.times[i])
        return (
            f"the requested motion needs {100.0 * share:.0f} % of the {kind} of axis "
            f"{column % (len(self.limits) // 2) + 1} at {where}"
        )


def _rescale_time(motion: PiecewisePolynomialCurve, clock: Clock) -> PiecewisePolynomialCurve:
    """Return a motion with another time scaling, of class C^6."""
    even = np.linspace(0.0, clock.end, int(np.ceil(clock.end / _KNOTS)) + 1)
    requested = np.minimum(clock.tau(even), motion.domain[1])
    values = motion.derivatives(requested, 0)[:, 0]
    return PiecewisePolynomialCurve.between_rests(even, values)
