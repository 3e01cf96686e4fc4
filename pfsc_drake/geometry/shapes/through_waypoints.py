"""Paths through waypoints of a file, or near them."""

import dataclasses as dc
import math
from typing import Annotated, Literal, cast

import numpy as np

from pfsc_drake.checks import FARTHEST, SHORTEST, require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import UNITS, Unit
from pfsc_drake.geometry.paths.geometric_path import Path
from pfsc_drake.geometry.paths.path_warnings import far_waypoints, turning_back
from pfsc_drake.geometry.paths.waypoints import (
    Tolerance,
    WaypointTable,
    path_from_waypoints,
    read_waypoints,
)
from pfsc_drake.geometry.rotation import (
    EULER_TO_QUATERNION,
    matrix_to_quaternion,
    quaternion_to_matrix,
    rotation_to_axis,
    rotation_vector_to_quaternion,
)
from pfsc_drake.geometry.shapes.path_shapes import PathShape
from pfsc_drake.geometry.shapes.shape import ShapeInputs
from pfsc_drake.geometry.shapes.tool_orientation import OrientationParameters
from pfsc_drake.yaml.fields import FILE
from pfsc_drake.yaml.rules import OneOf, Parameters, Range

_SHORTEST_TOLERANCE = 1e-7  # m


@dc.dataclass
class Waypoints(Parameters, PathShape):
    """A path through the waypoints of a CSV file, or near them; orientation included.

    It is a spline through all of them, unless ``tolerance`` or ``corner_distance`` is given.
    Columns of the file: ``x, y, z``; if it has an orientation, ``zyx_1, zyx_2, zyx_3``,
    ``zyz_1, ...`` or ``roll, pitch, yaw`` [rad], ``zyx_deg_1, ...``, ``zyz_deg_1, ...`` or
    ``roll_deg, ...`` [deg], the rotation vector ``rx, ry, rz`` [rad], ``qw, qx, qy, qz``, or
    ``r11, r12, ..., r33``; for the task ``yaw`` the turn ``yaw`` or ``yaw_deg`` alone, which a
    single keyframe, the tool's tilt, may go with; see :func:`read_waypoints`.

    Attributes:
        file: CSV file, relative to the scenario's folder.
        unit: Unit of ``x, y, z``: ``m``, ``cm``, ``mm``, ``inch``.
        closed: Whether the path is closed.
        parametrization: ``chord`` or ``centripetal``, of a spline through all waypoints.
        smoothness: Class C^k of the spline; 0 chooses the class that the law needs.
        tolerance: For noisy points: the smoothest path that misses none by more than this
            [m]; zero goes through all of them.
        tolerance_deg: The same for the orientation [deg], with a ``tolerance``.
        corner_distance: For sparse corners: straight lines from point to point, blended up
            to this distance from each corner [m], 1e-4 or more and at most over half a line;
            zero for none.
    """

    file: str = dc.field(default="", metadata=FILE)
    unit: Annotated[str, OneOf(tuple(UNITS))] = "m"
    closed: bool = False
    parametrization: Annotated[str, OneOf(("chord", "centripetal"))] = "chord"
    smoothness: Annotated[int, Range(0, 6)] = 0
    tolerance: Annotated[float, Range(_SHORTEST_TOLERANCE, FARTHEST, "m", besides=0.0)] = 0.0
    tolerance_deg: Annotated[float, Range(0.001, 90.0, "deg")] = 1.0
    # blends shorter than any path are useless, and slow to tabulate
    corner_distance: Annotated[float, Range(SHORTEST, FARTHEST, "m", besides=0.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        both = self.tolerance > 0.0 and self.corner_distance > 0.0
        require(not both, "corner_distance", self.corner_distance, "0 where tolerance is given")

    def path(self, orientation: OrientationParameters, inputs: ShapeInputs) -> Path:
        """Return the path, with the orientation that it has."""
        keyframes = orientation.keyframes
        table = read_waypoints(inputs.folder / self.file, inputs.progress, cast(Unit, self.unit))
        if table.yaw_alone:
            table = _with_tilt(table, orientation, self.file)
            keyframes = []
        if keyframes and table.quaternions is not None:
            raise InputError(
                f"path.orientation.keyframes: {len(keyframes)} given, and {self.file} has columns "
                "of orientation too: leave out the keyframes or the columns"
            )
        tolerance = None
        if self.tolerance > 0.0:
            tolerance = Tolerance(self.tolerance, math.radians(self.tolerance_deg))
        smoothness = self.smoothness or inputs.smoothness
        try:
            path = path_from_waypoints(
                table,
                smoothness=smoothness,
                closed=self.closed,
                parametrization=cast(Literal["chord", "centripetal"], self.parametrization),
                tolerance=tolerance,
                corner_distance=self.corner_distance or None,
                progress=inputs.progress,
            )
        except InputError as error:
            # keys name themselves
            prefix = "" if str(error).startswith("path.") else f"{self.file}: "
            hint = self._hint(table.positions, smoothness)
            raise InputError("; ".join(filter(None, [f"{prefix}{error}", hint]))) from None
        if not keyframes:
            return path
        along = orientation.along(path.position, inputs.smoothness)
        return Path(path.position, along, waypoints=path.waypoints, notes=path.notes)

    def _hint(self, positions: np.ndarray, smoothness: int) -> str | None:
        """Return a remedy where there is no path through waypoints."""
        hint = far_waypoints(positions)
        if hint is None and len(positions) == 2:
            start, end = (np.round(point, 6).tolist() for point in positions)
            hint = f"for a straight line write path.shape: !Line {{start: {start}, end: {end}}}"
        if hint is None and 2 < len(positions) < smoothness + 2:
            hint = (
                f"add waypoints to {self.file}, or write path.shape.corner_distance (m) for "
                "straight lines with rounded corners"
            )
        # a path of straight lines reports its turns itself
        if hint is None and not (self.corner_distance or self.tolerance):
            hint = turning_back(positions)
        return hint


def _with_tilt(
    table: WaypointTable, orientation: OrientationParameters, file: str
) -> WaypointTable:
    """Return waypoints that only have a turn, with the tilt of a keyframe."""
    if orientation.task not in ("yaw", "none"):
        raise InputError(
            f"{file}: column yaw alone, with path.orientation.task = {orientation.task}; roll and "
            "pitch besides, or path.orientation.task: yaw, are required"
        )
    if len(orientation.keyframes) > 1:
        raise InputError(
            f"path.orientation.keyframes: {len(orientation.keyframes)} given, and {file} has a "
            "column of yaw; at most one, the tool's tilt, is allowed"
        )
    assert table.quaternions is not None
    half = np.arctan2(table.quaternions[:, 3], table.quaternions[:, 0])
    axis = rotation_to_axis(orientation.yaw_axis)[:, 0]
    turns = quaternion_to_matrix(rotation_vector_to_quaternion(2.0 * half[:, None] * axis))
    angles = [keyframe.angles_deg for keyframe in orientation.keyframes] or [[0.0, 0.0, 0.0]]
    tilt = quaternion_to_matrix(EULER_TO_QUATERNION[orientation.convention](np.deg2rad(angles))[0])
    return dc.replace(table, quaternions=matrix_to_quaternion(turns @ tilt), yaw_alone=False)
