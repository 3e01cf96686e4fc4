"""Where on a path that is still growing the tool is."""

import math
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, is_finite, where
from pfsc_drake.control.streams.stream_course import POSE, Course, picked
from pfsc_drake.geometry import ProjectionStatus
from pfsc_drake.geometry.foot import GOES_ON, MINIMUM, step_function
from pfsc_drake.geometry.manifold_point import PathPointLayout, alpha_function

# steps from the last place on, which is more than the way of a tick needs
_STEPS = 6
_LONGEST_STEP = 1.0 / 32.0  # of all spans
_STALLED = 1e-8
# m, below which a step has no direction
_NEAR = 1e-7
_UPWARDS, _STEEP = (0.0, 0.0, 1.0), 0.9


class StreamedProjector(Block):
    """Orthogonal projection onto a path that grows, and all that a law needs to know of it there.

    It is the counterpart of :class:`~pfsc_drake.control.manifolds.manifold.Projector` for a
    :class:`Course`: Newton's iteration (3.72) from the last foot on, and the arc length by a
    quadrature within a span. The normal vector is transported in parallel (3.4) from tick to tick
    by double reflection, whose error is of the fifth order of the angle between two ticks; where a
    piece begins it is turned with the tangent.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,).
        course (input): Laid out by :class:`Course`.
        manifold_point (output): The path next to the tool, laid out by ``layout``.

    State:
        place: theta of the last foot. foot: ``[piece, sigma, e_par, e_perp]`` there, shape (10,).
        They start at the begin of the piece, and stay as they are while the tool is nowhere.

    Args:
        course: What is known of the path.
        normal: Direction of ``e_perp`` at the begin, made normal to the path, shape (3,); upwards
            if omitted, or along x where the path is steep.

    Attributes:
        layout: Layout of the manifold's point.
    """

    def __init__(self, course: Course, normal: ArrayLike | None = None) -> None:
        self._course, self._normal = course, normal
        self.layout = PathPointLayout(course.order, course.dimension == POSE)
        self.inputs = {"tool_pose": Port(12, "m, 1"), "course": Port(course.size)}
        self.outputs = {"manifold_point": Port(self.layout.size)}
        self.states = {"place": 1, "foot": 10}
        self.inner = {"next_place": 1, "next_foot": 10}
        domain = [(0.0, float(course.spans))]
        self._step = step_function(domain, [False], _LONGEST_STEP)
        self._point = course.spline.point_function(course.dimension, course.order + 1)
        self._terms = course.spline.point_function(3, 2)

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        known = self._course.split(u.course)
        theta = self._found(known, u.tool_pose[:3], known["root"] - known["first"])[0]
        sigma, slope = ca.vertsplit(self._on(known, theta)[0][:6], 3)
        e_par = slope / ca.norm_2(slope)
        if self._normal is None:
            upwards = ca.DM(_UPWARDS)
            steep = ca.fabs(ca.dot(e_par, upwards)) > _STEEP
            direction = where(steep, ca.DM([1.0, 0.0, 0.0]), upwards)
        else:
            direction = ca.DM(np.asarray(self._normal, dtype=float))
        foot = ca.vertcat(known["piece"], sigma, e_par, _across(direction, e_par))
        return {"place": known["first"] + theta, "foot": foot}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        layout, known, y = self.layout, self._course.split(u.course), u.tool_pose[:3]
        begun = x.foot[0] != known["piece"]
        guess = where(begun, known["root"], x.place) - known["first"]
        theta, state = self._found(known, y, guess)
        derivatives, span, part = self._on(known, theta)
        r, d = layout.order, self._course.dimension
        rows = ca.vertsplit(derivatives, d)
        position = ca.vertcat(*[row[:3] for row in rows])
        sigma, slope = position[:3], position[3:6]
        own = self._course.of_span(known["points"], span, position_only=True)
        eta = picked(known["eta"], span) + self._course.spline.length(own, part)
        alpha = alpha_function(1)(y, ca.reshape(position[:9], 3, 3))
        e_par = slope / ca.norm_2(slope)
        begin, tangent, last = ca.vertsplit(x.foot[1:], 3)
        normal = _transported(begin, tangent, last, sigma, e_par)
        least, _, beyond, ended = ca.vertsplit(state[3:])
        found = where(
            ended == GOES_ON, ca.fabs(state[2]) < _STALLED * self._course.spans, ended == MINIMUM
        )
        good = ca.logic_and(is_finite(least), found)
        status = where(
            good,
            where(beyond, float(ProjectionStatus.BEYOND_END), float(ProjectionStatus.OK)),
            float(ProjectionStatus.NOT_CONVERGED),
        )
        turned = [row[3:] for row in rows[: r + 1]] if layout.oriented else []
        place = known["first"] + theta
        told = ca.vertcat(eta, alpha, status, normal, position, *turned)
        told = where(is_finite(least), ca.vertcat(place, told), math.nan)
        told = ca.vertcat(told[:3], status, told[4:])
        foot = ca.vertcat(known["piece"], sigma, e_par, normal)
        known_foot = all_finite(place, foot)
        return {
            "manifold_point": told,
            "next_place": where(known_foot, place, x.place),
            "next_foot": where(known_foot, foot, x.foot),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        return {"place": y.next_place, "foot": y.next_foot}

    def _span(self, theta: Any) -> tuple[Any, Any]:
        """Return the number of a place's span, and the part of it that has been gone through."""
        span = ca.fmin(ca.fmax(ca.floor(theta), 0.0), self._course.spans - 1.0)
        # what is no number is on the first span
        span = where(is_finite(theta), span, 0.0)
        return span, theta - span

    def _on(self, known: dict[str, Any], theta: Any) -> tuple[Any, Any, Any]:
        """Return the derivatives at a place among the columns, its span and the part of it."""
        span, part = self._span(theta)
        return self._point(self._course.of_span(known["points"], span), part), span, part

    def _found(self, known: dict[str, Any], y: Any, guess: Any) -> tuple[Any, Any]:
        """Return the place of the nearest point next to a guess, and how the iteration ended."""
        begin = ca.fmin(ca.fmax(guess, 0.0), float(self._course.spans))
        begin = where(is_finite(guess), begin, math.nan)
        state = ca.vertcat(begin, begin, 0.0, math.inf, math.nan, 0.0, GOES_ON)
        for _ in range(_STEPS):
            span, part = self._span(state[0])
            own = self._course.of_span(known["points"], span, position_only=True)
            terms = ca.reshape(self._terms(own, part), 3, 3)
            state = self._step(state, y, terms)
        return state[0], state


def _across(direction: Any, e_par: Any) -> Any:
    """Return the unit vector normal to a tangent that is nearest to a direction."""
    rest = direction - ca.dot(direction, e_par) * e_par
    return rest / ca.norm_2(rest)


def _transported(begin: Any, tangent: Any, normal: Any, end: Any, e_par: Any) -> Any:
    """Return the normal vector at the end of a step, by double reflection.

    Args:
        begin: Where the step began [m], shape (3,).
        tangent: ``e_par`` there.
        normal: ``e_perp`` there.
        end: Where it ended [m].
        e_par: ``e_par`` there.
    """
    way = end - begin
    square = ca.dot(way, way)
    safe = where(square > 0.0, square, 1.0)
    mirrored = normal - 2.0 / safe * ca.dot(way, normal) * way
    along = tangent - 2.0 / safe * ca.dot(way, tangent) * way
    second = e_par - along
    size = ca.dot(second, second)
    twice = mirrored - 2.0 / where(size > 0.0, size, 1.0) * ca.dot(second, mirrored) * second
    # where there is no way to tell by: the shortest turn from tangent to tangent
    both = 1.0 + ca.dot(tangent, e_par)
    turned = normal - ca.dot(normal, e_par) / where(both > _NEAR, both, 1.0) * (tangent + e_par)
    turned = where(both > _NEAR, turned, normal)
    return _across(where(square > _NEAR**2, twice, turned), e_par)
