"""All quantities that depend on the path parameter alone, as one table of polynomials."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation_curve import OrientationCurve
from pfsc_drake.geometry.curves.piecewise_fit import fit_pieces
from pfsc_drake.geometry.curves.run_out import RunOut, straightening_length
from pfsc_drake.geometry.manifold_point import PathPointLayout
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.frame import Frame, ParallelTransportFrame, TurnedFrame

_DEGREE = 7
# Of each quantity, relative to its size on the path.
_TOLERANCE = 1e-13
_SCALE_SAMPLES = 512
# Part of a vector's norm down to which errors of a component are relative to the component.
_SMALL_COMPONENT = 0.03
# Breakpoints closer than this part of the domain are one.
_SAME = 1e-13


class PathTable(NamedTuple):
    """Polynomials of degree 7 in u = theta - theta_s on each piece s of a path.

    A closed path with an orientation of two revolutions has a table of two revolutions.

    Attributes:
        breakpoints: theta_s and the last end, [pieces + 1].
        rows: Coefficients of the path point, laid out by `PathPointLayout` with theta,
            alpha and status zero, [pieces, layout.size, 8], lowest power first.
    """

    breakpoints: np.ndarray
    rows: np.ndarray


def tabulate(
    position: Curve,
    orientation: OrientationCurve | None,
    arc_length: ArcLength,
    frame: Frame,
    layout: PathPointLayout,
) -> PathTable:
    """Return the table of a path.

    Each quantity agrees to 1e-13 of its size on the path, or to the rounding errors of the curve
    itself where these are larger (polynomials of high degree on long segments).

    Args:
        position: Curve sigma_t in R^3.
        orientation: Curve of quaternions, or None.
        arc_length: Arc length of `position`.
        frame: Frame along `position`.
        layout: Layout of the quantities.

    Raises:
        InputError: the path would need more than 200,000 pieces.
    """
    order = layout.order

    def path_points(theta: np.ndarray) -> np.ndarray:
        points = np.zeros((len(theta), layout.size))
        points[:, layout.eta] = arc_length(theta)[:, None]
        points[:, layout.normal] = frame.normals(theta)[0]
        points[:, layout.position] = position.derivatives(theta, order + 1).reshape(len(theta), -1)
        if orientation is not None:
            q = orientation.derivatives(theta, order)
            points[:, layout.quaternion] = q.reshape(len(theta), -1)
        if layout.turning:
            points[:, layout.turn] = frame.turning(theta, order)
        return points

    breakpoints = _common_breakpoints(position, orientation, frame)
    samples = np.linspace(breakpoints[0], breakpoints[-1], _SCALE_SAMPLES + 1)
    scale = _scale(path_points((samples[1:] + samples[:-1]) / 2.0), layout)
    breakpoints, coefficients = fit_pieces(
        lambda theta: path_points(theta) / scale,
        breakpoints,
        degree=_DEGREE,
        tolerance=_TOLERANCE,
    )
    rows = np.ascontiguousarray((coefficients * scale).transpose(0, 2, 1))
    return PathTable(breakpoints, rows)


def _scale(points: np.ndarray, layout: PathPointLayout) -> np.ndarray:
    """Return the size of each quantity among samples [n, layout.size]: [layout.size].

    It is the largest value of a component, and not less than a part of the largest norm of its
    vector: quantities that are zero up to rounding errors (as components of e_perp and of the
    derivatives are on a tilted plane) would otherwise need pieces without end.
    """
    scale = np.ones(layout.size)
    vectors = [(layout.eta, 1), (layout.normal, 3), (layout.position, 3), (layout.quaternion, 4)]
    for columns, dimension in vectors:
        parts = np.abs(points[:, columns]).reshape(len(points), -1, dimension)
        norm = np.linalg.norm(parts, axis=2).max(axis=0)[:, None]
        scale[columns] = np.maximum(parts.max(axis=0), _SMALL_COMPONENT * norm).ravel()
    if layout.turning:
        scale[layout.turn] = _turn_scale(points, layout)
    scale[scale == 0.0] = 1.0
    return scale


def _turn_scale(points: np.ndarray, layout: PathPointLayout) -> np.ndarray:
    """Return the size of the derivatives of psi, [order], for a frame that turns with the path.

    Derivatives of a torsion that is constant up to rounding errors have no scale of their own.
    """
    sizes = np.abs(points[:, layout.turn]).max(axis=0)
    position = points[:, layout.position].reshape(len(points), -1, 3)
    bends = np.linalg.norm(position, axis=2).max(axis=0)[1:]
    orders = np.arange(1, layout.order + 1)
    rate = np.max(np.append((bends[1:] / bends[0]) ** (1.0 / orders), sizes[0]))
    return np.asarray(np.maximum(sizes, rate**orders))


def _common_breakpoints(
    position: Curve, orientation: OrientationCurve | None, frame: Frame
) -> np.ndarray:
    """Return the parameters at which any of the quantities need not be smooth, [n]."""
    begin, end = position.domain
    parts = [position.breakpoints, frame.breakpoints]
    if orientation is not None and not orientation.constant:
        if position.closed and round(orientation.period / position.period) == 2:
            parts += [part + position.period for part in parts]
            end += position.period
        parts.append(orientation.breakpoints)
    merged = np.unique(np.concatenate(parts))
    slack = _SAME * (end - begin)
    inner = merged[(merged > begin + slack) & (merged < end - slack)]
    inner = inner[np.diff(inner, prepend=begin) > slack]
    return np.concatenate([[begin], inner, [end]])


# Of the domain of the path: the longest run-out.
_LONGEST = 0.1
# Largest turn by a term of the Taylor series: of the quaternion, relative to its length, or of the
# frame, rad.
_TURN = 0.15


@dataclass(frozen=True)
class Continuation:
    """Continuation of a path beyond one of its ends.

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
    """Return the continuations of an open path before its begin and after its end.

    The position changes to a straight line and the orientation to a constant one, in
    class C^(order + 1) and C^order as the path itself, within at most a tenth of its domain; a
    frame that turns about the tangent comes to rest likewise.

    Args:
        position: Open curve sigma_t in R^3.
        orientation: Curve of quaternions, or None.
        arc_length: Arc length of ``position``.
        frame: Frame along ``position``.
        order: Relative degree r of the law.
    """
    results = []
    for end, sign in zip(position.domain, (-1.0, 1.0), strict=True):
        p = position.derivatives(end, order + 1)
        q = None if orientation is None else orientation.derivatives(end, order)
        psi = np.append(0.0, frame.turning(end, order))[:, None]
        length = sign * _run_out_length(p, q, psi, _LONGEST * position.period)
        curve = RunOut(p, p[1], end, length)
        turning = None if q is None else OrientationCurve(RunOut(q, 0.0 * q[0], end, length))
        own_length = ArcLength(curve)
        transported = _frame_through(curve, frame.normals(end)[0], end)
        through: Frame = transported
        if frame.turns:
            through = TurnedFrame(transported, RunOut(psi, np.zeros(1), end, length))
        results.append(
            Continuation(
                curve,
                turning,
                own_length,
                arc_length.length if sign > 0.0 else -own_length.length,
                through,
            )
        )
    return results[0], results[1]


def _run_out_length(p: np.ndarray, q: np.ndarray | None, psi: np.ndarray, longest: float) -> float:
    """Return a length in which no term of the Taylor series leads far from the tangent."""
    lengths = [straightening_length(p, longest)]
    turns = [] if q is None else [(q, _TURN * float(np.linalg.norm(q[0])))]
    for derivatives, allowed in (*turns, (psi, _TURN)):
        for j in range(1, len(derivatives)):
            size = float(np.linalg.norm(derivatives[j]))
            if size > 0.0:
                lengths.append((allowed * math.factorial(j) / size) ** (1.0 / j))
    return min(lengths)


def _frame_through(curve: RunOut, normal: np.ndarray, theta: float) -> ParallelTransportFrame:
    """Return the parallel transport frame with a prescribed normal at one end of the curve."""
    begin = curve.domain[0]
    if theta == begin:
        return ParallelTransportFrame(curve, normal)
    # transport commutes with turns about the tangent
    trial = ParallelTransportFrame(curve)
    e_perp, e_cross = trial.normals(theta)
    start, across = trial.normals(begin)
    cosine, sine = float(normal @ e_perp), float(normal @ e_cross)
    return ParallelTransportFrame(curve, cosine * start + sine * across)
