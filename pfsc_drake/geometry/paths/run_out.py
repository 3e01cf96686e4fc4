"""Where an open path goes on beyond its ends, so that a hand can pull the tool over them."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from pfsc_drake.geometry.curves.curve import Curve, Sampler, check_order
from pfsc_drake.geometry.curves.orientation import OrientationCurve
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.frame import ParallelTransportFrame
from pfsc_drake.geometry.paths.turned_frame import Frame, TurnedFrame

# Of the domain of the path: the longest run-out.
_LONGEST = 0.1
# How much a term of the Taylor series may change the tangent, relative to it, ...
_BEND = 0.5
# ... and turn the quaternion, relative to its length, or the frame, rad.
_TURN = 0.15


class RunOut(Curve):
    """A curve that goes on smoothly from the end of another one to a constant derivative.

    With the distance u from the end, outwards, and its length L::

        sigma'(u) = (1 - w(u / L)) T(u) + w(u / L) g

    T is the Taylor polynomial of the curve's derivative at the end, w rises from 0 to 1 with
    k - 1 vanishing derivatives at both ends, so that the curve is of class C^k there and goes
    on with the constant derivative g in class C^k.

    Args:
        derivatives: Of the curve at its end by theta, orders 0..k, [k + 1, dimension].
        final: The derivative g by theta, [dimension].
        theta: Parameter of the end.
        length: L, positive if theta grows outwards, else negative.
    """

    def __init__(
        self, derivatives: np.ndarray, final: np.ndarray, theta: float, length: float
    ) -> None:
        breakpoints = sorted((theta, theta + length))
        super().__init__(derivatives.shape[1], breakpoints, closed=False, smoothness=math.inf)
        k = len(derivatives) - 1
        self._theta, self._length = theta, length
        rise = _smooth_step(k)
        components = []
        for column, slope in zip(derivatives.T, final, strict=True):
            # in x = u / L, of which theta is a linear function
            taylor = [column[j] * length**j / math.factorial(j - 1) for j in range(1, k + 1)]
            rate = (1.0 - rise) * Polynomial(taylor) + rise * (slope * length)
            components.append(rate.integ() + column[0])
        self._degree = max(p.degree() for p in components)
        self._coefficients = np.zeros((self.dimension, self._degree + 1))
        for row, polynomial in zip(self._coefficients, components, strict=True):
            row[: polynomial.degree() + 1] = polynomial.coef

    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """See the base class."""
        x = (self._checked(theta) - self._theta) / self._length
        powers = x[..., None] ** np.arange(self._degree + 1)
        return np.einsum("kdj,...j->...kd", self._table(order), powers)

    def flat_sampler(self, order: int) -> Sampler:
        """See the base class."""
        matrix = self._table(order).reshape(-1, self._degree + 1)
        exponents = np.arange(self._degree + 1)
        theta_0, length = self._theta, self._length
        return lambda theta: matrix.dot(((theta - theta_0) / length) ** exponents)

    def _table(self, order: int) -> np.ndarray:
        """Map from powers of x to derivatives by theta, [order + 1, dimension, degree + 1]."""
        table = np.zeros((check_order(order) + 1, *self._coefficients.shape))
        for k in range(min(order, self._degree) + 1):
            for j in range(k, self._degree + 1):
                factor = math.perm(j, k) / self._length**k
                table[k, :, j - k] = factor * self._coefficients[:, j]
        return table


class JoinedCurve(Curve):
    """Curves one after the other as one.

    Args:
        parts: Open curves of one dimension; each begins where the one before ends.
    """

    def __init__(self, parts: Sequence[Curve]) -> None:
        breakpoints = np.concatenate(
            [parts[0].breakpoints, *[part.breakpoints[1:] for part in parts[1:]]]
        )
        smoothness = min(part.smoothness for part in parts)
        super().__init__(parts[0].dimension, breakpoints, closed=False, smoothness=smoothness)
        self._parts, self._joints = parts, [part.domain[0] for part in parts[1:]]

    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """See the base class."""
        values = np.asarray(self._checked(theta))
        which = np.searchsorted(self._joints, values, side="right")
        result = np.zeros((*values.shape, order + 1, self.dimension))
        for i, part in enumerate(self._parts):
            chosen = which == i
            if np.any(chosen):
                inside = np.clip(values[chosen], *part.domain)
                result[chosen] = part.derivatives(inside, order)
        return result

    def flat_sampler(self, order: int) -> Sampler:
        """See the base class."""
        samplers = [part.flat_sampler(order) for part in self._parts]
        joints = self._joints
        return lambda theta: samplers[bisect_right(joints, theta)](theta)


@dataclass(frozen=True)
class Continuation:
    """How a path goes on beyond one of its ends.

    Attributes:
        position: The curve in R^3.
        orientation: Quaternions over the same parameter, or None.
        arc_length: Arc length of ``position``, from its begin.
        eta: Arc length of the path there [m], to be added.
        frame: Frame that agrees with the path's at the end.
    """

    position: RunOut
    orientation: OrientationCurve | None
    arc_length: ArcLength
    eta: float
    frame: Frame


def continuations(
    position: Curve,
    orientation: OrientationCurve | None,
    arc_length: ArcLength,
    frame: Frame,
    order: int,
) -> tuple[Continuation, Continuation]:
    """Return how an open path goes on before its begin and after its end.

    Its position goes over to a straight line and its orientation to a constant one, in
    class C^(order + 1) and C^order as the path itself, within at most a tenth of its domain; a
    frame that turns about the tangent comes to rest in the same way.

    Args:
        position: Open curve sigma_t in R^3.
        orientation: Curve of quaternions, or None.
        arc_length: Arc length of ``position``.
        frame: Frame along ``position``.
        order: Relative degree r of the law.
    """
    made = []
    for end, sign in zip(position.domain, (-1.0, 1.0), strict=True):
        p = position.derivatives(end, order + 1)
        q = None if orientation is None else orientation.derivatives(end, order)
        psi = np.append(0.0, frame.turning(end, order))[:, None]
        length = sign * _run_out_length(p, q, psi, _LONGEST * position.period)
        curve = RunOut(p, p[1], end, length)
        turning = None if q is None else OrientationCurve(RunOut(q, 0.0 * q[0], end, length))
        way = ArcLength(curve)
        transported = _frame_through(curve, frame.normals(end)[0], end)
        through: Frame = transported
        if frame.turns:
            through = TurnedFrame(transported, RunOut(psi, np.zeros(1), end, length))
        made.append(
            Continuation(
                curve,
                turning,
                way,
                arc_length.length if sign > 0.0 else -way.length,
                through,
            )
        )
    return made[0], made[1]


def _run_out_length(p: np.ndarray, q: np.ndarray | None, psi: np.ndarray, longest: float) -> float:
    """Length in which no term of the Taylor series takes the curve far from its tangent."""
    lengths, speed = [longest], float(np.linalg.norm(p[1]))
    for j in range(2, len(p)):
        size = float(np.linalg.norm(p[j]))
        if size > 0.0:
            lengths.append((_BEND * speed * math.factorial(j - 1) / size) ** (1.0 / (j - 1)))
    turns = [] if q is None else [(q, _TURN * float(np.linalg.norm(q[0])))]
    for derivatives, allowed in (*turns, (psi, _TURN)):
        for j in range(1, len(derivatives)):
            size = float(np.linalg.norm(derivatives[j]))
            if size > 0.0:
                lengths.append((allowed * math.factorial(j) / size) ** (1.0 / j))
    return min(lengths)


def _frame_through(curve: RunOut, normal: np.ndarray, theta: float) -> ParallelTransportFrame:
    """Parallel transport frame with a given normal at one end of the curve."""
    begin = curve.domain[0]
    if theta == begin:
        return ParallelTransportFrame(curve, normal)
    # transport commutes with turns about the tangent
    trial = ParallelTransportFrame(curve)
    e_perp, e_cross = trial.normals(theta)
    start, across = trial.normals(begin)
    cosine, sine = float(normal @ e_perp), float(normal @ e_cross)
    return ParallelTransportFrame(curve, cosine * start + sine * across)


def _smooth_step(k: int) -> Polynomial:
    """Polynomial from 0 at 0 to 1 at 1 with k - 1 vanishing derivatives at both."""
    x = Polynomial([0.0, 1.0])
    slope = (x * (1.0 - x)) ** (k - 1)
    rise = slope.integ()
    return rise / rise(1.0)
