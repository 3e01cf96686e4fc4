"""Simulated turntable: it lags behind its command, and its encoders have a delay."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values


class TurntableDrive(Block):
    """Actual and measured motion of a turntable's axes.

    Ports:
        followed (input): Actual angles and rates of the axes, by rows, shape (2N,) [rad, rad/s]:
            the delayed command.
        motion (output): The input, shape (2N,).
        measured (output): Angles to the nearest increment, delayed by ``ticks``, shape (N,) [rad].

    State:
        ``sent``: Measurements of the last ticks, the oldest first, shape (N ticks,).

    Args:
        num_axes: N.
        increments: Increments of an encoder per revolution; 0 for exact ones.
        ticks: Delay of the measurement in periods.
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
        """Return the present encoder angles."""
        angles, step = u.followed[: self._n], self._resolution
        return step * ca.floor(angles / step + 0.5) if step else angles

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states, of a table at rest."""
        return {"sent": ca.repmat(self._now(u), self._ticks, 1)} if self._ticks else {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        measured = x.sent[: self._n] if self._ticks else self._now(u)
        return {"motion": u.followed, "measured": measured}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"sent": ca.vertcat(x.sent[self._n :], self._now(u))} if self._ticks else {}
