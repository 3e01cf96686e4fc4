"""Choices about a file of points: unit, closed or open, orientation."""

from pathlib import Path

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import read_waypoints
from pfsc_drake.geometry.files.number_table import UNITS, metres
from pfsc_drake.geometry.paths.path_smoothing import allows_tolerance
from pfsc_drake.geometry.paths.path_warnings import (
    coincident_waypoint,
    noise_tolerance,
    overshoots,
)
from pfsc_drake.geometry.paths.shape_report import shape_report
from pfsc_drake.geometry.paths.waypoints import (
    MAX_INTERPOLATED,
    WaypointTable,
    path_from_waypoints,
)

# orientations of the tool in the world [deg] about z, y, x, where the file has none: directions of
# its z axis, each with quarter turns about that axis
POINTING = {
    "down": ([0.0, 0.0, 180.0], [180.0, 0.0, 180.0], [90.0, 0.0, 180.0], [-90.0, 0.0, 180.0]),
    "forward": ([0.0, 90.0, 0.0], [0.0, -90.0, 180.0], [90.0, 0.0, 90.0], [-90.0, 0.0, -90.0]),
    "up": ([0.0, 0.0, 0.0], [180.0, 0.0, 0.0], [90.0, 0.0, 0.0], [-90.0, 0.0, 0.0]),
}
FREE = "free"
_CLOSED = 1e-6  # of the length
_LIKELY = ("m", "cm", "mm")
_SMALLEST = 0.01  # of the reach
_SPARSE = 8  # points, below which a spline through them is no smooth path
_LONGEST_BLEND = 0.02  # m
_JUDGED = 2000  # points, the first ones, that show whether a recording is noisy
_LEAST_TOLERANCE = 1e-4  # m
_COARSEST = 0.02  # tolerance, of the length; larger ones would alter the path


class PointsChoice:
    """Points that a tool is to follow.

    Args:
        file: CSV file, see :func:`~pfsc_drake.geometry.paths.waypoints.read_waypoints`.
        unit: Unit of its positions; empty to choose it.
        base: Position of the first joint [m], shape (3,).
        reach: Largest distance of the tool from there [m].

    Attributes:
        unit: Unit of its positions.
        length: Length of the polygon through the points [m].
        is_closed: Whether the last point is the first one.
        corner_distance: Distance from the corners at which straight lines are blended [m]; 0 for
            a spline through all points.
        tolerance: Largest distance of a smooth path from noisy points [m]; 0 for a path through
            all points.
        has_orientation: Whether it has columns of orientation.
        reasons: A phrase on each choice, by ``unit``, ``closed``, ``corner_distance`` and
            ``tolerance``.

    Raises:
        InputError: If the file cannot be read, or no unit puts the points into reach.
    """

    def __init__(self, file: str, unit: str, base: np.ndarray, reach: float) -> None:
        self.file, self.reasons = file, dict[str, str]()
        if unit and unit not in UNITS:
            raise InputError(f"--unit {unit}: allowed: {', '.join(UNITS)}")
        table = read_waypoints(Path(file))
        farthest = {
            name: float(np.linalg.norm(metres(name) * table.positions - base, axis=1).max())
            for name in UNITS
        }
        different = len(np.unique(table.positions, axis=0))
        if different < 2:
            raise InputError(f"{file}: {different} point; allowed: 2 different points or more")
        size = float(np.ptp(table.positions, axis=0).max())
        self.unit = unit or self._choose_unit(farthest, size, reach)
        if not unit and self.unit != "m":
            self.reasons["unit"] = (
                f"in m the points would be up to {farthest['m']:.4g} m away, in {self.unit} they "
                f"are up to {farthest[self.unit]:.4g} m away; the robot reaches {reach:.4g} m"
            )
        positions = metres(self.unit) * table.positions
        edges = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        self.length, self.corner_distance, self.tolerance = float(edges.sum()), 0.0, 0.0
        gap = float(np.linalg.norm(positions[-1] - positions[0]))
        self.is_closed = len(positions) > 3 and gap <= _CLOSED * self.length
        if self.is_closed:
            self.reasons["closed"] = "the last point is the first one"
        if table.parameters is None:
            self._choose_smoothing(positions, edges)
        self.has_orientation = table.quaternions is not None
        self.yaw_alone = table.yaw_alone

    def _choose_unit(self, farthest: dict[str, float], size: float, reach: float) -> str:
        """Return m, cm or mm, the first one with which all points are within reach.

        Points in mm that are within reach as cm would surround the first joint.
        """
        for name in _LIKELY:
            large_enough = name == "m" or metres(name) * size >= _SMALLEST * reach
            if farthest[name] <= reach and large_enough:
                return name
        raise InputError(
            f"{self.file}: the points are up to {farthest['m']:.4g} m from the robot's first "
            f"joint, or {farthest['mm']:.4g} m if they are in mm; the robot reaches {reach:.4g} m; "
            "allowed: points within reach; --base-position X,Y,Z places the robot, --unit names "
            "another unit"
        )

    def _choose_smoothing(self, positions: np.ndarray, edges: np.ndarray) -> None:
        """Choose a spline through all points, a smooth path near them, or rounded corners."""
        count = len(positions)
        if 2 < count < _SPARSE:
            self._round_corners(edges, f"{count} points")
            return
        try:
            path = path_from_waypoints(WaypointTable(positions[:_JUDGED]), smoothness=2)
        except InputError:
            return  # building the scenario reports what is wrong
        tolerance, near = noise_tolerance(path), coincident_waypoint(positions)
        if tolerance is not None and tolerance <= _COARSEST * self.length:
            reason = "noisy points: a spline through all would bend to and fro"
        elif near is not None:
            tolerance = _LEAST_TOLERANCE
            reason = f"points {near + 1} and {near + 2} nearly coincide"
        elif count > MAX_INTERPOLATED:
            tolerance = _LEAST_TOLERANCE
            reason = f"{count} points; a spline through all is limited to {MAX_INTERPOLATED}"
        elif count > 2 and overshoots(shape_report(path)):
            self._round_corners(edges, "a spline would leave the lines between the points")
            return
        else:
            return
        self._smooth(positions, tolerance, reason)

    def _round_corners(self, edges: np.ndarray, why: str) -> None:
        self.corner_distance = float(f"{min(_LONGEST_BLEND, 0.3 * edges.min()):.1g}")
        self.reasons["corner_distance"] = f"{why}: straight lines with rounded corners"

    def _smooth(self, positions: np.ndarray, tolerance: float, reason: str) -> None:
        """Choose a tolerance [m], if the points reach far enough for it."""
        if not allows_tolerance(positions, tolerance, self.is_closed):
            return
        try:
            smooth = path_from_waypoints(
                WaypointTable(positions),
                smoothness=2,
                closed=self.is_closed,
                tolerance=tolerance,
            )
        except InputError:
            return
        self.tolerance, self.length, self.reasons["tolerance"] = tolerance, smooth.length, reason

    def orientations(self, joints: int, chosen: str) -> list[tuple[dict[str, object], str]]:
        """Return settings of ``path.orientation`` to try in turn, and a phrase on each.

        Args:
            joints: Number of joints.
            chosen: ``down``, ``forward``, ``up`` or ``free``; empty to try one after the other.

        Raises:
            InputError: If the choice contradicts the file.
        """
        if chosen and chosen not in (*POINTING, FREE):
            raise InputError(f"--orientation {chosen}: allowed: {', '.join((*POINTING, FREE))}")
        if chosen in POINTING and self.has_orientation and not self.yaw_alone:
            raise InputError(
                f"--orientation {chosen}: {self.file} has columns of orientation; allowed: "
                f"{FREE}, or leave it out"
            )
        free: tuple[dict[str, object], str] = {"task": "none"}, "the position alone is followed"
        if joints <= 3 or chosen == FREE:
            return [free]
        task = {4: "yaw", 5: "tool_axis"}.get(joints, "full")
        words = {"yaw": "the turn about the vertical", "tool_axis": "the tool's z axis"}
        followed = f"{joints} joints follow {words.get(task, 'the whole orientation')}"
        own: dict[str, object] = {} if task == "full" else {"task": task}
        if self.has_orientation and not self.yaw_alone:
            return [(own, f"the file has it; {followed}")]
        found = [
            (own | {"keyframes": [{"angles_deg": angles}]}, f"z axis {name}; {followed}")
            for name in ([chosen] if chosen else POINTING)
            # a turn about the axis is free, or that of the file
            for angles in POINTING[name][: 1 if task == "tool_axis" or self.yaw_alone else None]
        ]
        return found if chosen or self.yaw_alone else [*found, free]
