"""Path following along waypoints that are received while the tool moves."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.streams.growing_path import POSITION
from pfsc_drake.controller.tasks.streamed_path import StreamedPath
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError, require
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.physics.hand_path import CoordinateMap


class StreamTask(Task):
    """Path following along waypoints that are received while the tool moves.

    Args:
        path: The path.
        angles: Choice of the orientation's coordinates, see :class:`PathManifold`.
        rotation_deg: ZYX angles of the tool at the start from the path's orientation [deg].
        duration: Duration of the run [s], if it is finite.

    Attributes:
        path: The path.
    """

    projector_name = "path_projector"
    projected_manifold: PathManifold

    def __init__(
        self,
        path: StreamedPath,
        angles: dict[str, Any] | None = None,
        *,
        rotation_deg: Sequence[float] = (0.0, 0.0, 0.0),
        duration: float | None = None,
    ) -> None:
        self.path, self._rotation_deg, self.warnings = path, rotation_deg, []
        self.projected_manifold = PathManifold(
            path.layout.order, oriented=path.is_oriented, **(angles or {})
        )
        self.manifold, self.motion = self.projected_manifold, None
        if duration is not None:
            self.motion = PiecewisePolynomialCurve([0.0, duration], np.zeros((1, 1, 1)))

    @property
    def is_planned(self) -> bool:
        """False: waypoints are received while the tool moves."""
        return False

    @property
    def projection_block(self) -> Block:
        """Block that finds the closest point on the path."""
        return self.path.projector

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the first point of the path, the only one known beforehand."""
        return self.path.point

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return the start of the tool."""
        target = self.path.target
        posed = self._target(target.y_t + shift, target.R_e, self._rotation_deg)
        return StartPoint(posed, self.path.point[self.projected_manifold.layout.memory])

    def tool_positions(self) -> Iterator[tuple[np.ndarray, str]]:
        """Iterate over the start alone: further waypoints are not known beforehand."""
        yield self.path.start[:POSITION], "start"

    @property
    def target(self) -> CoordinateMap:
        """Not available: the path is not known beforehand."""
        raise InputError("path.shape = !Streamed: no frame of the path is known beforehand")

    def check_coordinates(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates: none are known beforehand."""
        require(False, key, coordinates.tolist(), "none on a streamed path")
