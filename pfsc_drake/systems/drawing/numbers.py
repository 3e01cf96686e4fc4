"""Numbers in a scene, drawn as strokes: Meshcat has no text, and thin lines only."""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Meshcat, Rgba

_INK = Rgba(0.85, 0.05, 0.3, 1.0)
_BOLD = 0.07  # half the width of a stroke, in heights
_PITCH = 0.85  # from one digit to the next, in heights
# corners of a digit, across and up in heights: from the lower left one to the upper right one
_CORNERS = np.array([[0.0, 0.0], [0.55, 0.0], [0.0, 0.5], [0.55, 0.5], [0.0, 1.0], [0.55, 1.0]])
_STROKES = {
    "0": (0, 1, 1, 5, 5, 4, 4, 0),
    "1": (1, 5),
    "2": (4, 5, 5, 3, 3, 2, 2, 0, 0, 1),
    "3": (4, 5, 5, 1, 1, 0, 2, 3),
    "4": (4, 2, 2, 3, 5, 1),
    "5": (5, 4, 4, 2, 2, 3, 3, 1, 1, 0),
    "6": (5, 4, 4, 0, 0, 1, 1, 3, 3, 2),
    "7": (4, 5, 5, 1),
    "8": (0, 1, 1, 5, 5, 4, 4, 0, 2, 3),
    "9": (3, 2, 2, 4, 4, 5, 5, 1, 1, 0),
}


@dataclass(frozen=True, eq=False)
class SceneNumber:
    """A number that stands upright in a scene.

    Attributes:
        number: Zero or a positive integer.
        base: Middle of its lower edge [m], shape (3,).
        across: Unit vector of the reading direction, shape (3,).
        height: Height [m].
    """

    number: int
    base: np.ndarray
    across: np.ndarray
    height: float

    def strokes(self) -> np.ndarray:
        """Return its strokes along z: starts, then ends [m], shape (2, strokes, 3)."""
        digits = str(self.number)
        flat = np.concatenate(
            [_CORNERS[list(_STROKES[digit])] + [_PITCH * k, 0.0] for k, digit in enumerate(digits)]
        )
        flat[:, 0] -= (_PITCH * (len(digits) - 1) + _CORNERS[1, 0]) / 2.0
        axes = np.stack([self.across, [0.0, 0.0, 1.0]])
        points = self.base + self.height * flat @ axes
        return np.stack([points[0::2], points[1::2]])

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        """Return flat bars, visible from both sides: vertices [m] (K, 3), triangles (M, 3)."""
        starts, ends = self.strokes()
        bold = _BOLD * self.height
        along = (ends - starts) / np.linalg.norm(ends - starts, axis=1, keepdims=True)
        aside = bold * np.cross(np.cross(self.across, [0.0, 0.0, 1.0]), along)
        first, last = starts - bold * along, ends + bold * along
        corners = np.stack([first - aside, last - aside, last + aside, first + aside], axis=1)
        halves = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]])
        triangles = 4 * np.arange(len(starts))[:, np.newaxis, np.newaxis] + halves
        return corners.reshape(-1, 3), triangles.reshape(-1, 3)

    def draw(self, meshcat: Meshcat, path: str) -> None:
        """Draw the number.

        Args:
            meshcat: Meshcat instance.
            path: Meshcat path of the number, which moves with its parents.
        """
        vertices, triangles = self.mesh()
        meshcat.SetTriangleMesh(path, vertices.T, triangles.T, _INK)
