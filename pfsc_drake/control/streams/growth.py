"""How a course grows by a control point, is cut back, and begins anew where it rests."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import where
from pfsc_drake.control.streams.stream_course import POSE, POSITION, Course, picked
from pfsc_drake.control.streams.stream_parameters import StreamParameters

# of the spacing of way points, by which every step of control points goes forward
_FORWARD = 0.1
# spans beyond the one in which a tool would rest that are not taken back
_KEPT = 1
_PLACES = 4  # at which a course may be cut

Fields = dict[str, Any]


class Growth:
    """Functions on the fields of a :class:`Course`.

    Args:
        course: Layout of the course.
        parameters: How way points become a path.

    Attributes:
        last_span: Number of the last span.
        root: Place among the columns' spans at which a piece begins, or ends, once control points
            on all sides of it are known that decide over it: then it lies on the last span.
    """

    def __init__(self, course: Course, parameters: StreamParameters) -> None:
        self._course, self._parameters = course, parameters
        self.last_span = course.spans - 1
        self.root = course.columns - 1 - course.spline.reach - (course.spline.degree - 1) / 2.0
        self._on_last = self.root - self.last_span
        points = course.spline.point_function(course.dimension, 0)
        self._pose = lambda own: points(own, self._on_last)

    def control(self, before: Any, at: Any, after: Any) -> Any:
        """Return the control point of a way point between two others."""
        return self._course.spline.sharpened(before, at, after) if self._parameters.through else at

    def straight(self, at_rest: np.ndarray, direction: np.ndarray, spacing: float) -> Fields:
        """Return a straight course that ends where the tool rests.

        Args:
            at_rest: Pose [m], and quaternion if there is one, shape (d,).
            direction: Unit vector along it, shape (3,).
            spacing: Distance of its control points [m].
        """
        course, middle = self._course, self._course.columns - 1 - self._course.spline.reach
        # the first piece begins with control point 0
        before = 2 * course.spline.reach + 1
        places = spacing * (np.arange(course.columns) - middle)
        points = np.tile(at_rest, (course.columns, 1))
        points[:, :POSITION] += np.outer(places, direction)
        return {
            "first": ca.DM(-middle - before),
            "piece": ca.DM(0.0),
            "root": ca.DM(self.root - middle - before),
            "points": ca.DM(points.ravel()),
            "eta": ca.DM(spacing * (np.arange(course.spans + 1) - self.root)),
            "speed": ca.DM(np.full(course.spans, self._parameters.velocity)),
        }

    def appended(self, known: Fields, control: Any) -> Fields:
        """Return a course with one more control point, of which the last span is made.

        Args:
            known: The course.
            control: The control point, shape (d,).
        """
        d, count = self._course.dimension, self._course.spline.degree + 1
        points = ca.vertcat(known["points"][d:], control)
        own = self._positions(points[-d * count :])
        end = known["eta"][-1] + self._course.spline.length(own, 1.0)
        speed = self.speed(self._course.spline.shape(own))
        return known | {
            "first": known["first"] + 1.0,
            "points": points,
            "eta": ca.vertcat(known["eta"][1:], end),
            "speed": ca.vertcat(known["speed"][1:], speed),
        }

    def end(self, known: Fields) -> tuple[Any, Any]:
        """Return pose and arc length at which a course ends whose last span has its end.

        Args:
            known: The course.
        """
        own = known["points"][-self._course.dimension * (self._course.spline.degree + 1) :]
        way = self._course.spline.length(self._positions(own), self._on_last)
        return self._pose(own), known["eta"][-2] + way

    def mirrored(self, known: Fields, newest: Any, further: Any) -> Any:
        """Return the control point to append to a piece that gets its end.

        The spline is point-symmetric there, so that it leads exactly to the last way point.

        Args:
            known: The course.
            newest: The last way point, which is its own control point.
            further: How many control points it would be beyond the last one.
        """
        columns, far = self._course.columns, ca.fmax(further, 1.0)
        middle, other = (self._column(known, columns - k * far) for k in (1.0, 2.0))
        return where(further > 0.0, 2.0 * middle - other, newest)

    def begun(self, known: Fields, controls: Sequence[Any], eta: Any) -> Fields:
        """Return a course whose new piece begins where the last one ended.

        The spline is point-symmetric there, so that it leads exactly through.

        Args:
            known: The course.
            controls: The first control points, that of the begin first.
            eta: Arc length at the begin [m].
        """
        course, spline = self._course, self._course.spline
        begin, d = controls[0], course.dimension
        mirrored = [2.0 * begin - c for c in reversed(controls[1:])]
        step = mirrored[0] - mirrored[1]
        older = course.columns - len(mirrored) - len(controls)
        before = [mirrored[0] + (older - j) * step for j in range(older)]
        points = ca.vertcat(*before, *mirrored, *controls)
        own = self._positions(points[-d * (spline.degree + 1) :])
        way, whole = spline.length(own, self._on_last), spline.length(own, 1.0)
        steps = ca.DM(np.arange(-self.last_span, 1.0)) * ca.norm_2(step[:POSITION])
        first = known["first"] + len(mirrored) + len(controls)
        return {
            "first": first,
            "piece": known["piece"] + 1.0,
            "root": first + self.root,
            "points": points,
            "eta": ca.vertcat(eta - way + steps, eta - way + whole),
            "speed": ca.DM.ones(course.spans) * self.speed(spline.shape(own)),
        }

    def cut_back(self, known: Fields, stop: Any) -> tuple[Fields, Any, Any]:
        """Return a course without control points that a tool does not need to stop.

        What is left can be ended: of the first few places from there on it is cut at the first one
        at which the piece would end gently.

        Args:
            known: The course.
            stop: Arc length at which it can stop [m].

        Returns:
            The course, its control point after the last one, and how many have gone; not less than
            one, or nothing has changed.
        """
        course, count = self._course, self._course.spline.degree + 1
        span = ca.sum1(known["eta"] <= stop) - 1.0
        first = span + _KEPT + course.spline.degree
        last = ca.DM(course.columns - 1.0)
        for place in reversed(range(_PLACES)):
            ends = first + place
            there = [self._column(known, ends + 1.0 - k) for k in reversed(range(count))]
            gentle = self.admissible(self.ended_at(there, count - 1))
            last = where(ca.logic_and(gentle, ends + 1.0 < course.columns), ends, last)
        gone = course.columns - 1.0 - last
        after = self._column(known, last + 1.0)

        def kept(name: str, size: int, width: int = 1) -> Any:
            rows = ca.fmax(ca.DM(range(size)) - gone, 0.0)
            parts = ca.repmat(ca.DM(range(width)), 1, size)
            return picked(known[name], ca.vec(ca.repmat(width * rows.T, width, 1) + parts))

        cut = known | {
            "first": known["first"] - gone,
            "points": kept("points", course.columns, course.dimension),
            "eta": kept("eta", course.spans + 1),
            "speed": kept("speed", course.spans),
        }
        return cut, after, gone

    def _column(self, known: Fields, number: Any) -> Any:
        """Return the control point in a column, the last one from beyond, shape (d,)."""
        d, inside = self._course.dimension, ca.fmin(number, self._course.columns - 1.0)
        return picked(known["points"], d * inside + ca.DM(range(d)))

    def admissible(self, controls: Sequence[Any]) -> Any:
        """Return whether all spans on control points are regular and bend gently enough.

        ``sigma'`` on a span is a mean of the p steps between its control points, with weights that
        are positive. It is regular if all steps go forward in one direction, which here is that
        from the first control point to the last one: then ``|sigma'|`` is not less than the
        smallest of their components along it.

        Args:
            controls: Control points, one after the other, each of shape (d,).
        """
        degree, good = self._course.spline.degree, ca.DM(1.0)
        sharpest = 1.0 / self._parameters.least_radius
        least = _FORWARD * self._parameters.spacing
        positions = [c[:POSITION] for c in controls]
        for s in range(len(positions) - degree):
            own = positions[s : s + degree + 1]
            way = own[-1] - own[0]
            forward = ca.vertcat(*[ca.dot(way, after - c) for c, after in pairwise(own)])
            curvature, _ = ca.vertsplit(self._course.spline.shape(ca.vertcat(*own)))
            regular = ca.mmin(forward) > least * ca.norm_2(way)
            good = ca.logic_and(good, ca.logic_and(regular, curvature < sharpest))
        return good

    def speed(self, shape: Any) -> Any:
        """Return the largest speed on a span [m/s], from what `UniformSpline.shape` tells."""
        limits = self._parameters
        curvature, jerk = ca.vertsplit(shape)
        bent = ca.sqrt(limits.normal_acceleration / ca.fmax(curvature, 1e-9))
        jerky = ca.fmax(limits.jerk / ca.fmax(jerk, 1e-9), 0.0) ** (1.0 / 3.0)
        return ca.fmin(limits.velocity, ca.fmin(bent, jerky))

    def _positions(self, own: Any) -> Any:
        """Return the positions of a span's control points, one after the other."""
        if self._course.dimension == POSITION:
            return own
        count = self._course.spline.degree + 1
        return ca.vec(ca.reshape(own, POSE, count)[:POSITION, :])

    def ended_at(self, controls: Sequence[Any], end: int) -> list[Any]:
        """Return control points up to an end, and as many mirrored at it as decide over it.

        Args:
            controls: Control points, one after the other.
            end: Index of the one at which the path would end.
        """
        kept = list(controls[: end + 1])
        beyond = [2.0 * kept[end] - kept[end - k] for k in range(1, self._course.spline.reach + 1)]
        return [*kept, *beyond]

    def whole_piece(self, controls: Sequence[Any]) -> list[Any]:
        """Return control points of a piece with those mirrored at its begin and its end.

        Args:
            controls: Those from its begin to its end, two or more.
        """
        reach, last = self._course.spline.reach, len(controls) - 1

        def at(k: int) -> Any:
            if k < 0:
                return 2.0 * controls[0] - at(-k)
            return controls[k] if k <= last else 2.0 * controls[last] - at(2 * last - k)

        return [at(k) for k in range(-reach, last + reach + 1)]

    def among(self, known: Fields, count: int) -> list[Any]:
        """Return the last control points, one after the other, each of shape (d,)."""
        return ca.vertsplit(
            known["points"][-self._course.dimension * count :], self._course.dimension
        )


def chosen(condition: Any, fields: Fields, otherwise: Fields) -> Fields:
    """Return one of two courses, field by field."""
    return {name: where(condition, value, otherwise[name]) for name, value in fields.items()}


def no_direction(vector: np.ndarray) -> bool:
    """Return whether a vector has no direction."""
    return not 0.0 < float(np.linalg.norm(vector)) < math.inf
