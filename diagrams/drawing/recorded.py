"""What a recording draws of a run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.obstacles.shapes import ObstacleShape


@dataclass(frozen=True)
class RecordedPushes:
    """What pushes K points of a robot, at the recording's frames.

    Attributes:
        points: Where [m], shape (frames, 3K).
        forces: World axes [N], shape (frames, 3K).
    """

    points: np.ndarray
    forces: np.ndarray


@dataclass(frozen=True)
class RecordedDistance:
    """The tool's distance from a surface, at the recording's frames.

    Attributes:
        values: Signed [m], shape (frames,).
        largest: Magnitude that has full colour [m], positive.
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
        """Return points of the workpiece where it is at the first frame [m], shape (K, 3).

        Args:
            points: Points in its frame [m], shape (K, 3).
        """
        pose = self.workpiece_pose[0]
        return np.asarray(pose[:3] + points @ pose[3:].reshape(3, 3).T)


@dataclass(frozen=True)
class RecordedObstacles:
    """Obstacles, at the recording's frames.

    Attributes:
        positions: Of K obstacles [m], shape (frames, 3K).
        shapes: What they are.
        margin: Distance that is kept from them [m].
    """

    positions: np.ndarray
    shapes: Sequence[ObstacleShape]
    margin: float


@dataclass(frozen=True)
class RecordedMotion:
    """What a log holds of a motion, at the recording's frames.

    Attributes:
        times: Times of the frames [s], shape (frames,), increasing from 0.
        positions: The plant's positions, shape (frames, nq).
        tool_pose: ``[y_t, R_e]``, shape (frames, 12).
        manifold_point: The manifold next to the tool, shape (frames, layout.size).
        elbow: A point of the arm whose way is drawn, too [m], shape (frames, 3).
        pushes: What pushes its links, or a hand far away, where that has the tool.
        distance: What the colour of the tool's way tells; of one colour without.
        tool_force: What acts on the tool point, world axes [N], shape (frames, 3).
        trail: Where the tool's way is drawn [m], shape (frames, 3), if not where it is.
        region_clock: Region clock of regions that move [s], shape (frames,).
        plates: ``[p, R by rows]`` of K plates, shape (frames, 12 K).
        held: What a robot does that holds the workpiece; ``tool_pose``, ``manifold_point`` and
            ``trail`` are then seen from the workpiece's frame.
        obstacles: What moves across the path.
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
    held: RecordedHolder | None = None
    obstacles: RecordedObstacles | None = None
