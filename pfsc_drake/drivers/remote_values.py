"""Requests of operators and pages to a controller that drives a robot, and its progress."""

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
        ValueError: If it is not such a message.
    """
    message = lcmt_drake_signal.decode(data)
    if not 0 <= message.dim <= _MOST:
        raise ValueError(f"dim = {message.dim}")
    return dict(zip(message.coord, message.val, strict=True))


@dataclass(frozen=True)
class Request:
    """A request to a controller.

    Attributes:
        override: Speed of the reference as a share of the planned one, 0 to 1.5; 0 is a pause; None
            to keep the present one.
        stop: Whether the robot is to stop, and the run to end.
        obstacles: Position and velocity of each obstacle, 6K numbers [m, m/s]; empty without
            measured obstacles. Their names are ``obstacle_1_x``, .., ``obstacle_1_v_z``,
            ``obstacle_2_x`` and so on.
        age: Age of the obstacles when they are sent [s], ``obstacles_age``.
    """

    override: float | None = None
    stop: bool = False
    obstacles: tuple[float, ...] = ()
    age: float = 0.0

    def values(self) -> dict[str, float]:
        """Return the request as named numbers."""
        values = {} if self.override is None else {_OVERRIDE: self.override}
        for k in range(len(self.obstacles) // len(_AXES)):
            numbers = self.obstacles[len(_AXES) * k : len(_AXES) * (k + 1)]
            values |= dict(zip(_names(k), numbers, strict=True))
        values |= {_AGE: self.age} if self.obstacles else {}
        return values | ({_STOP: 1.0} if self.stop else {})

    @classmethod
    def of(cls, values: Mapping[str, float]) -> "Request":
        """Return the request of named numbers; a NaN or infinite override is a pause.

        Missing numbers of an obstacle are NaN, and an age below zero is infinite.

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
    """Return the names of an obstacle's numbers."""
    return [f"obstacle_{k + 1}_{axis}" for axis in _AXES]


class Pause:
    """Pauses, and continues with the speed before."""

    def __init__(self) -> None:
        self._before = 1.0

    def toggle(self, override: float) -> float:
        """Return the next speed override, as a share of the planned speed.

        Args:
            override: The present override.
        """
        if override > 0.0:
            self._before = override
            return 0.0
        return self._before
