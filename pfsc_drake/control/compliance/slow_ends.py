"""Damping that makes a tool slow at both ends of its path."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.errors import InputError, require


@dataclass
class SlowEnds:
    """Damping over the arc length, large next to the ends of a path (5.4), as printed.

    ::

        d(eta) = d_min + (d_max - d_min) (3 - 2 tanh(40 eta) + tanh(80 (eta - eta_max)))

    The bracket is 2 at the start, where ``d = 2 d_max - d_min``, and not 1 as its name suggests;
    it is 0 in between and 1 at the end, where ``d = d_max``. Beyond the ends it goes on: up to
    ``4 (d_max - d_min) + d_min`` before the start and ``2 d_max - d_min`` after the end. All of it
    is positive on paths of any length, and C^infinity.

    Attributes:
        least: ``d_min``, in the middle of a long path [N s/m].
        most: ``d_max``, at its end [N s/m], not less.
        start_rate: 40 1/m as printed.
        end_rate: 80 1/m as printed.
        length: ``eta_max`` [m]; 0 for the length of the path.
    """

    least: float = 90.0
    most: float = 3000.0
    start_rate: float = 40.0
    end_rate: float = 80.0
    length: float = 0.0

    def __post_init__(self) -> None:
        for key in ("start_rate", "end_rate"):
            require(0.0 < getattr(self, key) < math.inf, key, getattr(self, key), "positive")
        for key in ("least", "length"):
            good = 0.0 <= getattr(self, key) < math.inf
            require(good, key, getattr(self, key), "zero or positive")
        require(self.least <= self.most < math.inf, "most", self.most, f"{self.least:g} or more")

    @property
    def over(self) -> str:
        """Name of the coordinate that it goes over."""
        return "eta"

    @property
    def varies(self) -> bool:
        """Whether it is no constant."""
        return self.most > self.least

    def interpolant(self, lap: float | None = None) -> Callable[[Any], Any]:
        """Return the damping as a function of the arc length [m], a number or an expression.

        Args:
            lap: Length of a closed path, which has no ends.

        Raises:
            InputError: If the path is closed, or its length is not known.
        """
        if lap is not None:
            raise InputError("!SlowEnds: the path is closed and has no ends; allowed: open paths")
        if self.length == 0.0:
            raise InputError("!SlowEnds: length = 0; must be positive where no path tells it")
        least, span, length = self.least, self.most - self.least, self.length
        start_rate, end_rate = self.start_rate, self.end_rate

        def value(eta: Any) -> Any:
            slow = 3.0 - 2.0 * ca.tanh(start_rate * eta)
            return least + span * (slow + ca.tanh(end_rate * (eta - length)))

        return value
