"""Projection onto a path and its quantities there, at each tick."""

import math
from functools import cached_property

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.closest_point import ClosestPointFinder
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation_curve import OrientationCurve
from pfsc_drake.geometry.curves.polynomial import PieceTable
from pfsc_drake.geometry.manifold_point import ManifoldEvaluator, PathPointLayout, alpha_function
from pfsc_drake.geometry.nearest_samples import nearest_samples
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.frame import Frame
from pfsc_drake.geometry.paths.table import Continuation, PathTable, continuations, tabulate

# Of the domain.
_LONGEST_STEP = 1.0 / 32.0
# Of the normal in a revolution, rad: the holonomy of a plane curve is a rounding error.
_NO_TURN = 1e-14
# For the first search.
_FEWEST_SAMPLES, _SAMPLES_PER_SEGMENT = 256, 16
_VALLEY = 1.0 / 16.0
# of a revolution
_ROUNDING = 1e-9


class PathEvaluator(ManifoldEvaluator[PathPointLayout]):
    """Projection of a point onto a path, and all quantities there that a law of one order needs.

    All quantities of the path point are polynomials on the pieces of one table, on whose position
    `ClosestPointFinder` finds the projection. An open path is extended beyond its ends, see
    `paths.table`. The memory is the parameter. `Path.evaluator` creates it.

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
        sources = position, orientation, arc_length, frame, order
        super().__init__(layout, [position.domain], [position.closed], *sources)
        table = _whole_table(position, orientation, arc_length, frame, self.layout)
        self._table = PieceTable(table.breakpoints, table.rows)
        # Of the table, which may be one or two revolutions long.
        self._begin, self._end = float(table.breakpoints[0]), float(table.breakpoints[-1])
        revolutions = round((self._end - self._begin) / position.period)
        self._length, self._turn = revolutions * arc_length.length, revolutions * frame.holonomy
        self._position = position
        self._finder = ClosestPointFinder(
            self._position_terms, [(self._begin, self._end)], [position.closed], _LONGEST_STEP
        )

    def _nearest(self, y: ca.MX) -> ca.MX:
        """Return the parameter of the whole path's closest point, in the first period if closed."""
        apart = np.array([_VALLEY * self._position.period])
        starts = nearest_samples(y, *_samples(self._position), apart)
        nearest = self._finder.nearest(y, starts)
        if self._position.closed:
            begin, period = self._position.domain[0], self._position.period
            # the beginning is not the end of the revolution before
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

    def _wrap(self, theta: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Return the parameter within the table, and the number of the table's period."""
        if not self._position.closed:
            return theta, ca.MX(0.0)
        period = self._end - self._begin
        revolutions = ca.floor((theta - self._begin) / period)
        return theta - revolutions * period, revolutions

    def _position_terms(self, theta: ca.MX) -> ca.MX:
        """Return sigma_t and its first two derivatives as columns."""
        values = self._table(self._wrap(theta)[0], self.layout.position.start, 9)
        return ca.reshape(values, 3, 3)

    def _on(self, theta: ca.MX) -> ca.MX:
        """Return the path point at an unwrapped parameter, with alpha zero and status OK."""
        wrapped, revolutions = self._wrap(theta)
        point = self._table(wrapped)
        if not self._position.closed:
            return ca.vertcat(theta, point[1:])
        normal = point[self.layout.normal]
        if abs(self._turn) > _NO_TURN:
            slope = point[self.layout.position][3:6]
            normal = _turn_function()(normal, slope, revolutions * self._turn)
        eta = point[self.layout.eta] + revolutions * self._length
        return ca.vertcat(theta, eta, point[2:4], normal, point[self.layout.normal.stop :])

    def _at_closest(self, y: ca.MX, guess: ca.MX) -> ca.MX:
        """Return the path point at the closest point to y."""
        closest_point = self._finder.find(y, guess)
        point = self._on(closest_point.theta)
        terms = ca.reshape(point[self.layout.position][:9], 3, 3)
        alpha = alpha_function(1)(y, terms)
        if not self._position.closed:
            point = ca.if_else(closest_point.beyond_end, self._straight_on(point, y), point)
        alpha = ca.if_else(closest_point.beyond_end, 0.0, alpha)
        return self._with_status(
            ca.vertcat(point[:2], alpha, point[4:]), closest_point, closest_point.known
        )

    def _straight_on(self, point: ca.MX, y: ca.MX) -> ca.MX:
        """Return the path point beyond an end: eta grows along the tangent, the rest is fixed."""
        sigma, slope = ca.vertsplit(point[self.layout.position][:6], 3)
        along = ca.dot(y - sigma, slope) / ca.norm_2(slope)
        mask = np.ones(self.layout.size)
        mask[self.layout.position][6:] = 0.0
        mask[self.layout.quaternion][4:] = 0.0
        mask[self.layout.turn] = 0.0
        still = point * mask
        return ca.vertcat(still[0], still[1] + along, still[2:])


@once_per_content()
def _whole_table(
    position: Curve,
    orientation: OrientationCurve | None,
    arc_length: ArcLength,
    frame: Frame,
    layout: PathPointLayout,
) -> PathTable:
    """Return the table of a path, including the continuations of an open one."""
    table = tabulate(position, orientation, arc_length, frame, layout)
    if not position.closed:
        before, after = continuations(position, orientation, arc_length, frame, layout.order)
        table = _extend(before, table, after, layout)
    return table


def _samples(position: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters, [n, 1], and points [n, 3] of a path, for the first search."""
    count = max(_FEWEST_SAMPLES, _SAMPLES_PER_SEGMENT * (len(position.breakpoints) - 1))
    theta = np.linspace(*position.domain, count, endpoint=not position.closed)
    return theta[:, None], position.derivatives(theta, 0)[:, 0]


def _turn_function() -> ca.Function:
    """Return ``(normal, slope, angle) -> normal``, turned about the tangent."""
    normal, slope, angle = ca.SX.sym("normal", 3), ca.SX.sym("slope", 3), ca.SX.sym("angle")
    across = ca.cross(slope, normal) / ca.norm_2(slope)
    turned = ca.cos(angle) * normal + ca.sin(angle) * across
    return ca.Function("turn_of_laps", [normal, slope, angle], [turned])


def _extend(
    before: Continuation, table: PathTable, after: Continuation, layout: PathPointLayout
) -> PathTable:
    """Return the table of a path with the continuations beyond its ends."""
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
