"""A person draws in a plane, and the station gets way points."""

from collections import deque

import numpy as np

from diagrams.station import Station
from diagrams.tasks.arrivals import END, NEW_PATH, WAY_POINT, Event, drawn_text, tell
from diagrams.tasks.drawn_plane import plane_axes
from diagrams.tasks.streaming import ScenarioStream
from pfsc_drake.control.streams.course import POSITION
from pfsc_drake.control.streams.messages import StreamStatus, WaypointSender

DRAWING = "drawing.csv"


class Pen:
    """Makes way points of places in a plane, and tells them as fast as the station takes them.

    Args:
        task: What is drawn.
    """

    def __init__(self, task: ScenarioStream) -> None:
        assert task.plane is not None
        self._task, self._plane = task, task.plane
        self._axes, self._origin = plane_axes(task.plane), np.array(task.plane.origin)
        self.restart()

    @classmethod
    def of(cls, station: Station) -> "Pen | None":
        """Return the pen of a station in which somebody draws, if anybody does.

        Args:
            station: The station.
        """
        task = station.task
        return cls(task) if isinstance(task, ScenarioStream) and task.plane is not None else None

    def restart(self) -> None:
        """Begin with an empty plane."""
        self._sender = WaypointSender(self._task.path.messages)
        self._waiting, self._events = deque[tuple[int, np.ndarray]](), list[Event]()

    def draw(self, places: list[list[float]]) -> None:
        """Take over what was drawn.

        Args:
            places: Each ``[right, up, kind]`` [m, m, 1], from the plane's middle on.
        """
        half = np.array([self._plane.width, self._plane.height]) / 2.0
        for right, up, kind in places:
            # a pen that leaves the plane draws along its border
            inside = np.clip([right, up], -half, half)
            pose = self._task.path.start.copy()
            pose[:POSITION] = self._origin + inside @ self._axes
            known = int(kind) if kind in (WAY_POINT, NEW_PATH, END) else WAY_POINT
            if known == NEW_PATH:
                # of what waits nothing will come
                self._waiting.clear()
            self._waiting.append((known, pose))

    def message(self, tick: int, taken: int) -> np.ndarray:
        """Return what is told from a tick on, shape (size,).

        Args:
            tick: Number of the sampling interval.
            taken: How many way points the station has taken.
        """
        while self._waiting and self._sender.total - taken < self._task.path.messages.length:
            kind, pose = self._waiting.popleft()
            event = Event(tick, kind, pose)
            self._events.append(event)
            tell(self._sender, event)
        return self._sender.message

    def text(self) -> str:
        """Return the content of a file that :func:`~diagrams.tasks.arrivals.read_drawn` reads."""
        return drawn_text(self._events, len(self._task.path.start), self._task.period)

    def content(self, y_t: np.ndarray, stream: np.ndarray) -> dict[str, object]:
        """Return what a page shows, for JSON.

        Args:
            y_t: Tool point [m], shape (3,).
            stream: What the station tells of way points, see
                :class:`~pfsc_drake.control.streams.intake.WaypointIntake`.
        """
        return {
            "size": [self._plane.width, self._plane.height],
            "tool": (self._axes @ (y_t - self._origin)).tolist(),
            "status": StreamStatus(int(stream[0])).words,
            "taken": int(stream[1]),
            "told": self._sender.total + sum(kind != END for kind, _ in self._waiting),
            "left": float(stream[2]),
        }
