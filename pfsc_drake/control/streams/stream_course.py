"""What is known at a tick of a path whose way points come one after the other."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from pfsc_drake.errors import require
from pfsc_drake.geometry.paths.uniform_spline import UniformSpline

POSITION, POSE = 3, 7  # numbers of a way point: [x, y, z], and with a quaternion
_CLOSE = 8  # spans beside what a spline needs, which is the least that a tool can drive on


@dataclass(frozen=True)
class Course:
    """The last control points of a path, and what goes with their spans, in a flat array.

    There are K columns of control points, the newest one last; K - p spans stand upon them, span s
    on the columns s .. s + p. Whenever a control point is added all columns move on by one.

    | field    | length    | meaning                                                              |
    |----------|-----------|----------------------------------------------------------------------|
    | `first`  | 1         | number of the first column's control point since the stream began    |
    | `piece`  | 1         | number of the piece: one begins where a stream began or broke off    |
    | `root`   | 1         | theta at which the piece begins                                      |
    | `points` | d K       | control points, one after the other: position [m], quaternion        |
    | `eta`    | K - p + 1 | arc length at the begin of each span and at the last one's end [m]   |
    | `speed`  | K - p     | largest speed on each span [m/s]                                     |

    theta is ``first`` and the place among the columns' spans, so that it does not jump when columns
    move on.

    Args:
        order: Relative degree r of the law; the spline is of class C^(r + 1).
        dimension: d: 3 for positions, 7 with quaternions (w, x, y, z).
        columns: K.

    Attributes:
        spline: Its spline, of degree r + 2.
        spans: K - p.
        size: Length of the array.

    Raises:
        InputError: If there are too few columns, or d is none of both.
    """

    order: int
    dimension: int
    columns: int = 48
    spline: UniformSpline = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        kinds = f"{POSITION} or {POSE}"
        require(self.dimension in (POSITION, POSE), "dimension", self.dimension, kinds)
        object.__setattr__(self, "spline", UniformSpline(self.order + 2))
        least = 2 * self.spline.degree + _CLOSE
        require(self.columns >= least, "columns", self.columns, f"{least} or more")

    @property
    def spans(self) -> int:
        """Number of spans."""
        return self.columns - self.spline.degree

    @property
    def fields(self) -> dict[str, int]:
        """Lengths of all fields, in their order."""
        return {
            "first": 1,
            "piece": 1,
            "root": 1,
            "points": self.dimension * self.columns,
            "eta": self.spans + 1,
            "speed": self.spans,
        }

    @property
    def size(self) -> int:
        """Length of the array."""
        return sum(self.fields.values())

    def split(self, course: Any) -> dict[str, Any]:
        """Return the fields by name.

        Args:
            course: Shape (size,).
        """
        ends = [0]
        for length in self.fields.values():
            ends.append(ends[-1] + length)
        return dict(zip(self.fields, ca.vertsplit(course, ends), strict=True))

    def of_span(self, points: Any, span: Any, *, position_only: bool = False) -> Any:
        """Return the control points of a span, one after the other.

        Args:
            points: The field ``points``.
            span: Its number among the columns' spans, an expression of a whole number.
            position_only: Whether their quaternions are left out.
        """
        d, count = self.dimension, self.spline.degree + 1
        own = picked(points, d * span + ca.DM(range(d * count)))
        if not position_only or d == POSITION:
            return own
        return ca.vec(ca.reshape(own, d, count)[:POSITION, :])


def picked(values: Any, places: Any) -> Any:
    """Return values at places that are calculated.

    Args:
        values: Numbers or an expression, shape (n,).
        places: Whole numbers from 0 to n - 1, or an expression of them, shape (k,).
    """
    if isinstance(values, ca.DM) and isinstance(places, ca.DM):
        return values[[int(place) for place in places.full().ravel()]]
    return ca.MX(values)[ca.MX(places)]
