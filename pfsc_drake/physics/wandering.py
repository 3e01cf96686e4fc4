"""Places at random that an operator's hand wants to go to, one after the other."""

from dataclasses import dataclass, field

import numpy as np

from pfsc_drake.errors import require


@dataclass
class Wander:
    """A hand that goes here and there within a box, as an operator may who tries everything.

    Attributes:
        low: Lower corner of the box, in the hand's frame, shape (3,) [m].
        high: Upper corner, shape (3,) [m].
        begin: When it takes hold [s].
        end: Until when it goes on [s].
        shortest: Shortest time between places [s].
        longest: Longest time between them [s].
    """

    low: np.ndarray = field(default_factory=lambda: np.zeros(3))
    high: np.ndarray = field(default_factory=lambda: np.zeros(3))
    begin: float = 0.0
    end: float = 1.0
    shortest: float = 0.2
    longest: float = 1.0

    def __post_init__(self) -> None:
        self.low, self.high = (np.asarray(x, dtype=float) for x in (self.low, self.high))
        corners = [self.low.tolist(), self.high.tolist()]
        box = self.low.shape == self.high.shape == (3,) and bool(np.all(self.low <= self.high))
        require(box, "low, high", corners, "3 numbers each, none of low above that of high")
        times = [self.begin, self.end]
        later = bool(np.isfinite(times).all()) and self.begin < self.end
        require(later, "begin, end", times, "finite numbers, the end after the begin")
        between = [self.shortest, self.longest]
        positive = 0.01 <= self.shortest <= self.longest < np.inf
        require(positive, "shortest, longest", between, "0.01 s or more, the longest the longer")

    def places(self, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Return times [s], shape (k,), ascending, and places [m], shape (k, 3).

        Args:
            seed: Of the random numbers.
        """
        random = np.random.default_rng(seed)
        count = 2 + int((self.end - self.begin) / self.shortest)
        times = self.begin + np.cumsum(random.uniform(self.shortest, self.longest, count))
        times = np.concatenate([[self.begin], times[times < self.end]])
        return times, random.uniform(self.low, self.high, (len(times), 3))
