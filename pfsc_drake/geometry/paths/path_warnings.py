"""Warnings of badly proportioned paths and orientations, with remedies."""

import math
from collections.abc import Callable

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.smoothing import noise_level
from pfsc_drake.geometry.paths.geometric_path import Path, PathWaypoints
from pfsc_drake.geometry.paths.path_smoothing import allows_tolerance
from pfsc_drake.geometry.paths.shape_report import ShapeReport
from pfsc_drake.geometry.rotation import euler_margin

# m: robots' paths are shorter, and distances below count for nothing
_LARGE, _SMALL = 20.0, 1e-4
# of the distance of two waypoints: as on a circle through four, or less than on it
_OVERSHOOT, _NARROW = 0.2, 0.6
# from one waypoint to the next: change of the curvature beside the curvature, and rad
_JUMP, _TURN, _FEWEST = 0.7, 0.002, 10
# of the usual distance of two waypoints, which is not intended
_CLOSE = 1e-2
# rad, from half a turn
_HAIRPIN = math.radians(2.0)
# rad, beyond which a turn is a corner, unless turns alternate in sign
_CORNER, _TO_AND_FRO = 0.3, -0.3
# proposed tolerance, relative to the noise
_TIMES_NOISE = 5.0
# rad/m, and beside the orientations of neighbouring waypoints, or beside the curvature
_FAST, _FASTER = 20.0, 3.0
# rad: below, rows of the law are 60 times larger than those of a turn, and 6 times
_LEAST, _LITTLE = np.deg2rad(1.0), np.deg2rad(10.0)
_OTHER = {"zyx": "zyz", "zyz": "zyx"}


def path_warnings(path: Path, shape: ShapeReport, keys: str = "path.shape.") -> list[str]:
    """Return warnings of a badly proportioned path, one sentence each.

    Args:
        path: The path.
        shape: Its numbers, see :func:`shape_report`.
        keys: Prefix of the names of options that would help.
    """
    found = [*path.notes, _fast_turn(path, shape)]
    if path.waypoints is not None:
        found += [
            far_waypoints(path.waypoints.positions),
            _nearly_closed(path, path.waypoints, keys),
        ]
        if path.waypoints.manner == "interpolated":
            bends = (
                _noise(path, shape, keys)
                or _overshoot(shape, keys)
                or _narrow_bend(path, shape, keys)
            )
            found += [bends and (_close_waypoints(path.waypoints, shape, keys) or bends)]
    return [sentence for sentence in found if sentence]


def euler_warnings(
    convention: str | None, R_d: np.ndarray, block: str, location: Callable[[int], str]
) -> list[str]:
    """Return a warning of a reference near the singularity of its Euler angles, if it is.

    Args:
        convention: Convention of the angles that are coordinates; None where they are not.
        R_d: Orientations of the reference, shape (samples, 3, 3).
        block: Block of the scenario with the orientation.
        location: Function that describes the position of a sample in words.

    Raises:
        InputError: If it is so near that the coordinates are undefined.
    """
    if convention is None:
        return []
    key = f"{block}.orientation"
    margins = euler_margin(R_d, convention)
    worst, other = int(np.argmin(margins)), _OTHER[convention]
    margin = float(margins[worst])
    if margin > _LITTLE:
        return []
    there = float(euler_margin(R_d, other).min())
    instead = f"{key}.jacobian: geometric"
    if there > _LITTLE:
        instead += (
            f", or {key}.convention: {other}, whose angles are {np.rad2deg(there):.3g} deg from it"
        )
    sentence = (
        f"{key}.jacobian = analytic: the {convention} angles of the reference are "
        f"{np.rad2deg(margin):.3g} deg from their singularity {location(worst)}; write {instead}"
    )
    if margin < _LEAST:
        raise InputError(sentence)
    return [sentence]


def closing_gap(path: Path) -> float | None:
    """Return the distance [m] of an open path's ends, if the path appears to be closed.

    Args:
        path: The path.
    """
    waypoints = path.waypoints
    if path.closed or waypoints is None:
        return None
    points = waypoints.positions
    gap = float(np.linalg.norm(points[-1] - points[0]))
    sides = np.linalg.norm(np.diff(points, axis=0), axis=1)
    near = gap <= 1.5 * max(sides[0], sides[-1]) and gap <= 0.1 * path.length
    return gap if near and len(points) > 3 else None


def turning_back(positions: np.ndarray) -> str | None:
    """Return a warning of waypoints at which a path turns back on itself, or None.

    Args:
        positions: Positions of the waypoints [m], shape (n, 3).
    """
    sides = np.diff(positions, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    products = np.where(lengths[1:] * lengths[:-1] > 0.0, lengths[1:] * lengths[:-1], np.inf)
    cosines = np.sum(sides[1:] * sides[:-1], axis=1) / products
    if not len(cosines) or cosines.min() > -math.cos(_HAIRPIN):
        return None
    number = int(np.argmin(cosines)) + 2
    angle = math.degrees(math.acos(max(float(cosines.min()), -1.0)))
    return (
        f"the path turns back on itself, by {angle:.4g} deg at waypoint {number}, where the tool "
        "would have to stop: to go there and back end the path there and write "
        "reference.points: [0, LENGTH, 0], or place waypoints around the turn"
    )


def far_waypoints(positions: np.ndarray) -> str | None:
    """Return a warning of waypoints that appear to be in millimetres, or None.

    Args:
        positions: Positions of the waypoints [m], shape (n, 3).
    """
    farthest = float(np.abs(positions).max())
    if farthest <= _LARGE:
        return None
    return f"waypoints lie up to {farthest:.4g} m from the origin; if they are in mm write unit: mm"


def _nearly_closed(path: Path, waypoints: PathWaypoints, keys: str) -> str | None:
    gap = closing_gap(path)
    if gap is None:
        return None
    return (
        f"the path is open, and its ends are {_length(gap)} apart: for a closed path write "
        f"{keys}closed: true"
    )


def noise_tolerance(path: Path) -> float | None:
    """Return a tolerance [m] for noisy waypoints, or None if they are not noisy.

    Waypoints are noisy if the curvature of the path through them changes from one to the next by
    its own size.

    Args:
        path: A path through its waypoints.
    """
    waypoints = path.waypoints
    if waypoints is None or len(waypoints.positions) < _FEWEST:
        return None
    inner = waypoints.parameters[1:-1]
    _, slope, second = path.position.derivatives(inner, 2).transpose(1, 0, 2)
    square = np.sum(slope**2, axis=1, keepdims=True)
    along = np.sum(slope * second, axis=1, keepdims=True) / square
    curvature = (second - along * slope) / square
    sizes = np.linalg.norm(curvature, axis=1)
    jumps = np.linalg.norm(np.diff(curvature, axis=0), axis=1)
    sides = np.diff(waypoints.positions, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    if np.median(sizes * lengths[:-1]) < _TURN or np.median(jumps) < _JUMP * np.median(sizes):
        return None
    if not np.all(lengths > 0.0):
        return None
    turns = np.diff(sides / lengths[:, None], axis=0)
    similar = np.sum(turns[1:] * turns[:-1]) / np.sum(turns**2)
    if np.linalg.norm(turns, axis=1).max() > _CORNER and similar > _TO_AND_FRO:
        return None
    noise = _TIMES_NOISE * noise_level(waypoints.parameters, waypoints.positions, across=True)
    return _round_up(noise)


def _noise(path: Path, shape: ShapeReport, keys: str) -> str | None:
    """Return a warning of curvature that changes from waypoint to waypoint by its own size."""
    waypoints, tolerance = path.waypoints, noise_tolerance(path)
    if waypoints is None or tolerance is None:
        return None
    sentence = (
        f"the path bends to and fro from waypoint to waypoint, with a radius down to "
        f"{_length(shape.smallest_radius)} at eta = {shape.smallest_radius_at:.4g} m, as paths "
        f"through noisy points do: "
    )
    if allows_tolerance(waypoints.positions, tolerance, path.closed):
        return f"{sentence}write {keys}tolerance (m), perhaps {tolerance:g}"
    return f"{sentence}the path is too short for their scatter: add waypoints, or measure them anew"


def overshoots(shape: ShapeReport) -> bool:
    """Return whether a path is far beside the straight lines between its waypoints.

    Args:
        shape: Numbers of the path.
    """
    off, chord = shape.distance_from_polygon, shape.chord_there
    return off is not None and chord is not None and off > max(_SMALL, _OVERSHOOT * chord)


def _overshoot(shape: ShapeReport, keys: str) -> str | None:
    off, chord = shape.distance_from_polygon, shape.chord_there
    if off is None or chord is None or not overshoots(shape):
        return None
    return (
        f"the path overshoots by {_length(off)} beside the straight line between two waypoints "
        f"{_length(chord)} apart, at eta = {shape.distance_from_polygon_at:.4g} m: add waypoints "
        f"there, or write {keys}corner_distance (m) for straight lines with rounded corners"
    )


def coincident_waypoint(positions: np.ndarray) -> int | None:
    """Return the index of a waypoint that nearly coincides with the next one, or None.

    Args:
        positions: Positions of the waypoints [m], shape (n, 3).
    """
    lengths = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    nearest = int(np.argmin(lengths))
    return nearest if lengths[nearest] < min(_CLOSE * np.median(lengths), _SMALL) else None


def _close_waypoints(waypoints: PathWaypoints, shape: ShapeReport, keys: str) -> str | None:
    """Return a warning of two nearly coincident waypoints, whose direction is random."""
    nearest = coincident_waypoint(waypoints.positions)
    if nearest is None:
        return None
    lengths = np.linalg.norm(np.diff(waypoints.positions, axis=0), axis=1)
    usual = float(np.median(lengths))
    return (
        f"waypoints {nearest + 1} and {nearest + 2} are {1e6 * lengths[nearest]:.3g} um apart, "
        f"others {_length(usual)}: between them the path has a random direction, and bends with "
        f"a radius down to {1e6 * shape.smallest_radius:.3g} um: take one of the two out, or "
        f"write {keys}tolerance (m)"
    )


def _narrow_bend(path: Path, shape: ShapeReport, keys: str) -> str | None:
    waypoints = path.waypoints
    if waypoints is None:
        return None
    theta = path.arc_length.parameter(shape.smallest_radius_at)
    side = int(np.searchsorted(waypoints.parameters[1:-1], theta, side="right"))
    near = waypoints.positions[side : side + 2]
    chord = float(np.linalg.norm(near[-1] - near[0]))
    if shape.smallest_radius >= _NARROW * chord:
        return None
    return (
        f"the path bends with a radius of {_length(shape.smallest_radius)} at eta = "
        f"{shape.smallest_radius_at:.4g} m, where waypoints are {_length(chord)} apart: add "
        f"waypoints there, write {keys}tolerance (m) if they are noisy, or "
        f"{keys}corner_distance (m) if they are corners"
    )


def _fast_turn(path: Path, shape: ShapeReport) -> str | None:
    rate = shape.largest_angle_rate
    if rate is None or path.orientation is None or rate < _FAST:
        return None
    usual, beside = 1.0 / shape.smallest_radius, "the path itself bends"
    if path.waypoints is not None:
        theta = path.waypoints.parameters
        q = path.orientation.derivatives(theta, 0)[:, 0]
        q = q / np.linalg.norm(q, axis=1, keepdims=True)
        cosines = np.abs(np.sum(q[1:] * q[:-1], axis=1))
        turns = 2.0 * np.arccos(np.minimum(1.0, cosines))
        lengths = np.abs(np.diff(path.arc_length(theta)))
        apart = lengths > 0.5 * np.median(lengths)
        usual = float(np.max(turns[apart] / lengths[apart], initial=usual))
        beside = "its waypoints require"
    if rate < _FASTER * usual:
        return None
    return (
        f"the orientation turns by {rate:.3g} rad/m at eta = {shape.largest_angle_rate_at:.4g} m, "
        f"while {beside} at most {usual:.3g} rad/m: add orientations there"
    )


def _length(value: float) -> str:
    return f"{value * 1e3:.3g} mm" if value > 1e-6 else "0 mm"


def _round_up(value: float) -> float:
    """Return a value rounded up to one digit."""
    unit = 10.0 ** math.floor(math.log10(value)) if value > 0.0 else 1.0
    return math.ceil(value / unit) * unit
