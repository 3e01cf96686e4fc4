"""Numbers by which a user checks the shape of a path."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.paths.geometric_path import Path, PathWaypoints

_SAMPLES_PER_SEGMENT = 16
_FEWEST_SAMPLES = 2048
# Samples that are evaluated together.
_CHUNK = 20_000
# Newton steps to the closest points of a path to its waypoints.
_PROJECTION_STEPS = 10


@dataclass(frozen=True)
class ShapeReport:
    """Numbers of a path's shape.

    Attributes:
        length: Length (of one revolution), m.
        smallest_radius: Smallest radius of curvature, m; infinite on a straight line.
        smallest_radius_at: eta there, m.
        distance_from_points: Largest distance of a waypoint from the path, m; None without.
        distance_from_polygon: Largest distance of the path from the polygon through its
            waypoints, m; None without waypoints.
        distance_from_polygon_at: eta there, m, or None.
        chord_there: Length of the polygon's side there, m, or None.
        largest_angle_rate: Largest angle the orientation turns by, rad/m; None without.
        largest_angle_rate_at: eta there, m, or None.
        largest_curvature_rate: Largest change of the curvature vector, 1/m^2.
    """

    length: float
    smallest_radius: float
    smallest_radius_at: float
    distance_from_points: float | None
    distance_from_polygon: float | None
    distance_from_polygon_at: float | None
    chord_there: float | None
    largest_angle_rate: float | None
    largest_angle_rate_at: float | None
    largest_curvature_rate: float


def shape_report(path: Path) -> ShapeReport:
    """Measure a path's shape at 16 samples on each of its segments, at least at 2048.

    Args:
        path: The path.

    Returns:
        The numbers.
    """
    breaks = path.position.breakpoints
    count = max(_SAMPLES_PER_SEGMENT, -(-_FEWEST_SAMPLES // (len(breaks) - 1)))
    # Inside of the segments: derivatives of high order may jump at their ends.
    parts = (np.arange(count) + 0.5) / count
    theta = (breaks[:-1, None] + np.diff(breaks)[:, None] * parts).ravel()
    chunks = np.array_split(theta, -(-len(theta) // _CHUNK))
    curvature = np.concatenate([_curvatures(path, chunk) for chunk in chunks])
    bend = int(np.argmax(curvature[:, 0]))
    largest = float(curvature[bend, 0])
    missed = distance = distance_at = chord = rate = rate_at = None
    if path.waypoints is not None:
        missed = _largest_miss(path.position, path.waypoints)
        off, chords = _distances_from_polygon(path, theta, chunks)
        far = int(np.argmax(off))
        distance, chord = float(off[far]), float(chords[far])
        distance_at = path.arc_length(float(theta[far]))
    if path.orientation is not None:
        rates = np.concatenate([_angle_rates(path, chunk) for chunk in chunks])
        fast = int(np.argmax(rates))
        rate, rate_at = float(rates[fast]), path.arc_length(float(theta[fast]))
    return ShapeReport(
        path.length,
        1.0 / largest if largest > 0.0 else np.inf,
        path.arc_length(float(theta[bend])),
        missed,
        distance,
        distance_at,
        chord,
        rate,
        rate_at,
        float(curvature[:, 1].max()),
    )


def _curvatures(path: Path, theta: np.ndarray) -> np.ndarray:
    """Return curvature, 1/m, and the norm of the curvature vector's rate, 1/m^2: [n, 2]."""
    _, d1, d2, d3 = path.position.derivatives(theta, 3).transpose(1, 0, 2)
    square = np.sum(d1 * d1, axis=1, keepdims=True)
    along = np.sum(d1 * d2, axis=1, keepdims=True)
    # kappa = (d2 - along d1 / square) / square, and its derivative by theta
    kappa = (d2 - along / square * d1) / square
    along_rate = np.sum(d2 * d2 + d1 * d3, axis=1, keepdims=True)
    ratio_rate = along_rate / square - 2.0 * (along / square) ** 2
    rate = (d3 - ratio_rate * d1 - along / square * d2) / square - 2.0 * along / square * kappa
    speed = np.sqrt(square)
    return np.stack([np.linalg.norm(kappa, axis=1), np.linalg.norm(rate / speed, axis=1)], axis=1)


def _largest_miss(curve: Curve, waypoints: PathWaypoints) -> float:
    """Return the largest distance of a waypoint from the curve near its parameter, m."""
    theta, points = waypoints.parameters, waypoints.positions[: len(waypoints.parameters)]
    begin, end = curve.domain
    longest = float(np.diff(curve.breakpoints).max())
    least = np.full(len(points), np.inf)
    for _ in range(_PROJECTION_STEPS):
        values = curve.derivatives(theta, 1)
        off, slope = points - values[:, 0], values[:, 1]
        least = np.minimum(least, np.linalg.norm(off, axis=1))
        step = np.sum(off * slope, axis=1) / np.sum(slope**2, axis=1)
        theta = theta + np.clip(step, -longest, longest)
        if not curve.closed:
            theta = np.clip(theta, begin, end)
    return float(least.max())


def _distances_from_polygon(
    path: Path, theta: np.ndarray, chunks: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return each sample's distance from the nearest of three sides, and that side's length, m."""
    waypoints = path.waypoints
    assert waypoints is not None
    order = np.argsort(waypoints.parameters, kind="stable")
    corners, parameters = waypoints.positions[order], waypoints.parameters[order]
    if path.closed and np.any(corners[-1] != corners[0]):
        corners = np.vstack([corners, corners[:1]])
        parameters = np.append(parameters, parameters[0] + path.position.period)
    starts, sides = corners[:-1], np.diff(corners, axis=0)
    squares = np.sum(sides**2, axis=1)
    sigma = np.concatenate([path.position.derivatives(part, 0)[:, 0] for part in chunks])
    own = np.searchsorted(parameters[1:-1], theta, side="right")
    best, chord = np.full(len(theta), np.inf), np.zeros(len(theta))
    for shift in (-1, 0, 1):
        side = own + shift
        side = side % len(sides) if path.closed else np.clip(side, 0, len(sides) - 1)
        rest = sigma - starts[side]
        along = np.sum(rest * sides[side], axis=1) / np.where(squares[side], squares[side], 1.0)
        rest -= np.clip(along, 0.0, 1.0)[:, None] * sides[side]
        best = np.minimum(best, np.linalg.norm(rest, axis=1))
        if shift == 0:
            chord = np.sqrt(squares[side])
    return best, chord


def _angle_rates(path: Path, theta: np.ndarray) -> np.ndarray:
    """Return the angular velocity by arc length, rad/m: [n]."""
    assert path.orientation is not None
    q, dq = path.orientation.derivatives(theta, 1).transpose(1, 0, 2)
    square = np.sum(q * q, axis=1, keepdims=True)
    # Half of the angular velocity is the part of q' / |q| that is perpendicular to q.
    across = dq - np.sum(q * dq, axis=1, keepdims=True) / square * q
    turn = 2.0 * np.linalg.norm(across, axis=1) / np.sqrt(square[:, 0])
    return np.asarray(turn / np.linalg.norm(path.position.derivatives(theta, 1)[:, 1], axis=1))
