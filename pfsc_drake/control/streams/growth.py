"""Operations on a growing path: append a control point, cut back, begin a new piece."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import where
from pfsc_drake.control.streams.growing_path import POSE, POSITION, GrowingPath, pick
from pfsc_drake.control.streams.stream_parameters import StreamParameters

# least forward component of a step between control points, relative to the spacing
_FORWARD = 0.1
# spans beyond the stopping point that are not removed
_MARGIN = 1
_CUTS = 4  # number of candidate cuts

Fields = dict[str, Any]


class Growth:
    """Functions on the fields of a :class:`GrowingPath`.

    Args:
        path: Layout of the path.
        parameters: Parameters of the stream.

    Attributes:
        last_span: Number of the last span.
        root: Parameter relative to the columns' spans at which a piece begins or ends, on the last
            span, once all control points that determine it are known.
    """

    def __init__(self, path: GrowingPath, parameters: StreamParameters) -> None:
        self._path, self._parameters = path, parameters
        self.last_span = path.spans - 1
        self.root = path.columns - 1 - path.spline.reach - (path.spline.degree - 1) / 2.0
        self._on_last = self.root - self.last_span
        points = path.spline.point_function(path.dimension, 0)
        self._pose = lambda own: points(own, self._on_last)

    def control(self, before: Any, at: Any, after: Any) -> Any:
        """Return the control point of a waypoint between two others."""
        return self._path.spline.sharpen(before, at, after) if self._parameters.through else at

    def straight(self, at_rest: np.ndarray, direction: np.ndarray, spacing: float) -> Fields:
        """Return a straight path that ends at the tool's rest pose.

        Args:
            at_rest: Position [m], with a quaternion if d = 7, shape (d,).
            direction: Unit vector along the path, shape (3,).
            spacing: Distance of the control points [m].
        """
        path, middle = self._path, self._path.columns - 1 - self._path.spline.reach
        # the first piece begins with control point 0
        before = 2 * path.spline.reach + 1
        distances = spacing * (np.arange(path.columns) - middle)
        points = np.tile(at_rest, (path.columns, 1))
        points[:, :POSITION] += np.outer(distances, direction)
        return {
            "first": ca.DM(-middle - before),
            "piece": ca.DM(0.0),
            "root": ca.DM(self.root - middle - before),
            "points": ca.DM(points.ravel()),
            "eta": ca.DM(spacing * (np.arange(path.spans + 1) - self.root)),
            "speed": ca.DM(np.full(path.spans, self._parameters.velocity)),
        }

    def append(self, known: Fields, control: Any) -> Fields:
        """Return a path with one more control point, and so one more span.

        Args:
            known: Fields of the path.
            control: The control point, shape (d,).
        """
        d, count = self._path.dimension, self._path.spline.degree + 1
        points = ca.vertcat(known["points"][d:], control)
        own = self._positions(points[-d * count :])
        end = known["eta"][-1] + self._path.spline.length(own, 1.0)
        speed = self.speed(self._path.spline.shape(own))
        return known | {
            "first": known["first"] + 1.0,
            "points": points,
            "eta": ca.vertcat(known["eta"][1:], end),
            "speed": ca.vertcat(known["speed"][1:], speed),
        }

    def end(self, known: Fields) -> tuple[Any, Any]:
        """Return pose and arc length of the end, on a path whose last span contains it.

        Args:
            known: Fields of the path.
        """
        own = known["points"][-self._path.dimension * (self._path.spline.degree + 1) :]
        length = self._path.spline.length(self._positions(own), self._on_last)
        return self._pose(own), known["eta"][-2] + length

    def mirror(self, known: Fields, newest: Any, further: Any) -> Any:
        """Return the next control point beyond the end of a piece.

        The spline is point-symmetric there, so that it passes exactly through the last waypoint.

        Args:
            known: Fields of the path.
            newest: The last waypoint, which is also its control point.
            further: Number of control points beyond the last one.
        """
        columns, far = self._path.columns, ca.fmax(further, 1.0)
        middle, other = (self._column(known, columns - k * far) for k in (1.0, 2.0))
        return where(further > 0.0, 2.0 * middle - other, newest)

    def begin_piece(self, known: Fields, controls: Sequence[Any], eta: Any) -> Fields:
        """Return a path whose new piece begins at the end of the last one.

        The spline is point-symmetric there, so that it passes exactly through the begin.

        Args:
            known: Fields of the path.
            controls: First control points, beginning with the first one of the piece.
            eta: Arc length at the begin [m].
        """
        path, spline = self._path, self._path.spline
        begin, d = controls[0], path.dimension
        mirrored = [2.0 * begin - c for c in reversed(controls[1:])]
        step = mirrored[0] - mirrored[1]
        older = path.columns - len(mirrored) - len(controls)
        before = [mirrored[0] + (older - j) * step for j in range(older)]
        points = ca.vertcat(*before, *mirrored, *controls)
        own = self._positions(points[-d * (spline.degree + 1) :])
        length, whole = spline.length(own, self._on_last), spline.length(own, 1.0)
        steps = ca.DM(np.arange(-self.last_span, 1.0)) * ca.norm_2(step[:POSITION])
        first = known["first"] + len(mirrored) + len(controls)
        return {
            "first": first,
            "piece": known["piece"] + 1.0,
            "root": first + self.root,
            "points": points,
            "eta": ca.vertcat(eta - length + steps, eta - length + whole),
            "speed": ca.DM.ones(path.spans) * self.speed(spline.shape(own)),
        }

    def cut_back(self, known: Fields, stop: Any) -> tuple[Fields, Any, Any]:
        """Return a path without the control points that a stop does not need.

        The cut is at the first of a few candidates at which the piece would end gently, so that the
        remaining piece can be ended.

        Args:
            known: Fields of the path.
            stop: Arc length at which the reference can stop [m].

        Returns:
            The path, the control point after its last one, and the number of removed control
            points; below one the path has not changed.
        """
        path, count = self._path, self._path.spline.degree + 1
        span = ca.sum1(known["eta"] <= stop) - 1.0
        first = span + _MARGIN + path.spline.degree
        last = ca.DM(path.columns - 1.0)
        for k_cut in reversed(range(_CUTS)):
            ends = first + k_cut
            tail = [self._column(known, ends + 1.0 - k) for k in reversed(range(count))]
            gentle = self.admissible(self.end_at(tail, count - 1))
            last = where(ca.logic_and(gentle, ends + 1.0 < path.columns), ends, last)
        gone = path.columns - 1.0 - last
        after = self._column(known, last + 1.0)

        def retain(name: str, size: int, width: int = 1) -> Any:
            rows = ca.fmax(ca.DM(range(size)) - gone, 0.0)
            parts = ca.repmat(ca.DM(range(width)), 1, size)
            return pick(known[name], ca.vec(ca.repmat(width * rows.T, width, 1) + parts))

        cut = known | {
            "first": known["first"] - gone,
            "points": retain("points", path.columns, path.dimension),
            "eta": retain("eta", path.spans + 1),
            "speed": retain("speed", path.spans),
        }
        return cut, after, gone

    def _column(self, known: Fields, number: Any) -> Any:
        """Return the control point in a column, or in the last one if beyond, shape (d,)."""
        d, inside = self._path.dimension, ca.fmin(number, self._path.columns - 1.0)
        return pick(known["points"], d * inside + ca.DM(range(d)))

    def admissible(self, controls: Sequence[Any]) -> Any:
        """Return whether all spans on control points are regular and bend gently enough.

        ``sigma'`` on a span is a mean of the p steps between its control points, with positive
        weights. The span is regular if all steps have a positive component along one direction,
        here from the first control point to the last: ``|sigma'|`` is then not less than the
        smallest component.

        Args:
            controls: Control points in order, each of shape (d,).
        """
        degree, good = self._path.spline.degree, ca.DM(1.0)
        sharpest = 1.0 / self._parameters.least_radius
        least = _FORWARD * self._parameters.spacing
        positions = [c[:POSITION] for c in controls]
        for s in range(len(positions) - degree):
            own = positions[s : s + degree + 1]
            chord = own[-1] - own[0]
            forward = ca.vertcat(*[ca.dot(chord, after - c) for c, after in pairwise(own)])
            curvature, _ = ca.vertsplit(self._path.spline.shape(ca.vertcat(*own)))
            regular = ca.mmin(forward) > least * ca.norm_2(chord)
            good = ca.logic_and(good, ca.logic_and(regular, curvature < sharpest))
        return good

    def speed(self, shape: Any) -> Any:
        """Return the largest speed on a span [m/s] for the shape from `UniformSpline.shape`."""
        limits = self._parameters
        curvature, jerk = ca.vertsplit(shape)
        bent = ca.sqrt(limits.normal_acceleration / ca.fmax(curvature, 1e-9))
        jerky = ca.fmax(limits.jerk / ca.fmax(jerk, 1e-9), 0.0) ** (1.0 / 3.0)
        return ca.fmin(limits.velocity, ca.fmin(bent, jerky))

    def _positions(self, own: Any) -> Any:
        """Return the positions of a span's control points in one vector."""
        if self._path.dimension == POSITION:
            return own
        count = self._path.spline.degree + 1
        return ca.vec(ca.reshape(own, POSE, count)[:POSITION, :])

    def end_at(self, controls: Sequence[Any], end: int) -> list[Any]:
        """Return control points up to an end, and the mirrored ones that determine it.

        Args:
            controls: Control points in order.
            end: Index of the control point at which the path would end.
        """
        head = list(controls[: end + 1])
        beyond = [2.0 * head[end] - head[end - k] for k in range(1, self._path.spline.reach + 1)]
        return [*head, *beyond]

    def whole_piece(self, controls: Sequence[Any]) -> list[Any]:
        """Return the control points of a piece, with those mirrored at its begin and end.

        Args:
            controls: Control points from begin to end, two or more.
        """
        reach, last = self._path.spline.reach, len(controls) - 1

        def at(k: int) -> Any:
            if k < 0:
                return 2.0 * controls[0] - at(-k)
            return controls[k] if k <= last else 2.0 * controls[last] - at(2 * last - k)

        return [at(k) for k in range(-reach, last + reach + 1)]

    def among(self, known: Fields, count: int) -> list[Any]:
        """Return the last control points in order, each of shape (d,)."""
        return ca.vertsplit(known["points"][-self._path.dimension * count :], self._path.dimension)


def choose(condition: Any, fields: Fields, otherwise: Fields) -> Fields:
    """Return one of two paths, field by field."""
    return {name: where(condition, value, otherwise[name]) for name, value in fields.items()}


def no_direction(vector: np.ndarray) -> bool:
    """Return whether a vector has no direction."""
    return not 0.0 < float(np.linalg.norm(vector)) < math.inf
