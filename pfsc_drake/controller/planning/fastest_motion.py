"""The motion of a task that takes the least time, as its drives are believed."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.ndimage import maximum_filter1d

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.planning.demand_polynomial import DemandPolynomial
from pfsc_drake.control.planning.drive_demand import find_pace
from pfsc_drake.control.planning.fastest_pace import PaceLimits, find_fastest_pace
from pfsc_drake.control.planning.limiting import Limiting
from pfsc_drake.control.planning.moves import Move, one_after_another, straight_moves
from pfsc_drake.control.planning.pace_spline import PaceSpline
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.controller.planning.motion_demand import MotionDemand
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.physics.driver import torque_rates

# s, between the knots of a pace: at first, and at last unless a motion has more; of one move
_COARSE, _FINE, _FINEST, _KNOTS = 16e-3, 4e-3, 2e-3, (200, 1000)
_FEWEST, _MOST = 24, 4000
# samples of an interval: where limits are kept, and where that is checked
_SAMPLES, _CHECKED = 6, 12
# of a limit, below which it is not looked at where a motion is made faster for the last time
_WATCHED = 0.7
# samples of a move of which nothing is known yet, and of its smallest radius between them
_FIRST_SAMPLES, _OF_RADIUS = (400, 20_000), 1.0 / 6.0
# even paces that are tried for it, and how far the fastest may be from the slowest
_PACES, _SPREAD = np.geomspace(1e-3, 1e3, 241), 40.0
# s, over which the first pace is smoothed, and in which it may double
_SMOOTHING, _DOUBLED = 0.04, 0.05
# what is planned of what is allowed; of rates, and of the speeds that hold a posture back; and by
# how much that may be missed
_KEPT_OF_OTHERS = 0.985
_KEPT, _MISSED = 0.999, 5e-3
_CORRECTIONS, _STEPS, _SLOWER = 3, 20, 1.002
# parts of a way that are planned more tightly; and of what is allowed, a speed that is none
_PARTS, _STILL = 2000, 1e-6
# of a drive's torque, from which on its weight alone is too much
_ALL = 0.995


@dataclass(frozen=True)
class _Checked:
    """A motion on samples that are closer than those it was planned on."""

    motion: PiecewisePolynomialCurve
    begins: np.ndarray
    times: np.ndarray
    demand: np.ndarray
    limiting: Limiting
    postures: np.ndarray


@dataclass(frozen=True)
class _Listener:
    """Whoever is told how far planning is, which changes nothing of it."""

    progress: Progress | None

    def __content__(self) -> object:
        return None

    def __call__(self, fraction: float) -> None:
        if self.progress is not None:
            self.progress(fraction, "planning the fastest motion")


class FastestPlanner(MotionDemand):
    """Plans the fastest motion of one robot along what one task follows."""

    def plan(self, finer: int = 1, progress: Progress | None = None) -> DrivePlan:
        """Return the plan of the fastest motion.

        Args:
            finer: By how much finer the grid is to be than what is worth the time.
            progress: Told the fraction done and what is done.

        Raises:
            InputError: If there is none.
        """
        try:
            return self._plan(finer, _Listener(progress))
        except InputError as error:
            raise InputError(f"reference.speed: fastest: {error}") from None

    @once_per_content()
    def _plan(self, finer: int, tell: _Listener) -> DrivePlan:
        tell(0.0)
        moves = self._first(straight_moves(self.motion, self.demand.derivatives + 1))
        tight = [np.ones((2, 2))] * len(moves)
        tell(0.05)
        moves = self._faster(moves, _COARSE, tight, 0.0)
        tell(0.25)
        fine = self._fine_spacing(moves) / finer
        moves = self._faster(moves, fine, tight, _WATCHED)
        checked = self._check(moves)
        for k in range(_CORRECTIONS):
            tell(0.6 + 0.1 * k)
            if checked.limiting.largest.max() <= 1.0 + _MISSED:
                break
            tight = self._tightened(tight, moves, checked)
            moves = self._faster(moves, fine, tight, _WATCHED)
            checked = self._check(moves)
        for _ in range(_STEPS):
            if checked.limiting.largest.max() <= 1.0 + _MISSED:
                break
            moves = [move.slower(_SLOWER) for move in moves]
            checked = self._check(moves)
        return self._told(checked)

    @staticmethod
    def _fine_spacing(moves: list[Move]) -> float:
        """Return how far apart knots are at last [s]: closer where there is little to plan."""
        duration = sum(move.duration for move in moves)
        least, most = (duration / count for count in _KNOTS[::-1])
        return float(max(min(_FINE, max(most, _FINEST)), least))

    def _first(self, moves: list[Move]) -> list[Move]:
        """Return moves that are slowed down where they do not fit."""
        way = sum(move.duration for move in moves)
        radius = getattr(self._task.shape, "smallest_radius", np.inf)
        samples = np.clip(way / (_OF_RADIUS * radius), *_FIRST_SAMPLES)
        motion, begins = one_after_another(moves, 0.0)
        step, course = self.course_of(motion, way / samples, still=True)
        self._require_strength(motion, step, course)
        first = []
        for move, begin in zip(moves, begins, strict=True):
            window = slice(round(begin / step), round((begin + move.duration) / step) + 1)
            first.append(self._slowed(move, step, course[window]))
        return first

    def _require_strength(
        self, motion: PiecewisePolynomialCurve, step: float, course: np.ndarray
    ) -> None:
        """Refuse places where drives cannot even hold the robot."""
        n = self.robot.dimension
        share = np.abs(self.at_rest(course))[:, :n] / self.limits[:n]
        i, axis = np.unravel_index(int(share.argmax()), share.shape)
        if share[i, axis] >= _ALL:
            eta = motion.derivatives(i * step, 0)[0]
            where = ", ".join(f"{value:.3g}" for value in eta)
            raise InputError(
                f"no motion fits: at rest at eta = {where} m axis {axis + 1} needs "
                f"{100.0 * share[i, axis]:.0f} % of its torque; allowed: less than "
                f"{100.0 * _ALL:g} %"
            )

    def _slowed(self, move: Move, step: float, course: np.ndarray) -> Move:
        """Return a move at a pace at which the drives can follow."""
        allowed, order = self.allowed(course), self.demand.derivatives
        even = self._even_paces(course, allowed)
        slowest = float(even.min())
        fast = min(float(even.max()), _SPREAD * slowest)
        powers = fast ** np.arange(course.shape[1])
        duration, step = move.duration / fast, step / fast
        move = move.slower(1.0 / fast)
        try:
            pace = find_pace(
                self.demand, course * powers[:, None], step, allowed, 1.0 / _DOUBLED, _SMOOTHING
            ).rates[:, 0]
        except InputError:
            pace = np.full(len(course), 0.9 * slowest / fast)
        time = float(np.sum(step / pace))
        intervals = int(np.clip(min(time / _COARSE, len(course) / 4), _FEWEST, _MOST))
        fitted = PaceSpline.through(duration, pace, intervals, order + 1)
        return move.at_pace(fitted, order, _COARSE / 2.0)

    def _even_paces(self, course: np.ndarray, allowed: np.ndarray) -> np.ndarray:
        """Return the largest even pace below which everything is allowed, shape (samples,)."""
        polynomials = self.demand.at_constant_rate(course)
        fits = np.ones(len(course), dtype=bool)
        even = np.full(len(course), _PACES[0])
        for pace in _PACES:
            powers = pace ** np.arange(polynomials.shape[1])
            fits &= np.all(np.abs(np.einsum("k,skn->sn", powers, polynomials)) <= allowed, axis=1)
            even[fits] = pace
        return even

    def _faster(
        self, moves: list[Move], spacing: float, tight: list[np.ndarray], watched: float
    ) -> list[Move]:
        """Return the fastest moves on grids of a spacing [s]."""
        motion, begins = one_after_another(moves, self._reference.dwell)
        longest = self._step(min(spacing / _SAMPLES, self._period))
        step, course = self.course_of(motion, longest, still=not self._is_led)
        held_back, parts = self.held_back(motion, longest, course), [course]
        if self._is_led:
            # a change of pace moves what a posture leads no further than the outputs need it
            parts.append(self.bare_course_of(motion, longest, course))
        known = np.concatenate([*parts, held_back[:, None]], axis=1)
        between = make_interp_spline(step * np.arange(len(course)), known, k=3)
        return [
            self._fastest(move, between, begin, spacing, part, watched)
            for move, begin, part in zip(moves, begins, tight, strict=True)
        ]

    def _fastest(
        self,
        move: Move,
        known: BSpline,
        begin: float,
        spacing: float,
        tight: np.ndarray,
        watched: float,
    ) -> Move:
        """Return one of them.

        Args:
            move: As it is.
            known: Over time, by rows, the joints' course, then the one without what a posture
                leads, if one does, and what it takes of the speeds from which on that is held back.
            begin: When the move begins [s].
            spacing: Between the knots of its pace [s].
            tight: What is planned of the torques allowed and of their rates, at even parts of the
                way, shape (parts, 2).
            watched: As for :func:`find_fastest_pace`.
        """
        n, degree = self.robot.dimension, self.demand.derivatives + 1
        intervals = int(np.clip(move.duration / spacing, _FEWEST, _MOST))
        theta = np.linspace(0.0, move.duration, _SAMPLES * intervals + 1)
        rows, terms = known(begin + theta), self.demand.derivatives + 1
        course, bare, held_back = rows[:, :terms], rows[:, -1 - terms : -1], rows[:, -1]
        polynomial = DemandPolynomial.of(self.demand, bare, _SMOOTHING)
        if self._is_led:
            led = self.demand.of(course) - self.demand.of(bare)
            polynomial = polynomial.plus(led[:, :n])
        allowed = _KEPT * self.allowed(course)
        state = move.progress.derivatives(theta, 1)[:, :, 0]
        part = _along(state[:, 0] / state[-1, 0], tight)
        speed = np.max(np.abs(course[:, 1]) / allowed[:, n:], axis=1)
        speed = np.maximum(speed, held_back.max(axis=1) / _KEPT_OF_OTHERS)
        speed = np.maximum(speed, state[:, 1] / (_KEPT * self._velocity))
        limits = PaceLimits(
            allowed[:, :n] * part[:, :1],
            _KEPT_OF_OTHERS * self._rates * part[:, 1:],
            1.0 / np.maximum(speed, _STILL),
        )
        found = find_fastest_pace(polynomial, theta, limits, intervals, degree, watched)
        return move.at_pace(found.pace, self.demand.derivatives, spacing / 2.0)

    def _check(self, moves: list[Move]) -> _Checked:
        """Return what the moves ask for, between the samples that they were planned on."""
        motion, begins = one_after_another(moves, self._reference.dwell)
        longest = self._step(_FINE / _CHECKED)
        step, course = self.course_of(motion, longest, still=not self._is_led)
        times = step * np.arange(len(course))
        demand = self.demand.of(course)
        speed = np.abs(motion.derivatives(times, 1)[:, 1]).max(axis=1)
        ticks = max(1, round(self._period / step))
        tick = ticks, ticks * step
        limiting = Limiting.of(
            demand,
            self.allowed(course),
            tick,
            self._rates,
            speed / self._velocity,
            self.held_back(motion, longest, course),
        )
        return _Checked(motion, begins, times, demand, limiting, course[:, 0])

    def _tightened(
        self, tight: list[np.ndarray], moves: list[Move], checked: _Checked
    ) -> list[np.ndarray]:
        """Return what is to be planned of the torques allowed, where they were exceeded."""
        n, tighter = self.robot.dimension, []
        shares = checked.limiting.shares
        kinds = shares[:, :n].max(axis=1), shares[:, 2 * n : 3 * n].max(axis=1)
        excess = maximum_filter1d(np.stack(kinds, axis=1), 2 * _CHECKED + 1, axis=0)
        parts = np.linspace(0.0, 1.0, _PARTS)
        for move, begin, old in zip(moves, checked.begins, tight, strict=True):
            inside = (checked.times >= begin) & (checked.times <= begin + move.duration)
            places = move.progress.derivatives(checked.times[inside] - begin, 0)[:, 0, 0]
            at = np.searchsorted(places, parts * places[-1]).clip(0, len(places) - 1)
            tighter.append(_along(parts, old) / np.maximum(excess[inside][at], 1.0))
        return tighter

    def _step(self, longest: float) -> float:
        """Return how far samples may be apart [s]."""
        # a posture moves as fast as a sampled law lets it
        return self._period if self._is_led else longest

    @property
    def _is_led(self) -> bool:
        """Whether a posture leads joints beyond the outputs."""
        return self._law.posture is not None

    @property
    def _rates(self) -> np.ndarray:
        """Rates of torques that may be planned, shape (N,)."""
        n = self.robot.dimension
        rates = torque_rates(self._reference.torque_rate, self.limits[:n])
        return (1.0 - self._reference.reserve) * rates

    @property
    def _velocity(self) -> float:
        """Largest velocity of the tool [m/s], infinite for none."""
        given = self._reference.velocity
        return np.inf if given is None else given

    def _told(self, checked: _Checked) -> DrivePlan:
        ones = np.ones(len(checked.times))
        said = self.beyond_limits(checked.motion, float(checked.times[1]), checked.postures)
        largest = checked.limiting.largest.max()
        if largest > 1.0 + _MISSED:
            said.append(
                f"the fastest motion found takes {100.0 * largest:.1f} % of what may be asked "
                "of the drives"
            )
        moves = self._posture.reference_deg or self._posture.is_pulled
        if self._is_led and moves:
            said.append(
                "controller.posture leads the joints elsewhere while the tool moves; the fastest "
                "motion is planned for a posture that stays, and may ask more of the drives"
            )
        return DrivePlan(
            checked.times,
            checked.demand,
            checked.demand,
            self.limits,
            ones,
            checked.motion,
            said,
            checked.limiting,
        )


def _along(parts: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Return what a table of even parts of a way says of others, shape (parts, columns)."""
    even = np.linspace(0.0, 1.0, len(table))
    return np.stack([np.interp(parts, even, column) for column in table.T], axis=1)
