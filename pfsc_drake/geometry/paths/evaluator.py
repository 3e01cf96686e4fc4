"""What a path tells the controller at each tick."""

import math
from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation import OrientationCurve
from pfsc_drake.geometry.curves.polynomial import PieceTable
from pfsc_drake.geometry.foot import FootFinder
from pfsc_drake.geometry.nearest import ProjectionStatus, nearest_samples
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.frame import Frame
from pfsc_drake.geometry.paths.table import Continuation, PathTable, continuations, tabulate
from pfsc_drake.geometry.point import PathPointLayout

# Of the domain.
_LONGEST_STEP = 1.0 / 32.0
# Of the normal in a lap, rad: the holonomy of a plane curve is a rounding error.
_NO_TURN = 1e-14
# For the first search.
_FEWEST_SAMPLES, _SAMPLES_PER_SEGMENT = 256, 16
_VALLEY = 1.0 / 16.0
# of a lap
_ROUNDING = 1e-9


class PathEvaluator:
    """Projects a point on a path and evaluates everything a law of one order needs there.

    All quantities of the path point are polynomials on the pieces of one table. The foot is found
    by `FootFinder` on the table's position; an open path goes on beyond its ends, see
    `paths.run_out`. There is no memory: the same input gives the same output.

    Calling the object evaluates ``evaluate``. `Path.evaluator` makes it.

    Args:
        position: Curve sigma_t in R^3.
        orientation: Curve of quaternions, or None.
        arc_length: Arc length of `position`.
        frame: Frame along `position`.
        order: Relative degree r of the law.

    Attributes:
        layout: Where the quantities lie in the path point.
        evaluate: ``(y_t, memory) -> manifold_point``, the path next to a point [m], shape (3,);
            memory is the unwrapped parameter of the last tick. All values but ``status`` are NaN if
            either is not finite.
        at: ``memory -> manifold_point``, the path at an unwrapped parameter, with alpha zero.
    """

    def __init__(
        self,
        position: Curve,
        orientation: OrientationCurve | None,
        arc_length: ArcLength,
        frame: Frame,
        order: int,
    ) -> None:
        self._made_of = position, orientation, arc_length, frame, order
        self.layout = PathPointLayout(order, orientation is not None, frame.turns)
        table = _whole_table(position, orientation, arc_length, frame, self.layout)
        self._table = PieceTable(table.breakpoints, table.rows)
        self._domain, self._closed = position.domain, position.closed
        # Of the table, which may be one or two laps long.
        self._begin, self._end = float(table.breakpoints[0]), float(table.breakpoints[-1])
        laps = round((self._end - self._begin) / position.period)
        self._length, self._turn = laps * arc_length.length, laps * frame.holonomy
        self._position = position
        self._finder = FootFinder(
            self._position_terms, [(self._begin, self._end)], [position.closed], _LONGEST_STEP
        )
        self.evaluate, self.at = self._functions()

    def __content__(self) -> object:
        """Return what decides over it."""
        return self._made_of

    @once_per_content()
    def _functions(self) -> tuple[ca.Function, ca.Function]:
        """Return :attr:`evaluate` and :attr:`at`."""
        y, theta = ca.MX.sym("y_t", 3), ca.MX.sym("memory")
        evaluate = ca.Function(
            "path_point",
            [y, theta],
            [self._at_foot(y, theta)],
            ["y_t", "memory"],
            ["manifold_point"],
        )
        at = ca.Function("path_at", [theta], [self._on_path(theta)], ["memory"], ["manifold_point"])
        return evaluate, at

    @cached_property
    def find(self) -> ca.Function:
        """``y_t -> memory``, the nearest point of the whole path, on the first lap if closed."""
        return self._find_function()

    @once_per_content()
    def _find_function(self) -> ca.Function:
        y, apart = ca.MX.sym("y_t", 3), np.array([_VALLEY * self._position.period])
        starts = nearest_samples(y, *_samples(self._position), apart)
        nearest = self._finder.nearest(y, starts)
        if self._closed:
            (begin, _), period = self._domain, self._position.period
            # the beginning is not the end of the lap before
            nearest -= period * ca.floor((nearest - begin) / period + _ROUNDING)
        return ca.Function("path_place", [y], [nearest], ["y_t"], ["memory"])

    def __call__(self, point: Sequence[float], theta_guess: float) -> np.ndarray:
        """Return the path point next to a point, new array [layout.size].

        Args:
            point: y_t, [3], m.
            theta_guess: Unwrapped parameter of the last tick.
        """
        function = self._bound_evaluate
        function.arguments["y_t"][:] = point
        function.arguments["memory"][0] = theta_guess
        function.evaluate()
        return function.results["manifold_point"].copy()

    def evaluate_at(self, theta: float) -> np.ndarray:
        """Return the path point at a point on the path, for set-up.

        Args:
            theta: Unwrapped parameter.

        Returns:
            New array [layout.size], with alpha zero.

        Raises:
            InputError: theta is not finite or lies outside the domain of an open path.
        """
        begin, end = self._domain
        if not math.isfinite(theta) or (not self._closed and not begin <= theta <= end):
            raise InputError(f"theta: {theta:.9g}; the path is defined on [{begin:.9g}, {end:.9g}]")
        function = self._bound_at
        function.arguments["memory"][0] = theta
        function.evaluate()
        return function.results["manifold_point"].copy()

    @cached_property
    def _bound_evaluate(self) -> BoundFunction:
        return BoundFunction(self.evaluate)

    @cached_property
    def _bound_at(self) -> BoundFunction:
        return BoundFunction(self.at)

    def _wrapped(self, theta: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Parameter within the table, and the number of the table's lap."""
        if not self._closed:
            return theta, ca.MX(0.0)
        period = self._end - self._begin
        laps = ca.floor((theta - self._begin) / period)
        return theta - laps * period, laps

    def _position_terms(self, theta: ca.MX) -> ca.MX:
        """sigma_t and its first two derivatives as columns."""
        values = self._table(self._wrapped(theta)[0], self.layout.position.start, 9)
        return ca.reshape(values, 3, 3)

    def _on_path(self, theta: ca.MX) -> ca.MX:
        """Path point at an unwrapped parameter, with alpha zero and status OK."""
        wrapped, laps = self._wrapped(theta)
        point = self._table(wrapped)
        if not self._closed:
            return ca.vertcat(theta, point[1:])
        normal = point[self.layout.normal]
        if abs(self._turn) > _NO_TURN:
            slope = point[self.layout.position][3:6]
            normal = _turn_function()(normal, slope, laps * self._turn)
        eta = point[self.layout.eta] + laps * self._length
        return ca.vertcat(theta, eta, point[2:4], normal, point[self.layout.normal.stop :])

    def _at_foot(self, y: ca.MX, guess: ca.MX) -> ca.MX:
        """Path point at the foot of a point."""
        foot = self._finder.find(y, guess)
        point = self._on_path(foot.theta)
        terms = ca.reshape(point[self.layout.position][:9], 3, 3)
        alpha = _bend_function()(y, terms)
        begin, end = self._domain
        beyond = ca.MX(0.0)
        if not self._closed:
            beyond = ca.logic_or(foot.theta < begin, foot.theta > end)
            beyond = ca.logic_or(beyond, foot.beyond_end)
            point = ca.if_else(foot.beyond_end, self._straight_on(point, y), point)
        status = ca.if_else(
            foot.converged,
            ca.if_else(beyond, float(ProjectionStatus.BEYOND_END), float(ProjectionStatus.OK)),
            float(ProjectionStatus.NOT_CONVERGED),
        )
        alpha = ca.if_else(foot.beyond_end, 0.0, alpha)
        # What is not finite has no foot.
        place = ca.if_else(foot.known, ca.vertcat(point[:2], alpha, point[4:]), math.nan)
        return ca.vertcat(place[:3], status, place[3:])

    def _straight_on(self, point: ca.MX, y: ca.MX) -> ca.MX:
        """Path point beyond the last end: eta goes on along the tangent, the rest stays."""
        sigma, slope = ca.vertsplit(point[self.layout.position][:6], 3)
        along = ca.dot(y - sigma, slope) / ca.norm_2(slope)
        kept = np.ones(self.layout.size)
        kept[self.layout.position][6:] = 0.0
        kept[self.layout.quaternion][4:] = 0.0
        kept[self.layout.turn] = 0.0
        still = point * kept
        return ca.vertcat(still[0], still[1] + along, still[2:])


@once_per_content()
def _whole_table(
    position: Curve,
    orientation: OrientationCurve | None,
    arc_length: ArcLength,
    frame: Frame,
    layout: PathPointLayout,
) -> PathTable:
    """Return the table of a path, and of what an open one goes on to at its ends."""
    table = tabulate(position, orientation, arc_length, frame, layout)
    if not position.closed:
        before, after = continuations(position, orientation, arc_length, frame, layout.order)
        table = _extended(before, table, after, layout)
    return table


def _samples(position: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Parameters, [n, 1], and points [n, 3] of a path, for the first search."""
    count = max(_FEWEST_SAMPLES, _SAMPLES_PER_SEGMENT * (len(position.breakpoints) - 1))
    theta = np.linspace(*position.domain, count, endpoint=not position.closed)
    return theta[:, None], position.derivatives(theta, 0)[:, 0]


def _bend_function() -> ca.Function:
    """``(y, terms) -> alpha`` (3.9)."""
    y, terms = ca.SX.sym("y", 3), ca.SX.sym("terms", 3, 3)
    sigma, slope, bend = ca.horzsplit(terms)
    alpha = ca.dot(y - sigma, bend) / ca.dot(slope, slope)
    return ca.Function("alpha", [y, terms], [alpha])


def _turn_function() -> ca.Function:
    """``(normal, slope, angle) -> normal`` turned about the tangent, which it is normal to."""
    normal, slope, angle = ca.SX.sym("normal", 3), ca.SX.sym("slope", 3), ca.SX.sym("angle")
    across = ca.cross(slope, normal) / ca.norm_2(slope)
    turned = ca.cos(angle) * normal + ca.sin(angle) * across
    return ca.Function("turn_of_laps", [normal, slope, angle], [turned])


def _extended(
    before: Continuation, table: PathTable, after: Continuation, layout: PathPointLayout
) -> PathTable:
    """Table of a path with what is beyond its ends."""
    tables = []
    for part in (before, after):
        own = tabulate(part.position, part.orientation, part.arc_length, part.frame, layout)
        own.rows[:, layout.eta, 0] += part.eta
        tables.append(own)
    joined = [tables[0], table, tables[1]]
    breakpoints = [part.breakpoints[:-1] for part in joined]
    return PathTable(
        np.concatenate([*breakpoints, tables[1].breakpoints[-1:]]),
        np.concatenate([part.rows for part in joined]),
    )
