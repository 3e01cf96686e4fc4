"""A turntable as it is: behind its command, with encoders that tell late."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values


class TurntableDrive(Block):
    """Where a turntable's axes truly are, and what its encoders tell of it.

    Ports:
        followed (input): Angles and rates that the axes are at, by rows, shape (2N,)
            [rad, rad/s]: those of their command some time ago.
        motion (output): The same, shape (2N,).
        measured (output): Angles to the nearest increment, late by ``ticks``, shape (N,) [rad].

    State:
        ``sent``: What the encoders told at the last ticks, the oldest first, shape (N ticks,).

    Args:
        num_axes: N.
        increments: Of an encoder per turn; 0 for exact ones.
        ticks: By how many periods what is measured comes late.
    """

    def __init__(self, num_axes: int, increments: float, ticks: int) -> None:
        self._n, self._ticks = num_axes, ticks
        self._resolution = 2.0 * np.pi / increments if increments else 0.0
        self.inputs = {"followed": Port(2 * num_axes, "rad, rad/s")}
        self.outputs = {
            "motion": Port(2 * num_axes, "rad, rad/s"),
            "measured": Port(num_axes, "rad"),
        }
        self.states = {"sent": num_axes * ticks} if ticks else {}

    def _now(self, u: Values) -> Any:
        """Return what the encoders see."""
        angles, step = u.followed[: self._n], self._resolution
        return step * ca.floor(angles / step + 0.5) if step else angles

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start: that the table rested."""
        return {"sent": ca.repmat(self._now(u), self._ticks, 1)} if self._ticks else {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        told = x.sent[: self._n] if self._ticks else self._now(u)
        return {"motion": u.followed, "measured": told}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        return {"sent": ca.vertcat(x.sent[self._n :], self._now(u))} if self._ticks else {}
