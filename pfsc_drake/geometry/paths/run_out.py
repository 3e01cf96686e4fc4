"""Where an open path goes on beyond its ends, so that a hand can pull the tool over them."""

import math
from dataclasses import dataclass

import numpy as np

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation import OrientationCurve
from pfsc_drake.geometry.curves.run_out import RunOut, straightening_length
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.frame import ParallelTransportFrame
from pfsc_drake.geometry.paths.turned_frame import Frame, TurnedFrame

# Of the domain of the path: the longest run-out.
_LONGEST = 0.1
# How much a term of the Taylor series may turn the quaternion, relative to its length, or the
# frame, rad.
_TURN = 0.15


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
    lengths = [straightening_length(p, longest)]
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
