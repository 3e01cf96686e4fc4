"""Whether the drives can follow the reference, and a slower one if they cannot."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices
from pfsc_drake.control.planning.drive_demand import Clock, find_pace, with_pace
from pfsc_drake.control.planning.joint_course import CourseError, CourseStart
from pfsc_drake.controller.believed import Coefficients
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.controller.planning.fastest_motion import FastestPlanner
from pfsc_drake.controller.planning.motion_demand import MotionDemand
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.errors import InputError, require
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.progress import Progress

# s, between the samples of a course: at a glance, while it is checked, and while it is slowed
_GLANCED, _CHECKED, _SLOWED, _FINEST = 16e-3, 4e-3, 1e-3, 2.5e-4
# of what may be asked, up to which a glance is enough
_AT_A_GLANCE = 0.65
# s, of motions that are planned; and the most samples of one
_LONGEST, _MOST = 1000.0, 100_000
# of the smallest radius, and of a change of speed, from sample to sample; at a glance a few times
_OF_RADIUS, _OF_RAMP = 1.0 / 12.0, 1.0 / 6.0
# s of the asked time, over which a change of pace is smoothed
_SMOOTHING = 0.04
# to which the pace is found at which two robots would fit
_OF_PACE = 5e-3
# s, between the knots of a slowed reference
_KNOTS = 2e-3
# of a drive's torque, from which on holding still takes so much that no pace helps
_HELD = 0.95
# of the pace, from which on a place counts as slowed
_SLOW = 0.99


def keep_drive_limits(
    options: FollowerOptions,
    task: Task,
    law: FollowingLaw,
    start: CourseStart,
    friction: Coefficients | None,
    duration: float = 0.0,
    progress: Progress | None = None,
) -> None:
    """Give a task its plan, and the motion that the drives can follow, unless it has them.

    Motions that a hand or waypoints that come decide on, or that are longer than any run, are not
    planned. Where a frame carries the manifold (``frame_motion``), nothing is slowed down.

    Args:
        options: Options, with the demand on the drives that the motion may make.
        task: Task of the tool.
        law: Its law.
        start: Start of the robot, near the first place of the motion.
        friction: Coefficients f_c and f_v of the nominal model, each (N,), if there are any.
        duration: Duration of the run [s]; 0 for that of the motion.
        progress: Receives the fraction done and the name of the step.

    Raises:
        InputError: If the fastest motion is requested, and there is none.
    """
    limits, carrier = options.reference, options.frame_motion
    assert limits is not None  # else nothing is planned
    fastest = limits.speed == "fastest"
    along = indices(task.place.coordinates, Kind.TANGENTIAL)
    led = not task.is_planned or bool(law.stabilization.is_free[along].any())
    if task.drive_plan is not None:
        return
    if led:
        require(not fastest, "reference.speed", "fastest", "asked; where a hand leads nobody plans")
        return
    assert task.motion is not None  # as it is planned
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
    """Plans one motion of one robot.

    Args:
        options: See :class:`MotionDemand`, and all below.
        task: The task.
        law: Its law.
        start: Start of the robot.
        friction: Coefficients of the nominal model.
        carrier: Motion of the frame that carries the manifold.
        duration: Duration of the run [s]; 0 for that of the motion.
    """

    def __init__(
        self,
        options: FollowerOptions,
        task: Task,
        law: FollowingLaw,
        start: CourseStart,
        friction: Coefficients | None,
        carrier: PiecewisePolynomialCurve | None = None,
        duration: float = 0.0,
    ) -> None:
        super().__init__(options, task, law, start, friction, carrier)
        self._run_duration = duration

    @once_per_content()
    def plan(self) -> DrivePlan:
        """Return a plan of the motion as it was asked for, or of a slower one."""
        try:
            step, course = self.course(_GLANCED)
            if self.may_be_singular(self.motion, self._step(_GLANCED), course):
                step, course = self.course(_SLOWED)
            fits = self.fits(course, _AT_A_GLANCE)
            if not fits and self.fits(course, 1.0):
                step, course = self.course(_CHECKED)
                fits = self.fits(course, 1.0)
            if not fits:
                # a glance may see too much, of joints beyond the outputs above all
                step, course = self.course(_SLOWED)
                fits = self.fits(course, 1.0)
            demand = self.demand.of(course)
        except CourseError as error:
            said = self._beyond_limits(self._step(_GLANCED), error.course, still=True)
            return self.unknown(str(error), said)
        said = self._beyond_limits(step, course[:, 0], still=step > _CHECKED)
        said += self._held_beyond_reserve(step, course)
        plan = self._of_course(course, demand, step, fits)
        return replace(plan, said=[*said, *plan.said])

    def allowed(self, course: np.ndarray, reserve: float | None = None) -> np.ndarray:
        """Return what may be asked of the drives, infinite where no pace changes enough of it.

        Args:
            course: As of :class:`MotionDemand`.
            reserve: As of :class:`MotionDemand`.
        """
        held = np.abs(self.at_rest(course)) >= _HELD * self.limits
        return np.where(held, np.inf, super().allowed(course, reserve))

    def _held_beyond_reserve(self, step: float, course: np.ndarray) -> list[str]:
        """Return where holding still takes more than the reserve leaves, if it does."""
        n, reserve = self.robot.dimension, self._reference.reserve
        share = np.abs(self.at_rest(course)[:, :n]) / self.limits[:n]
        i, axis = np.unravel_index(int(share.argmax()), share.shape)
        worst = float(share[i, axis])
        if worst <= 1.0 - reserve:
            return []
        place = self.where(self.motion, i * step)
        said = (
            f"holding still takes {100.0 * worst:.0f} % of the torque of axis {axis + 1} at "
            f"{place}, reference.reserve = {reserve:g} leaves {100.0 * (1.0 - reserve):.0f} %"
        )
        if worst >= 1.0:
            return [f"{said}: the robot cannot be held there, whatever its speed"]
        if worst >= _HELD:
            return [f"{said}: no lower speed changes that, and the motion is not slowed for it"]
        lower = np.floor(100.0 * (1.0 - worst)) / 100.0
        return [
            f"{said}: the motion is slow there for what is left; reference.reserve = {lower:g} "
            "would leave the weight, and less against disturbances"
        ]

    def _beyond_limits(self, step: float, postures: np.ndarray, *, still: bool) -> list[str]:
        """Return which joint passes a limit on the way, if one does."""
        motion = self.motion
        said = self.beyond_limits(motion, step, postures)
        if not said or not still or self._law.posture is None:
            return said
        # a glance leaves joints beyond the outputs where they are
        try:
            step, course = self.course(_SLOWED)
        except CourseError as error:
            return self.beyond_limits(motion, self._step(_SLOWED), error.course)
        return self.beyond_limits(motion, step, course[:, 0])

    def _of_course(
        self, course: np.ndarray, demand: np.ndarray, step: float, fits: bool
    ) -> DrivePlan:
        """Return a plan of a course that the joints can go."""
        times, ones, motion = step * np.arange(len(course)), np.ones(len(course)), self.motion
        asked = DrivePlan(times, demand, demand, self.limits, ones, motion, [])
        if fits:
            return asked
        if self._carrier is not None:
            return self.told_of_both(asked, course)
        if self._reference.limits == "warn":
            return self.warned(asked, course)
        return self.slowed(asked, course, step)

    def unknown(self, error: str, besides: Sequence[str] = ()) -> DrivePlan:
        """Return a plan of a motion of which nothing is known, with what is said besides."""
        nothing, empty = np.zeros((0, len(self.limits))), np.zeros(0)
        said = f"whether the drives can follow the reference is not known: {error}"
        motion = self.motion
        return DrivePlan(empty, nothing, nothing, self.limits, empty, motion, [*besides, said])

    def course(
        self, longest: float, added: Callable[[np.ndarray], np.ndarray] | None = None
    ) -> tuple[float, np.ndarray]:
        """Return the joints' course on an even grid of the time asked for, and its step [s].

        Args:
            longest: From sample to sample [s].
            added: Derivatives 0..r that are added to those of the reference at times [s], shape
                (samples, r + 1, m), if any are.

        Raises:
            InputError: If the joints cannot follow.
        """
        still = longest > _CHECKED
        return self.course_of(self.motion, self._step(longest), still=still, added=added)

    def _step(self, longest: float) -> float:
        """Return how far samples may be apart [s]: narrow bends need more of them."""
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

    def fits(self, course: np.ndarray, share: float) -> bool:
        """Return whether a course asks for no more than a share of what it may."""
        return bool(np.all(np.abs(self.demand.of(course)) <= share * self.allowed(course)))

    def slowed(self, asked: DrivePlan, course: np.ndarray, step: float) -> DrivePlan:
        """Return a plan that waits where the drives need it."""
        reference, duration = self._reference, self.motion.domain[1]
        change = reference.acceleration / reference.largest_velocity
        allowed = self.allowed(course)
        excess = self._excess(asked, allowed)
        try:
            pace = find_pace(self.demand, course, step, allowed, change, _SMOOTHING)
        except InputError as error:
            return replace(asked, said=[f"{excess}; and {error}"])
        clock = Clock(pace.rates[:, 0], step)
        times, motion = clock.times, _retimed(self.motion, clock)
        demand = self.demand.of(with_pace(course, pace.rates))
        slow = pace.rates[:, 0]
        places = np.count_nonzero(np.diff((slow < _SLOW).astype(int), prepend=0) == 1)
        i = int(slow.argmin())
        speed = float(np.linalg.norm(self._rates(i * step))) * slow[i]
        said = (
            f"the reference is slowed to {speed:.3g} m/s in {places} "
            f"place{'s' if places > 1 else ''}, {duration:.4g} s become {times[-1]:.4g} s: "
            + excess
        )
        given = self._run_duration
        if 0.0 < given < times[-1]:
            said += f"; duration = {given:g} s ends before it does"
        return DrivePlan(times, demand, asked.demand, asked.limits, slow, motion, [said])

    def warned(self, asked: DrivePlan, course: np.ndarray) -> DrivePlan:
        """Return a plan as asked for, with what there is to say."""
        excess = self._excess(asked, self.allowed(course))
        said = f"{excess}; reference.limits: respect would slow it down there"
        return replace(asked, said=[said])

    def told_of_both(self, asked: DrivePlan, course: np.ndarray) -> DrivePlan:
        """Return a plan as asked for on what moves, with the pace at which it would fit.

        Slowed alone it would meet what carries the manifold elsewhere. At a pace c of both, speeds
        are c and accelerations c^2 of those asked for, and the joints go the same way.
        """
        allowed, fits, exceeds = self.allowed(course), 0.0, 1.0
        rates = np.zeros((len(course), 4))
        while exceeds - fits > _OF_PACE:
            rates[:, 0] = 0.5 * (fits + exceeds)
            demand = np.abs(self.demand.of(with_pace(course, rates)))
            fits, exceeds = (
                (rates[0, 0], exceeds) if np.all(demand <= allowed) else (fits, rates[0, 0])
            )
        advice = "; neither would it at any other pace of both robots"
        if fits > 0.0:
            advice = (
                f"; it fits with {fits:.2f} of the velocities and {fits**2:.2f} of the "
                "accelerations of both robots"
            )
        return replace(asked, said=[self._excess(asked, allowed) + advice])

    def _rates(self, time: float) -> np.ndarray:
        return self.motion.derivatives(np.array([time]), 1)[0, 1]

    def _excess(self, asked: DrivePlan, allowed: np.ndarray) -> str:
        """Return what is too much in a motion as it was asked for."""
        ratio = np.abs(asked.demand) / allowed
        i, column = np.unravel_index(int(ratio.argmax()), ratio.shape)
        share = np.abs(asked.demand[i, column]) / asked.limits[column]
        kind = "torque" if column < len(self.limits) // 2 else "speed"
        where = self.where(self.motion, asked.times[i])
        return (
            f"as asked for it takes {100.0 * share:.0f} % of the {kind} of axis "
            f"{column % (len(self.limits) // 2) + 1} at {where}"
        )


def _retimed(motion: PiecewisePolynomialCurve, clock: Clock) -> PiecewisePolynomialCurve:
    """Return a motion gone through at another pace, of class C^6."""
    even = np.linspace(0.0, clock.end, int(np.ceil(clock.end / _KNOTS)) + 1)
    asked = np.minimum(clock.tau(even), motion.domain[1])
    values = motion.derivatives(asked, 0)[:, 0]
    return PiecewisePolynomialCurve.between_rests(even, values)
