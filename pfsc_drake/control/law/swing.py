"""Guidance that moves: transversal references that swing with time (5.1), (5.2)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.law.transition import Transition
from pfsc_drake.errors import InputError


@dataclass
class Swing:
    """A transversal coordinate's reference ``A s(t) sin(2 pi f (t - begin))``.

    So the manifold that the tool is held on moves along its own normals, as a circle does whose
    radius changes, ``xi_p = e' Delta sigma_t(t)``.

    Attributes:
        coordinate: Number of the transversal coordinate, from 1.
        amplitude: A [m].
        frequency: f [Hz].
        begin: Until when it rests [s].
        ramp: Time in which s rises from 0 to 1, with four continuous derivatives [s].
    """

    coordinate: int = 1
    amplitude: float = 0.01
    frequency: float = 0.5
    begin: float = 0.5
    ramp: float = 0.5

    def __post_init__(self) -> None:
        self._require("coordinate", self.coordinate in (1, 2), "1 or 2")
        self._require("amplitude", 0.0 < self.amplitude <= 1.0, "positive, at most 1 m")
        self._require("frequency", 0.0 < self.frequency <= 100.0, "positive, at most 100 Hz")
        self._require("begin", 0.0 <= self.begin < math.inf, "zero or a positive number of seconds")
        self._require("ramp", 0.0 < self.ramp < math.inf, "a positive number of seconds")

    def _require(self, key: str, good: bool, allowed: str) -> None:
        if not good:
            raise InputError(f"{key} = {getattr(self, key)}; must be {allowed}")


class SwingingReference:
    """The sum of several swings with its derivatives.

    Args:
        swings: Which.
        first: Row of the first transversal coordinate among the outputs.
        transversal: Number of transversal coordinates.
        outputs: Number m of outputs.
        order: Highest derivative r, at most 4.

    Raises:
        InputError: If a swing is of a coordinate that is not there.
    """

    def __init__(
        self, swings: Sequence[Swing], first: int, transversal: int, outputs: int, order: int
    ) -> None:
        for i, swing in enumerate(swings):
            if swing.coordinate > transversal:
                raise InputError(
                    f"swings[{i}]: coordinate = {swing.coordinate}; there "
                    f"{'is 1' if transversal == 1 else f'are {transversal}'}"
                )
        self._swings, self._first = tuple(swings), first
        self._rises = [Transition(swing.ramp, order) for swing in swings]
        self._shape, self._order = (order + 1, outputs), order

    def at(self, time: float) -> np.ndarray:
        """Return derivatives 0..r by rows, shape (r + 1, m) [m, m/s, ..].

        Args:
            time: [s].
        """
        values = np.zeros(self._shape)
        for swing, rise in zip(self._swings, self._rises, strict=True):
            since = time - swing.begin
            if since <= 0.0:
                continue
            omega = 2.0 * math.pi * swing.frequency
            s = -rise.at(since)
            s[0] += 1.0
            column = self._first + swing.coordinate - 1
            for k in range(self._order + 1):  # Leibniz
                values[k, column] += swing.amplitude * sum(
                    math.comb(k, i)
                    * s[i]
                    * omega ** (k - i)
                    * math.sin(omega * since + (k - i) * math.pi / 2.0)
                    for i in range(k + 1)
                )
        return values
