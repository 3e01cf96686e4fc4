"""How way points are told: the last of them again and again, so that none is missed."""

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.control.streams.stream_course import POSE, POSITION
from pfsc_drake.errors import InputError, require


class StreamStatus(IntEnum):
    """What becomes of a stream of way points."""

    WAITING = 0
    RUNNING = 1
    ENDING = 2
    TURNING = 3
    MISSED = 4
    REFUSED = 5
    BEGUN_ANEW = 6

    @property
    def words(self) -> str:
        """What it means, for people."""
        return _WORDS[self]


_WORDS = {
    StreamStatus.WAITING: "rests at the last way point, and waits for more",
    StreamStatus.RUNNING: "follows",
    StreamStatus.ENDING: "goes to the last way point: no more came",
    StreamStatus.TURNING: "rests where the path turns too sharply, and goes on from there",
    StreamStatus.MISSED: "stops at the last way point that came: later ones were missed",
    StreamStatus.REFUSED: "stops before a way point that is no finite number, or out of bounds",
    StreamStatus.BEGUN_ANEW: "stops at the last way point: its sender began to count anew",
}


class WaypointLayout:
    """Layout of a message of the last M way points: ``[total, ended, row, row, ..]``.

    A row is ``[x, y, z, new]`` or ``[x, y, z, qw, qx, qy, qz, new]`` [m]; ``new`` is 1 for the
    first way point of a new path, for which what is not driven on yet of the path before is
    forgotten. The newest row comes last; before the first way points there are zeros. A message
    that is lost costs nothing as long as not more than M way points come before the next one.

    Args:
        dimension: 3 or 7.
        length: M.

    Attributes:
        dimension: 3 or 7.
        length: M.
        size: Length of a message.
    """

    def __init__(self, dimension: int, length: int = 32) -> None:
        require(dimension in (POSITION, POSE), "dimension", dimension, f"{POSITION} or {POSE}")
        require(length >= 1, "length", length, "1 or more")
        self.dimension, self.length = dimension, length
        self.size = 2 + (dimension + 1) * length


class WaypointSender:
    """Collects way points and tells them, those that have not been taken yet first.

    Args:
        layout: Layout of the messages.
        lower: Smallest coordinates [m], three; none if empty.
        upper: Largest coordinates [m], three; none if empty.

    Attributes:
        taken: How many way points have been taken, as far as the stream has told: more than a
            message holds are told only once there is room. None to tell the last ones, whoever
            hears.
    """

    def __init__(
        self, layout: WaypointLayout, lower: ArrayLike = (), upper: ArrayLike = ()
    ) -> None:
        self._layout, self._ended = layout, False
        self.taken: int | None = None
        self._rows: list[list[float]] = []
        self._bounds = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)

    @property
    def total(self) -> int:
        """How many way points there have been."""
        return len(self._rows)

    @property
    def message(self) -> np.ndarray:
        """What is to be told, shape (size,)."""
        told, length = self.total, self._layout.length
        if self.taken is not None:
            told = min(told, self.taken + length)
        rows = np.zeros((length, self._layout.dimension + 1))
        last = self._rows[max(0, told - length) : told]
        if last:
            rows[-len(last) :] = last
        ended = self._ended and told == self.total
        return np.concatenate([[told, float(ended)], rows.ravel()])

    def add(self, waypoint: ArrayLike, *, new_path: bool = False) -> None:
        """Tell one more way point.

        Args:
            waypoint: ``[x, y, z]`` [m], or with a quaternion (w, x, y, z), as the layout says.
            new_path: Whether a new path begins with it.

        Raises:
            InputError: If it is no finite number, or out of bounds.
        """
        values, number = np.asarray(waypoint, dtype=float), self.total + 1
        if values.shape != (self._layout.dimension,) or not np.isfinite(values).all():
            raise InputError(
                f"way point {number}: {values.tolist()}; must be {self._layout.dimension} finite "
                "numbers"
            )
        lower, upper = self._bounds
        below = lower.size > 0 and bool(np.any(values[:3] < lower))
        if below or (upper.size > 0 and bool(np.any(values[:3] > upper))):
            raise InputError(
                f"way point {number}: {np.round(values[:3], 6).tolist()} m; must be from "
                f"{lower.tolist()} to {upper.tolist()} m"
            )
        self._ended = False
        self._rows.append([*values.tolist(), float(new_path)])

    def end(self) -> None:
        """Tell that there will be no more for now."""
        self._ended = True
