"""Fastest motion of a task within the nominal limits of the drives."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.ndimage import maximum_filter1d

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.planning.demand_polynomial import DemandPolynomial
from pfsc_drake.control.planning.drive_demand import find_scaling
from pfsc_drake.control.planning.fastest_scaling import ScalingLimits, find_fastest_scaling
from pfsc_drake.control.planning.limiting import Limiting
from pfsc_drake.control.planning.moves import Move, one_after_another, straight_moves
from pfsc_drake.control.planning.scaling_spline import ScalingSpline
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.controller.planning.motion_demand import MotionDemand
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.physics.driver import torque_rates

# s, between the knots of a speed scaling: at first, at last unless a motion has more, of one move
_COARSE, _FINE, _FINEST, _KNOTS = 16e-3, 4e-3, 2e-3, (200, 1000)
_FEWEST, _MOST = 24, 4000
# samples of an interval: for the limits, and for their check
_SAMPLES, _CHECKED = 6, 12
# share of a limit below which it is ignored in the last optimization
_WATCHED = 0.7
# samples of a move at first, and step as a share of its smallest radius
_FIRST_SAMPLES, _OF_RADIUS = (400, 20_000), 1.0 / 6.0
# constant scalings that are tried for it, and how far the fastest may be from the slowest
_SCALINGS, _SPREAD = np.geomspace(1e-3, 1e3, 241), 40.0
# s, over which the first scaling is smoothed, and in which it may double
_SMOOTHING, _DOUBLED = 0.04, 0.05
# planned share of the allowed torques; of rates, and of the speeds that restrain a posture; and
# by how much it may be exceeded
_PLANNED_OF_OTHERS = 0.985
_PLANNED, _MISSED = 0.999, 5e-3
_CORRECTIONS, _STEPS, _SLOWER = 3, 20, 1.002
# parts of a move with tighter limits each; and the smallest inverse of a largest scaling
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
    """Receiver of the progress of planning, which does not change the result."""

    progress: Progress | None

    def __content__(self) -> object:
        return None

    def __call__(self, fraction: float) -> None:
        if self.progress is not None:
            self.progress(fraction, "planning the fastest motion")


class FastestPlanner(MotionDemand):
    """Planner of the fastest motion of one robot along the manifold of one task."""

    def plan(self, finer: int = 1, progress: Progress | None = None) -> DrivePlan:
        """Return the plan of the fastest motion.

        Args:
            finer: Refinement of the grid, 1 for the default.
            progress: Receives the fraction done and the name of the step.

        Raises:
            InputError: If there is none.
        """
        try:
            return self._plan(finer, _Listener(progress))
        except InputError as error:
            raise InputError(f"reference.speed: fastest: {error}") from None

    @once_per_content()
    def _plan(self, finer: int, report: _Listener) -> DrivePlan:
        report(0.0)
        moves = self._first(straight_moves(self.motion, self.demand.derivatives + 1))
        tight = [np.ones((2, 2))] * len(moves)
        report(0.05)
        moves = self._faster(moves, _COARSE, tight, 0.0)
        report(0.25)
        fine = self._fine_spacing(moves) / finer
        moves = self._faster(moves, fine, tight, _WATCHED)
        checked = self._check(moves)
        for k in range(_CORRECTIONS):
            report(0.6 + 0.1 * k)
            if checked.limiting.largest.max() <= 1.0 + _MISSED:
                break
            tight = self._tighten(tight, moves, checked)
            moves = self._faster(moves, fine, tight, _WATCHED)
            checked = self._check(moves)
        for _ in range(_STEPS):
            if checked.limiting.largest.max() <= 1.0 + _MISSED:
                break
            moves = [move.slower(_SLOWER) for move in moves]
            checked = self._check(moves)
        return self._result(checked)

    @staticmethod
    def _fine_spacing(moves: list[Move]) -> float:
        """Return the final spacing of the knots [s]: smaller for short motions."""
        duration = sum(move.duration for move in moves)
        least, most = (duration / count for count in _KNOTS[::-1])
        return float(max(min(_FINE, max(most, _FINEST)), least))

    def _first(self, moves: list[Move]) -> list[Move]:
        """Return moves that are slowed down where they do not fit."""
        duration = sum(move.duration for move in moves)
        radius = getattr(self._task.shape, "smallest_radius", np.inf)
        samples = np.clip(duration / (_OF_RADIUS * radius), *_FIRST_SAMPLES)
        motion, begins = one_after_another(moves, 0.0)
        step, trajectory = self.trajectory_of(motion, duration / samples, still=True)
        self._require_strength(motion, step, trajectory)
        first = []
        for move, begin in zip(moves, begins, strict=True):
            window = slice(round(begin / step), round((begin + move.duration) / step) + 1)
            first.append(self._slow_down(move, step, trajectory[window]))
        return first

    def _require_strength(
        self, motion: PiecewisePolynomialCurve, step: float, trajectory: np.ndarray
    ) -> None:
        """Refuse a motion through postures that the drives cannot hold at rest."""
        n = self.robot.dimension
        share = np.abs(self.at_rest(trajectory))[:, :n] / self.limits[:n]
        i, axis = np.unravel_index(int(share.argmax()), share.shape)
        if share[i, axis] >= _ALL:
            eta = motion.derivatives(i * step, 0)[0]
            where = ", ".join(f"{value:.3g}" for value in eta)
            raise InputError(
                f"no motion fits: at rest at eta = {where} m axis {axis + 1} needs "
                f"{100.0 * share[i, axis]:.0f} % of its torque; allowed: less than "
                f"{100.0 * _ALL:g} %"
            )

    def _slow_down(self, move: Move, step: float, trajectory: np.ndarray) -> Move:
        """Return a move, scaled so that the drives can follow."""
        allowed, order = self.allowed(trajectory), self.demand.derivatives
        even = self._constant_scalings(trajectory, allowed)
        slowest = float(even.min())
        fast = min(float(even.max()), _SPREAD * slowest)
        powers = fast ** np.arange(trajectory.shape[1])
        duration, step = move.duration / fast, step / fast
        move = move.slower(1.0 / fast)
        try:
            scaling = find_scaling(
                self.demand, trajectory * powers[:, None], step, allowed, 1.0 / _DOUBLED, _SMOOTHING
            ).rates[:, 0]
        except InputError:
            scaling = np.full(len(trajectory), 0.9 * slowest / fast)
        time = float(np.sum(step / scaling))
        intervals = int(np.clip(min(time / _COARSE, len(trajectory) / 4), _FEWEST, _MOST))
        fitted = ScalingSpline.fit(duration, scaling, intervals, order + 1)
        return move.with_scaling(fitted, order, _COARSE / 2.0)

    def _constant_scalings(self, trajectory: np.ndarray, allowed: np.ndarray) -> np.ndarray:
        """Return the largest constant scaling within the allowed demand, shape (samples,)."""
        polynomials = self.demand.at_constant_rate(trajectory)
        fits = np.ones(len(trajectory), dtype=bool)
        even = np.full(len(trajectory), _SCALINGS[0])
        for scaling in _SCALINGS:
            powers = scaling ** np.arange(polynomials.shape[1])
            fits &= np.all(np.abs(np.einsum("k,skn->sn", powers, polynomials)) <= allowed, axis=1)
            even[fits] = scaling
        return even

    def _faster(
        self, moves: list[Move], spacing: float, tight: list[np.ndarray], watched: float
    ) -> list[Move]:
        """Return the fastest moves on grids of a spacing [s]."""
        motion, begins = one_after_another(moves, self._reference.dwell)
        longest = self._step(min(spacing / _SAMPLES, self._period))
        step, trajectory = self.trajectory_of(motion, longest, still=not self._has_posture)
        restraint_ratio, parts = self.restraint_ratio(motion, longest, trajectory), [trajectory]
        if self._has_posture:
            # another scaling does not change the motion that a posture adds
            parts.append(self.trajectory_without_posture(motion, longest, trajectory))
        known = np.concatenate([*parts, restraint_ratio[:, None]], axis=1)
        between = make_interp_spline(step * np.arange(len(trajectory)), known, k=3)
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
        """Return the fastest move on a grid.

        Args:
            move: The move so far.
            known: Over time, by rows, the joint trajectory, then the one without the posture task,
                if there is one, and its ratio to the speeds at which the task is restrained.
            begin: When the move begins [s].
            spacing: Between the knots of its speed scaling [s].
            tight: Planned shares of the allowed torques and of their rates, over even parts of the
                move, shape (parts, 2).
            watched: As for :func:`find_fastest_scaling`.
        """
        n, degree = self.robot.dimension, self.demand.derivatives + 1
        intervals = int(np.clip(move.duration / spacing, _FEWEST, _MOST))
        theta = np.linspace(0.0, move.duration, _SAMPLES * intervals + 1)
        rows, terms = known(begin + theta), self.demand.derivatives + 1
        trajectory, without_posture, restraint_ratio = (
            rows[:, :terms],
            rows[:, -1 - terms : -1],
            rows[:, -1],
        )
        polynomial = DemandPolynomial.of(self.demand, without_posture, _SMOOTHING)
        if self._has_posture:
            by_posture = self.demand.of(trajectory) - self.demand.of(without_posture)
            polynomial = polynomial.plus(by_posture[:, :n])
        allowed = _PLANNED * self.allowed(trajectory)
        state = move.progress.derivatives(theta, 1)[:, :, 0]
        part = _along(state[:, 0] / state[-1, 0], tight)
        speed = np.max(np.abs(trajectory[:, 1]) / allowed[:, n:], axis=1)
        speed = np.maximum(speed, restraint_ratio.max(axis=1) / _PLANNED_OF_OTHERS)
        speed = np.maximum(speed, state[:, 1] / (_PLANNED * self._velocity))
        limits = ScalingLimits(
            allowed[:, :n] * part[:, :1],
            _PLANNED_OF_OTHERS * self._rates * part[:, 1:],
            1.0 / np.maximum(speed, _STILL),
        )
        found = find_fastest_scaling(polynomial, theta, limits, intervals, degree, watched)
        return move.with_scaling(found.scaling, self.demand.derivatives, spacing / 2.0)

    def _check(self, moves: list[Move]) -> _Checked:
        """Return the demand of the moves on samples between the planned ones."""
        motion, begins = one_after_another(moves, self._reference.dwell)
        longest = self._step(_FINE / _CHECKED)
        step, trajectory = self.trajectory_of(motion, longest, still=not self._has_posture)
        times = step * np.arange(len(trajectory))
        demand = self.demand.of(trajectory)
        speed = np.abs(motion.derivatives(times, 1)[:, 1]).max(axis=1)
        ticks = max(1, round(self._period / step))
        tick = ticks, ticks * step
        limiting = Limiting.of(
            demand,
            self.allowed(trajectory),
            tick,
            self._rates,
            speed / self._velocity,
            self.restraint_ratio(motion, longest, trajectory),
        )
        return _Checked(motion, begins, times, demand, limiting, trajectory[:, 0])

    def _tighten(
        self, tight: list[np.ndarray], moves: list[Move], checked: _Checked
    ) -> list[np.ndarray]:
        """Return tighter shares of the allowed torques, where they were exceeded."""
        n, tighter = self.robot.dimension, []
        shares = checked.limiting.shares
        kinds = shares[:, :n].max(axis=1), shares[:, 2 * n : 3 * n].max(axis=1)
        excess = maximum_filter1d(np.stack(kinds, axis=1), 2 * _CHECKED + 1, axis=0)
        parts = np.linspace(0.0, 1.0, _PARTS)
        for move, begin, old in zip(moves, checked.begins, tight, strict=True):
            inside = (checked.times >= begin) & (checked.times <= begin + move.duration)
            along = move.progress.derivatives(checked.times[inside] - begin, 0)[:, 0, 0]
            at = np.searchsorted(along, parts * along[-1]).clip(0, len(along) - 1)
            tighter.append(_along(parts, old) / np.maximum(excess[inside][at], 1.0))
        return tighter

    def _step(self, longest: float) -> float:
        """Return the largest step between samples [s]."""
        # a posture moves as fast as a sampled law lets it
        return self._period if self._has_posture else longest

    @property
    def _has_posture(self) -> bool:
        """Whether a posture task moves the redundant joints."""
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
        velocity = self._reference.velocity
        return np.inf if velocity is None else velocity

    def _result(self, checked: _Checked) -> DrivePlan:
        ones = np.ones(len(checked.times))
        messages = self.beyond_limits(checked.motion, float(checked.times[1]), checked.postures)
        largest = checked.limiting.largest.max()
        if largest > 1.0 + _MISSED:
            messages.append(
                f"the fastest motion found takes {100.0 * largest:.1f} % of the allowed demand "
                "on the drives"
            )
        moves = self._posture.reference_deg or self._posture.is_pulled
        if self._has_posture and moves:
            messages.append(
                "controller.posture moves the joints while the tool moves; the fastest motion is "
                "planned for a constant posture, and may need more of the drives"
            )
        return DrivePlan(
            checked.times,
            checked.demand,
            checked.demand,
            self.limits,
            ones,
            checked.motion,
            messages,
            checked.limiting,
        )


def _along(parts: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Return values of a table over even parts, interpolated at parts, shape (parts, columns)."""
    even = np.linspace(0.0, 1.0, len(table))
    return np.stack([np.interp(parts, even, column) for column in table.T], axis=1)
