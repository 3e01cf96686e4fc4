"""Messages of waypoints: the last ones are repeated, so that none is missed."""

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.control.streams.growing_path import POSE, POSITION
from pfsc_drake.errors import InputError, require


class StreamStatus(IntEnum):
    """State of a stream of waypoints."""

    WAITING = 0
    RUNNING = 1
    ENDING = 2
    TURNING = 3
    MISSED = 4
    REFUSED = 5
    BEGUN_ANEW = 6

    @property
    def words(self) -> str:
        """Description for the user."""
        return _WORDS[self]


_WORDS = {
    StreamStatus.WAITING: "rests at the last waypoint, and waits for more",
    StreamStatus.RUNNING: "follows",
    StreamStatus.ENDING: "goes to the last waypoint: no more arrived",
    StreamStatus.TURNING: "rests where the path turns too sharply, and goes on from there",
    StreamStatus.MISSED: "stops at the last waypoint received: later ones were missed",
    StreamStatus.REFUSED: "stops before a waypoint that is NaN, infinite, or out of bounds",
    StreamStatus.BEGUN_ANEW: "stops at the last waypoint: its sender restarted the count",
}


class WaypointLayout:
    """Layout of a message of the last M waypoints: ``[total, ended, row, row, ..]``.

    A row is ``[x, y, z, new]`` or ``[x, y, z, qw, qx, qy, qz, new]`` [m]; ``new`` is 1 for the
    first waypoint of a new path, which replaces the rest of the old one. The newest row comes last;
    rows before the first waypoint are zero. A lost message has no effect if at most M waypoints
    arrive until the next one.

    Args:
        dimension: Size of a waypoint, 3 or 7.
        length: Number M of rows.

    Attributes:
        dimension: Size of a waypoint, 3 or 7.
        length: Number M of rows.
        size: Length of a message.
    """

    def __init__(self, dimension: int, length: int = 32) -> None:
        require(dimension in (POSITION, POSE), "dimension", dimension, f"{POSITION} or {POSE}")
        require(length >= 1, "length", length, "1 or more")
        self.dimension, self.length = dimension, length
        self.size = 2 + (dimension + 1) * length


class WaypointSender:
    """Collects waypoints and creates messages, beginning with those that have not been taken yet.

    Args:
        layout: Layout of the messages.
        lower: Smallest coordinates [m], three; none if empty.
        upper: Largest coordinates [m], three; none if empty.

    Attributes:
        taken: Number of waypoints taken, as reported by the stream; messages then contain the next
            ones, at most M. None to send the last ones always.
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
        """Number of waypoints so far."""
        return len(self._rows)

    @property
    def message(self) -> np.ndarray:
        """Newest message, shape (size,)."""
        count, length = self.total, self._layout.length
        if self.taken is not None:
            count = min(count, self.taken + length)
        rows = np.zeros((length, self._layout.dimension + 1))
        last = self._rows[max(0, count - length) : count]
        if last:
            rows[-len(last) :] = last
        ended = self._ended and count == self.total
        return np.concatenate([[count, float(ended)], rows.ravel()])

    def add(self, waypoint: ArrayLike, *, new_path: bool = False) -> None:
        """Add a waypoint.

        Args:
            waypoint: ``[x, y, z]`` [m], or with a quaternion (w, x, y, z), by the layout.
            new_path: Whether a new path begins with it.

        Raises:
            InputError: If it is NaN, infinite, or out of bounds.
        """
        values, number = np.asarray(waypoint, dtype=float), self.total + 1
        if values.shape != (self._layout.dimension,) or not np.isfinite(values).all():
            raise InputError(
                f"waypoint {number}: {values.tolist()}; must be {self._layout.dimension} finite "
                "numbers"
            )
        lower, upper = self._bounds
        below = lower.size > 0 and bool(np.any(values[:3] < lower))
        if below or (upper.size > 0 and bool(np.any(values[:3] > upper))):
            raise InputError(
                f"waypoint {number}: {np.round(values[:3], 6).tolist()} m; must be from "
                f"{lower.tolist()} to {upper.tolist()} m"
            )
        self._ended = False
        self._rows.append([*values.tolist(), float(new_path)])

    def end(self) -> None:
        """Announce that there are no more waypoints for now."""
        self._ended = True
