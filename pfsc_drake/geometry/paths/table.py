"""Everything that is a function of the path parameter alone, as one table of polynomials."""

from typing import NamedTuple

import numpy as np

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation import OrientationCurve
from pfsc_drake.geometry.curves.piecewise_fit import fit_pieces
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.point import PathPointLayout
from pfsc_drake.geometry.paths.turned_frame import Frame

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

    A closed path with an orientation of two laps has a table of two laps.

    Attributes:
        breakpoints: theta_s and the last end, [pieces + 1].
        rows: Coefficients of the path point, laid out by `PathPointLayout` with theta,
            alpha and status left zero, [pieces, layout.size, 8], lowest power first.
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
    """Table of a path.

    Each quantity agrees to 1e-13 of its size on the path, or to the rounding errors of the curve
    itself where these are larger (polynomials of high degree on long segments).

    Args:
        position: Curve sigma_t in R^3.
        orientation: Curve of quaternions, or None.
        arc_length: Arc length of `position`.
        frame: Frame along `position`.
        layout: Which quantities, and where they go.

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
    """Size of each quantity among samples [n, layout.size]: [layout.size].

    It is the largest value of a component, and not less than a part of the largest norm of its
    vector: what is zero but for rounding errors (as components of e_perp and of the derivatives
    are on a tilted plane) is not to be followed for its own sake, which would never end.
    """
    scale = np.ones(layout.size)
    vectors = [(layout.eta, 1), (layout.normal, 3), (layout.position, 3), (layout.quaternion, 4)]
    for place, dimension in vectors:
        parts = np.abs(points[:, place]).reshape(len(points), -1, dimension)
        norm = np.linalg.norm(parts, axis=2).max(axis=0)[:, None]
        scale[place] = np.maximum(parts.max(axis=0), _SMALL_COMPONENT * norm).ravel()
    if layout.turning:
        scale[layout.turn] = _turn_scale(points, layout)
    scale[scale == 0.0] = 1.0
    return scale


def _turn_scale(points: np.ndarray, layout: PathPointLayout) -> np.ndarray:
    """Size of the derivatives of psi, [order]: of a frame that turns as fast as the path bends.

    A torsion that is constant but for rounding errors has derivatives of no size of their own.
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
    """Where any of the quantities need not be smooth, [n]."""
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
