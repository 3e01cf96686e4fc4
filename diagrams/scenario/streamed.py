"""A path whose way points come while the tool moves. Lengths in m, angles in degrees."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.checks import require
from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.yaml.fields import FILE
from pfsc_drake.yaml.rules import Direction, NotNegative, Numbers, Parameters, Point, Range

_RATES = (0.01, 1000.0)  # 1/s
_MOST_TOLD = 1024


@dc.dataclass
class NewPath(Parameters):
    """A new path to go over to while the tool moves.

    Attributes:
        file: CSV file with its way points, as that of the stream.
        at: When its first way point comes [s]; those of the path before then come no more.
    """

    file: str = dc.field(default="", metadata=FILE)
    at: NotNegative = 1.0


@dc.dataclass
class DrawnPlane(Parameters):
    """A rectangle in space in which a person draws, in a browser.

    Attributes:
        origin: Its middle, where the tool rests at first [m].
        right: Direction that is to the right on the page, of any length.
        up: Direction that is upwards on the page, at least 0.1 deg from ``right``; the plane's is
            its part perpendicular to it.
        width: Along ``right`` [m].
        height: Along ``up`` [m].
        zyx_deg: ZYX angles [deg] of the orientation that the tool keeps; empty for none.
    """

    origin: Point = dc.field(default_factory=lambda: [0.9, 0.0, 1.0])
    right: Direction = dc.field(default_factory=lambda: [0.0, -1.0, 0.0])
    up: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    width: Annotated[float, Range(0.01, 100.0, "m")] = 0.6
    height: Annotated[float, Range(0.01, 100.0, "m")] = 0.4
    zyx_deg: Annotated[list[float], Numbers(3, empty=True)] = dc.field(default_factory=list)


@dc.dataclass
class Streamed(Parameters):
    """A path whose way points come one after the other while the tool moves.

    Attributes:
        file: CSV file with the way points, as that of ``!Waypoints``; the tool rests at the first
            one. Empty where ``inputs`` or ``plane`` are given.
        rate: Way points per second [1/s].
        begin: When the first one is sent [s].
        delay: From when one is sent until it comes [s].
        jitter: Largest further delay [s]; the order stays.
        noise: Standard deviation of each coordinate [m].
        seed: Of jitter and noise.
        new_paths: Further paths, one after the other.
        plane: Where a person draws, in ``live``.
        inputs: CSV file with what a person has drawn, as a live session leaves it. Its column
            ``time`` is in s; ``tick``, of older files, counts sampling intervals.
        length: How many way points a message holds.
        follow: How way points become a path, and how fast it is followed.
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
    length: Annotated[int, Range(1, _MOST_TOLD)] = 32
    follow: StreamParameters = dc.field(default_factory=StreamParameters)

    def check(self) -> None:
        """Refuse what does not go together.

        Raises:
            InputError: If so.
        """
        one = bool(self.file) != (self.plane is not None)
        require(one, "file", self.file or "none given", "a file, or a plane to draw in")
        drawn = not self.inputs or self.plane is not None
        require(drawn, "inputs", self.inputs, "none without the plane that was drawn in")
