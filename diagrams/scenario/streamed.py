"""A path whose waypoints come while the tool moves. Lengths in m, angles in degrees."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.checks import require
from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.yaml.fields import FILE
from pfsc_drake.yaml.rules import Direction, NotNegative, Numbers, Parameters, Point, Range

_RATES = (0.01, 1000.0)  # 1/s
_MOST_WAYPOINTS = 1024  # of a message


@dc.dataclass
class NewPath(Parameters):
    """A new path that the tool changes to while it moves.

    Attributes:
        file: CSV file with its waypoints, in the format of the stream's file.
        at: Time of its first waypoint [s]; further waypoints of the path before are dropped.
    """

    file: str = dc.field(default="", metadata=FILE)
    at: NotNegative = 1.0


@dc.dataclass
class DrawnPlane(Parameters):
    """A rectangle in space in which a person draws, in a browser.

    Attributes:
        origin: Its middle, the start of the tool [m].
        right: Direction to the right on the page, of any length.
        up: Direction upwards on the page, at least 0.1 deg from ``right``; only its part
            perpendicular to ``right`` counts.
        width: Width along ``right`` [m].
        height: Height along ``up`` [m].
        zyx_deg: ZYX angles [deg] of the constant orientation of the tool; empty for none.
    """

    origin: Point = dc.field(default_factory=lambda: [0.9, 0.0, 1.0])
    right: Direction = dc.field(default_factory=lambda: [0.0, -1.0, 0.0])
    up: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    width: Annotated[float, Range(0.01, 100.0, "m")] = 0.6
    height: Annotated[float, Range(0.01, 100.0, "m")] = 0.4
    zyx_deg: Annotated[list[float], Numbers(3, empty=True)] = dc.field(default_factory=list)


@dc.dataclass
class Streamed(Parameters):
    """A path whose waypoints come one after the other while the tool moves.

    Attributes:
        file: CSV file with the waypoints, in the format of ``!Waypoints``; the tool starts at the
            first one. Empty where ``inputs`` or ``plane`` are given.
        rate: Waypoints per second [1/s].
        begin: Time at which the first one is sent [s].
        delay: Delay of each [s].
        jitter: Largest further delay [s]; the order is preserved.
        noise: Standard deviation of each coordinate [m].
        seed: Seed of jitter and noise.
        new_paths: Further paths, one after the other.
        plane: Plane in which a person draws, in ``live``.
        inputs: CSV file with a drawing, written by a live session. Its column ``time`` is in s;
            ``tick``, of older files, counts sampling intervals.
        length: Number of waypoints in a message.
        follow: Construction of the path from waypoints, and the speed along it.
    """

    file: str = dc.field(default="", metadata=FILE)
    rate: Annotated[float, Range(*_RATES, "1/s")] = 10.0
    begin: NotNegative = 0.5
    delay: NotNegative = 0.0
    jitter: NotNegative = 0.0
    noise: NotNegative = 0.0
    seed: Annotated[int, Range(0)] = 1
    new_paths: list[NewPath] = dc.field(default_factory=list)
    plane: DrawnPlane | None = None
    inputs: str = dc.field(default="", metadata=FILE)
    length: Annotated[int, Range(1, _MOST_WAYPOINTS)] = 32
    follow: StreamParameters = dc.field(default_factory=StreamParameters)

    def check(self) -> None:
        """Refuse combinations of keys that exclude each other.

        Raises:
            InputError: If there is such a combination.
        """
        one = bool(self.file) != (self.plane is not None)
        require(one, "file", self.file or "none given", "a file, or a plane to draw in")
        drawn = not self.inputs or self.plane is not None
        require(drawn, "inputs", self.inputs, "none without the plane that was drawn in")
