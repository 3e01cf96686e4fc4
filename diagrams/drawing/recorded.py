"""Data of a run that its recording draws."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.obstacles.shapes import ObstacleShape


@dataclass(frozen=True)
class RecordedPushes:
    """Forces on K points of a robot, at the recording's frames.

    Attributes:
        points: Positions of the points [m], shape (frames, 3K).
        forces: Forces, world axes [N], shape (frames, 3K).
    """

    points: np.ndarray
    forces: np.ndarray


@dataclass(frozen=True)
class RecordedDistance:
    """The tool's distance from a surface, at the recording's frames.

    Attributes:
        values: Signed [m], shape (frames,).
        largest: Magnitude drawn in full colour [m], positive.
    """

    values: np.ndarray
    largest: float


@dataclass(frozen=True)
class RecordedHolder:
    """A workpiece that moves and the robot that holds it, at the recording's frames.

    Attributes:
        positions: Positions of its plant, shape (frames, nq); None where a turntable carries it.
        workpiece_pose: ``[p_WC, R_WC by rows]`` of the workpiece, shape (frames, 12).
    """

    positions: np.ndarray | None
    workpiece_pose: np.ndarray

    def first_points(self, points: np.ndarray) -> np.ndarray:
        """Return the positions of workpiece points at the first frame [m], shape (K, 3).

        Args:
            points: Points in its frame [m], shape (K, 3).
        """
        pose = self.workpiece_pose[0]
        return np.asarray(pose[:3] + points @ pose[3:].reshape(3, 3).T)


@dataclass(frozen=True)
class RecordedObstacles:
    """Obstacles, at the recording's frames.

    Attributes:
        positions: Positions of K obstacles [m], shape (frames, 3K).
        shapes: Their shapes.
        margin: Clearance from them [m].
    """

    positions: np.ndarray
    shapes: Sequence[ObstacleShape]
    margin: float


@dataclass(frozen=True)
class RecordedMotion:
    """Logged motion, at the recording's frames.

    Attributes:
        times: Times of the frames [s], shape (frames,), increasing from 0.
        positions: The plant's positions, shape (frames, nq).
        tool_pose: ``[y_t, R_e]``, shape (frames, 12).
        manifold_point: The manifold next to the tool, shape (frames, layout.size).
        elbow: Position of a point of the arm, drawn as a second trail [m], shape (frames, 3).
        pushes: Forces on its links, or the force of a leader device at the point that it commands.
        distance: Distance that colours the tool's trail; a trail of one colour without it.
        tool_force: Force on the tool point, world axes [N], shape (frames, 3).
        trail: Positions of the tool's trail [m], shape (frames, 3), if not those of ``tool_pose``.
        region_clock: Region clock of regions that move [s], shape (frames,).
        plates: ``[p, R by rows]`` of K plates, shape (frames, 12 K).
        holder: Motion of the workpiece and of the robot that holds it; ``tool_pose``,
            ``manifold_point`` and ``trail`` are then relative to the workpiece's frame.
        obstacles: Obstacles that cross the path.
    """

    times: np.ndarray
    positions: np.ndarray
    tool_pose: np.ndarray
    manifold_point: np.ndarray
    elbow: np.ndarray | None = None
    pushes: RecordedPushes | None = None
    distance: RecordedDistance | None = None
    tool_force: np.ndarray | None = None
    trail: np.ndarray | None = None
    region_clock: np.ndarray | None = None
    plates: np.ndarray | None = None
    holder: RecordedHolder | None = None
    obstacles: RecordedObstacles | None = None
