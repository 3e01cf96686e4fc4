"""A path whose way points come while the tool moves. Lengths in m, angles in degrees."""

import dataclasses as dc

from diagrams.scenario.checks import (
    require,
    require_between,
    require_direction,
    require_not_negative,
    require_numbers,
    require_place,
)
from pfsc_drake.control.streams.parameters import StreamParameters
from pfsc_drake.yaml.reading import FILE

_RATES = (0.01, 1000.0)  # 1/s
_MOST_TOLD = 1024


@dc.dataclass
class NewPath:
    """A new path to go over to while the tool moves.

    Attributes:
        file: CSV file with its way points, as that of the stream.
        at: When its first way point comes [s]; those of the path before then come no more.
    """

    file: str = dc.field(default="", metadata=FILE)
    at: float = 1.0

    def __post_init__(self) -> None:
        require_not_negative("at", self.at)


@dc.dataclass
class DrawnPlane:
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

    origin: list[float] = dc.field(default_factory=lambda: [0.9, 0.0, 1.0])
    right: list[float] = dc.field(default_factory=lambda: [0.0, -1.0, 0.0])
    up: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    width: float = 0.6
    height: float = 0.4
    zyx_deg: list[float] = dc.field(default_factory=list)

    def __post_init__(self) -> None:
        require_place("origin", self.origin)
        for key in ("right", "up"):
            require_direction(key, getattr(self, key))
        for key in ("width", "height"):
            require_between(key, getattr(self, key), 1e-2, 1e2, "m")
        if self.zyx_deg:
            require_numbers("zyx_deg", self.zyx_deg, 3)


@dc.dataclass
class Streamed:
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
    rate: float = 10.0
    begin: float = 0.5
    delay: float = 0.0
    jitter: float = 0.0
    noise: float = 0.0
    seed: int = 1
    new_paths: list[NewPath] = dc.field(default_factory=list)
    plane: DrawnPlane | None = None
    inputs: str = dc.field(default="", metadata=FILE)
    length: int = 32
    follow: StreamParameters = dc.field(default_factory=StreamParameters)

    def __post_init__(self) -> None:
        require_between("rate", self.rate, *_RATES, "1/s")
        for key in ("begin", "delay", "jitter", "noise", "seed"):
            require_not_negative(key, getattr(self, key))
        good = 1 <= self.length <= _MOST_TOLD
        require(good, "length", self.length, f"1 to {_MOST_TOLD}")

    def check(self) -> None:
        """Refuse what does not go together.

        Raises:
            InputError: If so.
        """
        one = bool(self.file) != (self.plane is not None)
        require(one, "file", self.file or "none given", "a file, or a plane to draw in")
        drawn = not self.inputs or self.plane is not None
        require(drawn, "inputs", self.inputs, "none without the plane that was drawn in")
