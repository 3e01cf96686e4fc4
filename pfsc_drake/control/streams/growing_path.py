"""Layout of a path that grows while the tool moves."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from pfsc_drake.errors import require
from pfsc_drake.geometry.paths.uniform_spline import UniformSpline

POSITION, POSE = 3, 7  # size of a waypoint: [x, y, z], and with a quaternion
_CLOSE = 8  # least number of spans in addition to those that the spline needs


@dataclass(frozen=True)
class GrowingPath:
    """Layout of the last control points of a path, and the data of their spans, in a flat array.

    There are K columns of control points, the newest one last, and K - p spans, span s on the
    columns s .. s + p. When a control point is added, all columns are shifted by one.

    | field    | length    | meaning                                                              |
    |----------|-----------|----------------------------------------------------------------------|
    | `first`  | 1         | number of the first column's control point since the stream began    |
    | `piece`  | 1         | number of the piece; a piece begins where a stream began or ended    |
    | `root`   | 1         | theta at which the piece begins                                      |
    | `points` | d K       | control points in order: position [m], quaternion                    |
    | `eta`    | K - p + 1 | arc length at the begin of each span and at the last one's end [m]   |
    | `speed`  | K - p     | largest speed on each span [m/s]                                     |

    theta is ``first`` plus the parameter relative to the columns' spans, so that a shift of the
    columns does not change it.

    Args:
        order: Relative degree r of the law; the spline is of class C^(r + 1).
        dimension: Size d of a control point: 3 for positions, 7 with quaternions (w, x, y, z).
        columns: Number K of columns.

    Attributes:
        spline: Spline of degree p = r + 2.
        spans: Number K - p of spans.
        size: Length of the array.

    Raises:
        InputError: If there are too few columns, or d is neither 3 nor 7.
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
        """Lengths of all fields in order."""
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

    def split(self, path: Any) -> dict[str, Any]:
        """Return the fields by name.

        Args:
            path: Array of the path, shape (size,).
        """
        ends = [0]
        for length in self.fields.values():
            ends.append(ends[-1] + length)
        return dict(zip(self.fields, ca.vertsplit(path, ends), strict=True))

    def span_points(self, points: Any, span: Any, *, position_only: bool = False) -> Any:
        """Return the control points of a span in one vector.

        Args:
            points: The field ``points``.
            span: Number of the span relative to the columns, an integer expression.
            position_only: Whether quaternions are left out.
        """
        d, count = self.dimension, self.spline.degree + 1
        own = pick(points, d * span + ca.DM(range(d * count)))
        if not position_only or d == POSITION:
            return own
        return ca.vec(ca.reshape(own, d, count)[:POSITION, :])


def pick(values: Any, indices: Any) -> Any:
    """Return values at computed indices.

    Args:
        values: Numbers or an expression, shape (n,).
        indices: Integers from 0 to n - 1, or an expression of them, shape (k,).
    """
    if isinstance(values, ca.DM) and isinstance(indices, ca.DM):
        return values[[int(index) for index in indices.full().ravel()]]
    return ca.MX(values)[ca.MX(indices)]
