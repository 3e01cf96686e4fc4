"""What a path tells the controller at each tick."""

import math
from functools import cached_property

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation_curve import OrientationCurve
from pfsc_drake.geometry.curves.polynomial import PieceTable
from pfsc_drake.geometry.foot import FootFinder
from pfsc_drake.geometry.manifold_point import ManifoldEvaluator, PathPointLayout, alpha_function
from pfsc_drake.geometry.nearest_samples import nearest_samples
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.frame import Frame
from pfsc_drake.geometry.paths.table import Continuation, PathTable, continuations, tabulate

# Of the domain.
_LONGEST_STEP = 1.0 / 32.0
# Of the normal in a lap, rad: the holonomy of a plane curve is a rounding error.
_NO_TURN = 1e-14
# For the first search.
_FEWEST_SAMPLES, _SAMPLES_PER_SEGMENT = 256, 16
_VALLEY = 1.0 / 16.0
# of a lap
_ROUNDING = 1e-9


class PathEvaluator(ManifoldEvaluator[PathPointLayout]):
    """Projects a point on a path and evaluates everything a law of one order needs there.

    All quantities of the path point are polynomials on the pieces of one table. The foot is found
    by `FootFinder` on the table's position; an open path goes on beyond its ends, see
    `paths.table`. Its memory is the parameter. `Path.evaluator` makes it.

    Args:
        position: Curve sigma_t in R^3.
        orientation: Curve of quaternions, or None.
        arc_length: Arc length of `position`.
        frame: Frame along `position`.
        order: Relative degree r of the law.
    """

    def __init__(
        self,
        position: Curve,
        orientation: OrientationCurve | None,
        arc_length: ArcLength,
        frame: Frame,
        order: int,
    ) -> None:
        layout = PathPointLayout(order, orientation is not None, frame.turns)
        made_of = position, orientation, arc_length, frame, order
        super().__init__(layout, [position.domain], [position.closed], *made_of)
        table = _whole_table(position, orientation, arc_length, frame, self.layout)
        self._table = PieceTable(table.breakpoints, table.rows)
        # Of the table, which may be one or two laps long.
        self._begin, self._end = float(table.breakpoints[0]), float(table.breakpoints[-1])
        laps = round((self._end - self._begin) / position.period)
        self._length, self._turn = laps * arc_length.length, laps * frame.holonomy
        self._position = position
        self._finder = FootFinder(
            self._position_terms, [(self._begin, self._end)], [position.closed], _LONGEST_STEP
        )

    def _nearest(self, y: ca.MX) -> ca.MX:
        """Parameter of the nearest point of the whole path, on the first lap if closed."""
        apart = np.array([_VALLEY * self._position.period])
        starts = nearest_samples(y, *_samples(self._position), apart)
        nearest = self._finder.nearest(y, starts)
        if self._position.closed:
            begin, period = self._position.domain[0], self._position.period
            # the beginning is not the end of the lap before
            nearest -= period * ca.floor((nearest - begin) / period + _ROUNDING)
        return nearest

    def evaluate_at(self, theta: float) -> np.ndarray:
        """Return the path point at a point on the path, for set-up.

        Args:
            theta: Unwrapped parameter.

        Returns:
            New array [layout.size], with alpha zero.

        Raises:
            InputError: theta is not finite or lies outside the domain of an open path.
        """
        begin, end = self._position.domain
        if not math.isfinite(theta) or (not self._position.closed and not begin <= theta <= end):
            raise InputError(f"theta: {theta:.9g}; the path is defined on [{begin:.9g}, {end:.9g}]")
        function = self._bound_at
        function.arguments["memory"][0] = theta
        function.evaluate()
        return function.results["manifold_point"].copy()

    @cached_property
    def _bound_at(self) -> BoundFunction:
        return BoundFunction(self.at)

    def _wrapped(self, theta: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Parameter within the table, and the number of the table's lap."""
        if not self._position.closed:
            return theta, ca.MX(0.0)
        period = self._end - self._begin
        laps = ca.floor((theta - self._begin) / period)
        return theta - laps * period, laps

    def _position_terms(self, theta: ca.MX) -> ca.MX:
        """sigma_t and its first two derivatives as columns."""
        values = self._table(self._wrapped(theta)[0], self.layout.position.start, 9)
        return ca.reshape(values, 3, 3)

    def _on(self, theta: ca.MX) -> ca.MX:
        """Path point at an unwrapped parameter, with alpha zero and status OK."""
        wrapped, laps = self._wrapped(theta)
        point = self._table(wrapped)
        if not self._position.closed:
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
        point = self._on(foot.theta)
        terms = ca.reshape(point[self.layout.position][:9], 3, 3)
        alpha = alpha_function(1)(y, terms)
        if not self._position.closed:
            point = ca.if_else(foot.beyond_end, self._straight_on(point, y), point)
        alpha = ca.if_else(foot.beyond_end, 0.0, alpha)
        return self._told(ca.vertcat(point[:2], alpha, point[4:]), foot, foot.known)

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
