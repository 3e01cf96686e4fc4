"""What people and pages tell a controller that drives a robot, and what it tells them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from drake import lcmt_drake_signal

# channels of LCM
REQUEST_CHANNEL, PROGRESS_CHANNEL = "PFSC_REQUEST", "PFSC_PROGRESS"
LARGEST_OVERRIDE = 1.5
_OVERRIDE, _STOP, _AGE = "override", "stop", "obstacles_age"
_AXES = ("x", "y", "z", "v_x", "v_y", "v_z")
_MOST = 1000  # of values in a message


def encode_values(utime: int, values: Mapping[str, float]) -> bytes:
    """Return named numbers as a message of Drake's type ``lcmt_drake_signal``.

    Args:
        utime: Clock of the robot [us].
        values: The numbers by name.
    """
    message = lcmt_drake_signal()
    message.timestamp, message.dim = utime, len(values)
    message.coord, message.val = list(values), [float(value) for value in values.values()]
    encoded: bytes = message.encode()
    return encoded


def decode_values(data: bytes) -> dict[str, float]:
    """Return the named numbers in a message.

    Args:
        data: The message.

    Raises:
        ValueError: If it is none.
    """
    message = lcmt_drake_signal.decode(data)
    if not 0 <= message.dim <= _MOST:
        raise ValueError(f"dim = {message.dim}")
    return dict(zip(message.coord, message.val, strict=True))


@dataclass(frozen=True)
class Request:
    """What somebody asks a controller for.

    Attributes:
        override: Share of its planned pace at which the reference is to move, 0 to 1.5; 0 is a
            pause; None leaves it as it is.
        stop: Whether the robot is to be brought to rest, and the run to end.
        obstacles: Position and velocity of each obstacle, 6K numbers [m, m/s]; none if nothing is
            told of them. Their names are ``obstacle_1_x``, .., ``obstacle_1_v_z``, ``obstacle_2_x``
            and so on.
        age: How old that is when it is sent [s], ``obstacles_age``.
    """

    override: float | None = None
    stop: bool = False
    obstacles: tuple[float, ...] = ()
    age: float = 0.0

    def values(self) -> dict[str, float]:
        """Return it as named numbers."""
        given = {} if self.override is None else {_OVERRIDE: self.override}
        for k in range(len(self.obstacles) // len(_AXES)):
            told = self.obstacles[len(_AXES) * k : len(_AXES) * (k + 1)]
            given |= dict(zip(_names(k), told, strict=True))
        given |= {_AGE: self.age} if self.obstacles else {}
        return given | ({_STOP: 1.0} if self.stop else {})

    @classmethod
    def of(cls, values: Mapping[str, float]) -> "Request":
        """Return what named numbers ask for; an override that is no number is a pause.

        Of an obstacle that is told of in part, the rest is no number, and so is an age below zero.

        Args:
            values: The numbers by name.
        """
        override = values.get(_OVERRIDE)
        if override is not None:
            finite = override if math.isfinite(override) else 0.0
            override = min(max(finite, 0.0), LARGEST_OVERRIDE)
        obstacles: list[float] = []
        while (names := _names(len(obstacles) // len(_AXES)))[0] in values:
            obstacles += [values.get(name, math.nan) for name in names]
        age = values.get(_AGE, 0.0)
        known = age if age >= 0.0 else math.inf
        return cls(override, values.get(_STOP, 0.0) != 0.0, tuple(obstacles), known)


def _names(k: int) -> list[str]:
    """Return what the numbers of an obstacle are called."""
    return [f"obstacle_{k + 1}_{axis}" for axis in _AXES]


class Pause:
    """Pauses, and goes on at the pace before."""

    def __init__(self) -> None:
        self._before = 1.0

    def toggled(self, override: float) -> float:
        """Return the share of the planned pace that is asked for next.

        Args:
            override: The share that is asked for so far.
        """
        if override > 0.0:
            self._before = override
            return 0.0
        return self._before
