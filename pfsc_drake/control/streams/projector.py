"""Projection of the tool onto a growing path."""

import math
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, is_finite, where
from pfsc_drake.control.streams.growing_path import POSE, GrowingPath, pick
from pfsc_drake.geometry import ProjectionStatus
from pfsc_drake.geometry.closest_point import GOES_ON, MINIMUM, step_function
from pfsc_drake.geometry.manifold_point import PathPointLayout, alpha_function

# Newton steps from the last projection, more than the motion of a tick needs
_STEPS = 6
_LONGEST_STEP = 1.0 / 32.0  # share of all spans
_STALLED = 1e-8
# m: below it a step has no direction
_NEAR = 1e-7
_UPWARDS, _STEEP = (0.0, 0.0, 1.0), 0.9


class StreamedProjector(Block):
    """Orthogonal projection onto a growing path, with the path's properties for the control law.

    It is the counterpart of :class:`~pfsc_drake.control.manifolds.manifold.Projector` for a
    :class:`GrowingPath`: Newton's iteration (3.72) from the last projection, and the arc length by
    a quadrature within a span. The normal vector is transported in parallel (3.4) from tick to tick
    by double reflection, with an error of fifth order in the angle between two ticks; where a piece
    begins it is rotated with the tangent.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,).
        path (input): The path, laid out by :class:`GrowingPath`.
        manifold_point (output): Closest point of the path, laid out by ``layout``.

    State:
        projection: Parameter of the last projection, shape (1,); unchanged while it fails.
        frame: ``[piece, sigma, e_par, e_perp]`` there, shape (10,). They start at the begin of the
            piece, and are unchanged while the projection fails.

    Args:
        path: Layout of the path.
        normal: Direction of ``e_perp`` at the begin, made normal to the path, shape (3,); upwards
            if omitted, or along x where the path is steep.

    Attributes:
        layout: Layout of the manifold point.
    """

    def __init__(self, path: GrowingPath, normal: ArrayLike | None = None) -> None:
        self._path, self._normal = path, normal
        self.layout = PathPointLayout(path.order, path.dimension == POSE)
        self.inputs = {"tool_pose": Port(12, "m, 1"), "path": Port(path.size)}
        self.outputs = {"manifold_point": Port(self.layout.size)}
        self.states = {"projection": 1, "frame": 10}
        self.inner = {"next_theta": 1, "next_frame": 10}
        domain = [(0.0, float(path.spans))]
        self._step = step_function(domain, [False], _LONGEST_STEP)
        self._point = path.spline.point_function(path.dimension, path.order + 1)
        self._terms = path.spline.point_function(3, 2)

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        known = self._path.split(u.path)
        theta = self._find(known, u.tool_pose[:3], known["root"] - known["first"])[0]
        sigma, slope = ca.vertsplit(self._evaluate(known, theta)[0][:6], 3)
        e_par = slope / ca.norm_2(slope)
        if self._normal is None:
            upwards = ca.DM(_UPWARDS)
            steep = ca.fabs(ca.dot(e_par, upwards)) > _STEEP
            direction = where(steep, ca.DM([1.0, 0.0, 0.0]), upwards)
        else:
            direction = ca.DM(np.asarray(self._normal, dtype=float))
        frame = ca.vertcat(known["piece"], sigma, e_par, _across(direction, e_par))
        return {"projection": known["first"] + theta, "frame": frame}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        layout, known, y = self.layout, self._path.split(u.path), u.tool_pose[:3]
        is_new_piece = x.frame[0] != known["piece"]
        guess = where(is_new_piece, known["root"], x.projection) - known["first"]
        theta, state = self._find(known, y, guess)
        derivatives, span, part = self._evaluate(known, theta)
        r, d = layout.order, self._path.dimension
        rows = ca.vertsplit(derivatives, d)
        position = ca.vertcat(*[row[:3] for row in rows])
        sigma, slope = position[:3], position[3:6]
        own = self._path.span_points(known["points"], span, position_only=True)
        eta = pick(known["eta"], span) + self._path.spline.length(own, part)
        alpha = alpha_function(1)(y, ca.reshape(position[:9], 3, 3))
        e_par = slope / ca.norm_2(slope)
        begin, tangent, last = ca.vertsplit(x.frame[1:], 3)
        normal = _transport(begin, tangent, last, sigma, e_par)
        least, _, beyond, ended = ca.vertsplit(state[3:])
        found = where(
            ended == GOES_ON, ca.fabs(state[2]) < _STALLED * self._path.spans, ended == MINIMUM
        )
        good = ca.logic_and(is_finite(least), found)
        status = where(
            good,
            where(beyond, float(ProjectionStatus.BEYOND_END), float(ProjectionStatus.OK)),
            float(ProjectionStatus.NOT_CONVERGED),
        )
        turned = [row[3:] for row in rows[: r + 1]] if layout.oriented else []
        theta = known["first"] + theta
        point = ca.vertcat(eta, alpha, status, normal, position, *turned)
        point = where(is_finite(least), ca.vertcat(theta, point), math.nan)
        point = ca.vertcat(point[:3], status, point[4:])
        frame = ca.vertcat(known["piece"], sigma, e_par, normal)
        is_known = all_finite(theta, frame)
        return {
            "manifold_point": point,
            "next_theta": where(is_known, theta, x.projection),
            "next_frame": where(is_known, frame, x.frame),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"projection": y.next_theta, "frame": y.next_frame}

    def _span(self, theta: Any) -> tuple[Any, Any]:
        """Return the number of the span at a parameter, and the parameter within it."""
        span = ca.fmin(ca.fmax(ca.floor(theta), 0.0), self._path.spans - 1.0)
        # NaN belongs to the first span
        span = where(is_finite(theta), span, 0.0)
        return span, theta - span

    def _evaluate(self, known: dict[str, Any], theta: Any) -> tuple[Any, Any, Any]:
        """Return the derivatives at a parameter, its span, and the parameter within it."""
        span, part = self._span(theta)
        return self._point(self._path.span_points(known["points"], span), part), span, part

    def _find(self, known: dict[str, Any], y: Any, guess: Any) -> tuple[Any, Any]:
        """Return the parameter of the closest point near a guess, and the final iteration state."""
        begin = ca.fmin(ca.fmax(guess, 0.0), float(self._path.spans))
        begin = where(is_finite(guess), begin, math.nan)
        state = ca.vertcat(begin, begin, 0.0, math.inf, math.nan, 0.0, GOES_ON)
        for _ in range(_STEPS):
            span, part = self._span(state[0])
            own = self._path.span_points(known["points"], span, position_only=True)
            terms = ca.reshape(self._terms(own, part), 3, 3)
            state = self._step(state, y, terms)
        return state[0], state


def _across(direction: Any, e_par: Any) -> Any:
    """Return the unit vector normal to a tangent that is closest to a direction."""
    rest = direction - ca.dot(direction, e_par) * e_par
    return rest / ca.norm_2(rest)


def _transport(begin: Any, tangent: Any, normal: Any, end: Any, e_par: Any) -> Any:
    """Return the normal vector at the end of a step, by double reflection.

    Args:
        begin: Begin of the step [m], shape (3,).
        tangent: ``e_par`` at the begin.
        normal: ``e_perp`` at the begin.
        end: End of the step [m].
        e_par: ``e_par`` at the end.
    """
    step = end - begin
    square = ca.dot(step, step)
    safe = where(square > 0.0, square, 1.0)
    mirrored = normal - 2.0 / safe * ca.dot(step, normal) * step
    along = tangent - 2.0 / safe * ca.dot(step, tangent) * step
    second = e_par - along
    size = ca.dot(second, second)
    twice = mirrored - 2.0 / where(size > 0.0, size, 1.0) * ca.dot(second, mirrored) * second
    # without a step: the shortest rotation from tangent to tangent
    both = 1.0 + ca.dot(tangent, e_par)
    turned = normal - ca.dot(normal, e_par) / where(both > _NEAR, both, 1.0) * (tangent + e_par)
    turned = where(both > _NEAR, turned, normal)
    return _across(where(square > _NEAR**2, twice, turned), e_par)
