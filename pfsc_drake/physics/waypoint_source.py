"""Streamed waypoints: sent at a rate, with a delay, one after the other."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.control.streams.messages import WaypointLayout
from pfsc_drake.errors import require


@dataclass(frozen=True)
class Arrivals:
    """Arrival times of waypoints.

    Attributes:
        ticks: Tick of arrival of each, not decreasing, shape (n,).
        rows: Waypoints, each with 1 if a new path begins with it, otherwise 0, shape (n, d + 1).
        ends: Tick from which on the stream is reported as ended.
    """

    ticks: np.ndarray
    rows: np.ndarray
    ends: int


class WaypointSource(Block):
    """Outputs the last waypoints that have arrived.

    Ports:
        waypoints (output): Message laid out by ``layout``.

    Args:
        arrivals: Waypoints and their arrival times.
        layout: Layout of the messages.

    Raises:
        InputError: If rows do not fit the layout, or ticks decrease.
    """

    def __init__(self, arrivals: Arrivals, layout: WaypointLayout) -> None:
        rows, ticks = np.asarray(arrivals.rows, dtype=float), np.asarray(arrivals.ticks)
        width = layout.dimension + 1
        good = rows.ndim == 2 and len(rows) == len(ticks) > 0 and rows.shape[1] == width
        require(good, "rows", rows.shape, f"one of {width} numbers for each tick")
        ordered = bool(np.all(np.diff(ticks) >= 0))
        require(ordered, "ticks", "decreasing", "one waypoint after the other")
        self._layout, self._ends = layout, arrivals.ends
        # index of the first row of the message
        self._ticks = ca.MX(ca.DM(np.concatenate([[-np.inf], ticks.astype(float), [np.inf]])))
        before = np.zeros((layout.length, width))
        self._rows = ca.MX(ca.DM(np.concatenate([before, rows]).ravel()))
        self.inputs, self.states = {}, {}
        self.outputs = {"waypoints": Port(layout.size, "1, m")}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        layout, width = self._layout, self._layout.dimension + 1
        count = ca.low(self._ticks, ca.MX(t), {"lookup_mode": "binary"})
        rows = self._rows[width * count + ca.DM(range(width * layout.length))]
        ended = where(ca.MX(t) >= self._ends, 1.0, 0.0)
        return {"waypoints": ca.vertcat(count, ended, rows)}
