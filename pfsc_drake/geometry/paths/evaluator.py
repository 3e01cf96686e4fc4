"""What a path tells the controller at each tick."""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation import OrientationCurve
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.point import PathPointLayout
from pfsc_drake.geometry.paths.projection import Projection, Projector
from pfsc_drake.geometry.paths.run_out import Continuation, JoinedCurve, continuations
from pfsc_drake.geometry.paths.table import PathTable, tabulate
from pfsc_drake.geometry.paths.turned_frame import Frame
from pfsc_drake.geometry.projection_status import ProjectionStatus

_BEYOND_END = float(ProjectionStatus.BEYOND_END)
_NOT_CONVERGED = float(ProjectionStatus.NOT_CONVERGED)

# All relative to the length of the domain: the longest step from one tick to the next, ...
_NEAR = 1.0 / 128.0
# ... a step of third order after which none of more than the tolerance follows, ...
_SETTLED = 1e-6
_TOLERANCE = 1e-12
# ... and how far a polynomial may be used beyond its piece.
_SLACK = 1e-13
# The foot lies on the piece of the guess, or on the next.
_MAX_PIECES = 3
_MAX_STEPS = 6
# Of the normal over the laps, rad: the holonomy of a plane curve is a rounding error.
_NO_TURN = 1e-14

Foot = tuple[int, float, int]


class PathEvaluator:
    """Projects a point on a path and evaluates everything a law of one order needs there.

    It has no memory: the same input gives the same output. `Path.evaluator` makes it.

    All quantities of the path point are polynomials of u = theta - theta_s on the pieces of
    one table, so one product of a matrix with the powers of u evaluates them all. The slope of
    half the squared distance from a point y,

        f(u) = (sigma_t(theta_s + u) - y) . sigma_t'(theta_s + u),

    is a polynomial too, with coefficients affine in y. From the last tick's parameter
    Halley's steps, of third order, find its root in a few scalar operations. What they find
    is checked on the path itself; whatever is not quick and plain (a far guess, an end of an
    open path, a point near the centre of curvature) is left to the `Projector`.

    Args:
        position: Curve sigma_t in R^3.
        orientation: Curve of quaternions, or None.
        arc_length: Arc length of `position`.
        frame: Frame along `position`.
        projector: Projector onto `position`.
        order: Relative degree r of the law.

    Attributes:
        layout: Where the quantities lie in the arrays returned.
    """

    def __init__(
        self,
        position: Curve,
        orientation: OrientationCurve | None,
        arc_length: ArcLength,
        frame: Frame,
        projector: Projector,
        order: int,
    ) -> None:
        self.layout = PathPointLayout(order, orientation is not None, frame.turns)
        table = tabulate(position, orientation, arc_length, frame, self.layout)
        # An open path goes on beyond its ends, before its first piece and after its last.
        self._project_beyond: Callable[[Sequence[float], float], Projection] | None = None
        self._first_piece, self._last_piece = 0, len(table.rows) - 1
        if not position.closed:
            before, after = continuations(position, orientation, arc_length, frame, order)
            self._first_piece, table = _extended(before, table, after, self.layout)
            self._last_piece += self._first_piece
            whole = JoinedCurve([before.position, position, after.position])
            self._project_beyond = Projector(whole).project
        self._rows, self._slopes = list(table.rows), list(table.slopes)
        self._starts = table.breakpoints[:-1].tolist()
        self._widths = np.diff(table.breakpoints).tolist()
        self._interior = table.breakpoints[1:-1].tolist()
        # Of the table, which may be one or two laps long.
        self._begin, self._end = float(table.breakpoints[0]), float(table.breakpoints[-1])
        self._period = self._end - self._begin
        laps = round(self._period / position.period)
        self._length, self._turn = laps * arc_length.length, laps * frame.holonomy
        self._domain, self._closed = position.domain, position.closed
        self._project = projector.project
        length = position.period
        self._near, self._settled = _NEAR * length, _SETTLED * length
        self._tolerance, self._slack = _TOLERANCE * length, _SLACK * length

    def __call__(self, point: Sequence[float], theta_guess: float) -> np.ndarray:
        """Path quantities at the projection of a point.

        Args:
            point: y_t, [3], m. A list or tuple of floats is faster than an array.
            theta_guess: Unwrapped parameter of the last tick.

        Returns:
            New array [layout.size], see `PathPointLayout`. All its values but `status` are
            NaN if the point or the guess is not finite.
        """
        x, y, z = point
        foot = self._find_foot(x, y, z, theta_guess)
        if foot is None:
            return self._at_projection(point, theta_guess)
        piece, u, laps = foot
        u2 = u * u
        u3 = u2 * u
        u4 = u2 * u2
        out = self._rows[piece].dot((1.0, u, u2, u3, u4, u2 * u3, u3 * u3, u3 * u4))
        px, py, pz, dx, dy, dz, cx, cy, cz = out[7:16].tolist()
        x -= px
        y -= py
        z -= pz
        square = dx * dx + dy * dy + dz * dz
        bend = x * cx + y * cy + z * cz
        curvature = square - bend
        slope = x * dx + y * dy + z * dz
        if not abs(slope) < self._tolerance * curvature:
            return self._at_projection(point, theta_guess)
        out[0] = self._starts[piece] + u + slope / curvature
        out[2] = bend / square
        if laps:
            self._add_laps(out, laps)
        elif not self._first_piece <= piece <= self._last_piece:
            out[3] = _BEYOND_END
        return out

    def evaluate_at(self, theta: float) -> np.ndarray:
        """Path quantities at a point on the path, for set-up.

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
        return self._at(float(theta))

    def _find_foot(self, x: float, y: float, z: float, theta: float) -> Foot | None:
        """Root of the slope next to a guess: piece, u, and number of the table's lap.

        Every step must be shorter than a quarter of the one before, as it is near a root;
        None if it is not, or if the way leads out of an open path.
        """
        laps, reach = 0, self._near
        settled, slack = self._settled, self._slack
        for _ in range(_MAX_PIECES):
            if not self._begin <= theta <= self._end:
                if not self._closed or not math.isfinite(theta):
                    return None
                more = math.floor((theta - self._begin) / self._period)
                theta -= more * self._period
                laps += more
            piece = bisect_right(self._interior, theta)
            start, width = self._starts[piece], self._widths[piece]
            c0, c1, c2, c3, c4, c5, c6, c7 = self._slopes[piece].dot((1.0, x, y, z)).tolist()
            u = theta - start
            for _ in range(_MAX_STEPS):
                # Horner's scheme for the slope f, its derivative d = f' and g = f''/2 at u.
                g = d = c7
                f = c6 + u * c7
                d = f + u * d
                g = d + u * g
                f = c5 + u * f
                d = f + u * d
                g = d + u * g
                f = c4 + u * f
                d = f + u * d
                g = d + u * g
                f = c3 + u * f
                d = f + u * d
                g = d + u * g
                f = c2 + u * f
                d = f + u * d
                g = d + u * g
                f = c1 + u * f
                d = f + u * d
                f = c0 + u * f
                divisor = d * d - f * g
                if not (d > 0.0 and divisor > 0.0):
                    return None
                step = -f * d / divisor
                if not -reach < step < reach:
                    return None
                u += step
                if not -slack <= u <= width + slack:
                    break
                if -settled < step < settled:
                    return piece, u, laps
                reach = abs(step) / 4.0
            reach = max(abs(step) / 4.0, settled)
            theta = start + u
        return None

    def _at_projection(self, point: Sequence[float], theta_guess: float) -> np.ndarray:
        """The same as calling the object, by the projector."""
        theta, alpha, at_end, _, converged = self._project(point, theta_guess)
        beyond = at_end
        if at_end and self._project_beyond is not None:
            theta, alpha, at_end, _, converged = self._project_beyond(point, theta_guess)
            beyond = not self._domain[0] <= theta <= self._domain[1]
        if alpha != alpha:
            out = np.full(self.layout.size, math.nan)
            out[3] = _NOT_CONVERGED
            return out
        out = self._at(theta)
        if not at_end:
            out[2] = alpha
            if beyond:
                out[3] = _BEYOND_END
            if not converged:
                out[3] = _NOT_CONVERGED
            return out
        out[3] = _BEYOND_END
        layout = self.layout
        out[13 : layout.position.stop] = 0.0
        out[layout.quaternion][4:] = 0.0
        out[layout.turn] = 0.0
        x, y, z, dx, dy, dz = out[7:13].tolist()
        along = (point[0] - x) * dx + (point[1] - y) * dy + (point[2] - z) * dz
        out[1] += along / math.sqrt(dx * dx + dy * dy + dz * dz)
        return out

    def _at(self, theta: float) -> np.ndarray:
        """Path point at a finite unwrapped parameter, with alpha zero and status OK."""
        laps = 0
        if self._closed and not self._begin <= theta <= self._end:
            laps = math.floor((theta - self._begin) / self._period)
        wrapped = theta - laps * self._period
        piece = bisect_right(self._interior, wrapped)
        u = wrapped - self._starts[piece]
        out = self._rows[piece].dot([u**j for j in range(8)])
        if laps:
            self._add_laps(out, laps)
        out[0] = theta
        return out

    def _add_laps(self, out: np.ndarray, laps: int) -> None:
        """Move a path point by laps of the table."""
        out[0] += laps * self._period
        out[1] += laps * self._length
        turn = laps * self._turn
        if abs(turn) > _NO_TURN:
            x, y, z = out[4:7].tolist()
            tx, ty, tz = out[10:13].tolist()
            c, s = math.cos(turn), math.sin(turn) / math.sqrt(tx * tx + ty * ty + tz * tz)
            out[4] = c * x + s * (ty * z - tz * y)
            out[5] = c * y + s * (tz * x - tx * z)
            out[6] = c * z + s * (tx * y - ty * x)


def _extended(
    before: Continuation, table: PathTable, after: Continuation, layout: PathPointLayout
) -> tuple[int, PathTable]:
    """Table of a path with what is beyond its ends, and how many pieces are before its begin."""
    tables = []
    for part in (before, after):
        own = tabulate(part.position, part.orientation, part.arc_length, part.frame, layout)
        own.rows[:, layout.eta, 0] += part.eta
        tables.append(own)
    joined = [tables[0], table, tables[1]]
    breakpoints = [part.breakpoints[:-1] for part in joined]
    whole = PathTable(
        np.concatenate([*breakpoints, tables[1].breakpoints[-1:]]),
        np.concatenate([part.rows for part in joined]),
        np.concatenate([part.slopes for part in joined]),
    )
    return len(tables[0].rows), whole
