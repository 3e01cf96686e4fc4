"""Path following along waypoints that come while the tool moves."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.streams.stream_course import POSITION
from pfsc_drake.controller.tasks.streamed_path import StreamedPath
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError, require
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.physics.hand_way import Place


class StreamTask(Task):
    """Path following along waypoints that come while the tool moves.

    Args:
        path: The path.
        angles: Choice of the orientation's coordinates, see :class:`PathManifold`.
        rotation_deg: ZYX angles of the tool at the start from the path's orientation [deg].
        duration: Duration of the run [s], if it ends.

    Attributes:
        path: The path.
    """

    projector_name = "path_projector"
    place: PathManifold

    def __init__(
        self,
        path: StreamedPath,
        angles: dict[str, Any] | None = None,
        *,
        rotation_deg: Sequence[float] = (0.0, 0.0, 0.0),
        duration: float | None = None,
    ) -> None:
        self.path, self._rotation_deg, self.warnings = path, rotation_deg, []
        self.place = PathManifold(path.course.order, oriented=path.is_oriented, **(angles or {}))
        self.manifold, self.motion = self.place, None
        if duration is not None:
            self.motion = PiecewisePolynomialCurve([0.0, duration], np.zeros((1, 1, 1)))

    @property
    def is_planned(self) -> bool:
        """False: waypoints come while the tool moves."""
        return False

    @property
    def projecting(self) -> Block:
        """Block that finds the closest point on the path."""
        return self.path.projector

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point where the path begins, the only one that is known beforehand."""
        return self.path.point

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return where the tool starts."""
        target = self.path.target
        posed = self._target(target.y_t + shift, target.R_e, self._rotation_deg)
        return StartPoint(posed, self.path.point[self.place.layout.memory])

    def way(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield the start alone: waypoints decide on the rest."""
        yield self.path.start[:POSITION], "start"

    @property
    def target(self) -> Place:
        """Refused: no frame of the path is known beforehand."""
        raise InputError("path.shape = !Streamed: no frame of it is known beforehand")

    def check_place(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates: none are known beforehand."""
        require(False, key, coordinates.tolist(), "none on a path whose waypoints come")
