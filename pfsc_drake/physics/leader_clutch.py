"""Clutch between a leader device and its follower, to reposition the handle."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.blocks.rotations import matrix_of, rotation_of, rotation_vector, rows_of
from pfsc_drake.errors import require


@dataclass
class ClutchParameters:
    """Interval in which the leader device is decoupled from the follower.

    Attributes:
        begin: Begin of the interval [s].
        end: End of the interval [s].
    """

    begin: float = 0.0
    end: float = 1.0

    def __post_init__(self) -> None:
        good = 0.0 <= self.begin < self.end < math.inf
        require(good, "begin, end", [self.begin, self.end], "ascending times [s]")


# s, within which the force feedback rises to its full value after the clutch closes
_GRIP_TIME = 0.2


class Clutch(Block):
    """Commanded position of the follower from the position of the leader's handle.

    ``x = y_0 + mu (p - p_0)``. While the clutch is open x is constant, there is no force feedback,
    and p_0 moves along with p; afterwards the force feedback rises within 0.2 s.

    Ports:
        handle (input): Measured p [m], shape (3,).
        opened (input, optional): Above 0.5 while the operator opens the clutch, shape (1,).
        orientation (input, optional): Commanded orientation of the follower by rows, from
            :class:`TurningClutch`, shape (9,).
        position (output): x, in the world of the follower [m], shape (3,).
        grip (output): Share of the force feedback, shape (1,).
        pose (output): Pose for the operator model at the handle instead of a tool's pose
            ``[y_t, R_e]``, shape (12,): x, and the orientation; while the clutch is open, x plus
            the displacement of the handle from the middle of its workspace, so that an operator
            with the target x moves it there.

    State:
        held: x; last: p at the last tick; was_open: Whether it was open then; grip, loose: Shares
        from 0 to 1.

    Args:
        scale: mu.
        start: y_0 [m], shape (3,).
        opened: Intervals in which it is open.
        period: Sampling time [s].
    """

    def __init__(
        self,
        scale: float,
        start: Sequence[float],
        opened: Sequence[ClutchParameters],
        period: float,
    ) -> None:
        self._scale, self._start, self._opened = scale, ca.DM(list(start)), list(opened)
        self._period = period
        self.inputs = {
            "handle": Port(3, "m"),
            "opened": Port(1, optional=True),
            "orientation": Port(9, optional=True),
        }
        self.outputs = {"position": Port(3, "m"), "grip": Port(1), "pose": Port(12, "m, 1")}
        self.states = {"held": 3, "last": 3, "was_open": 1, "grip": 1, "loose": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"held": self._start, "last": u.handle, "grip": 1.0}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        position = x.held + where(x.was_open, 0.0, self._scale) * (u.handle - x.last)
        target = position + x.loose * u.handle
        rows = rows_of(ca.DM.eye(3)) if u.orientation is None else u.orientation
        pose = ca.vertcat(target, rows)
        grip = where(_is_open(self._opened, u, t * self._period), 0.0, x.grip)
        return {"position": position, "grip": grip, "pose": pose}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        is_open = _is_open(self._opened, u, t * self._period)
        rise = self._period / _GRIP_TIME
        return {
            "held": y.position,
            "last": u.handle,
            "was_open": is_open,
            "grip": where(is_open, 0.0, ca.fmin(1.0, x.grip + rise)),
            "loose": where(is_open, ca.fmin(1.0, x.loose + rise), 0.0),
        }


class TurningClutch(Block):
    """Commanded orientation of the follower from the orientation of the leader's handle.

    ``R_x+ = exp(mu [d]) R_x`` with the rotation d of the handle within a tick, so that constant
    moments do work at both ends in the ratio mu. While the clutch is open R_x is constant.

    Ports:
        handle (input): Measured orientation of the handle by rows, shape (9,).
        opened (input, optional): Above 0.5 while the operator opens the clutch, shape (1,).
        orientation (output): R_x by rows, in the world of the follower, shape (9,).
        seen (output): Orientation for the operator model at the handle: R_x; while the clutch is
            open, rotated by the orientation of the handle from its middle, shape (9,).

    State:
        held: R_x; last: Orientation of the handle at the last tick; was_open: Whether it was open
        then; loose: Share from 0 to 1.

    Args:
        scale: mu.
        start: Orientation of the follower at the start, shape (3, 3).
        opened: Intervals in which it is open.
        period: Sampling time [s].
    """

    def __init__(
        self,
        scale: float,
        start: np.ndarray,
        opened: Sequence[ClutchParameters],
        period: float,
    ) -> None:
        self._scale, self._start, self._opened = scale, ca.DM(start.ravel()), list(opened)
        self._period = period
        self.inputs = {"handle": Port(9), "opened": Port(1, optional=True)}
        self.outputs = {"orientation": Port(9), "seen": Port(9)}
        self.states = {"held": 9, "last": 9, "was_open": 1, "loose": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"held": self._start, "last": u.handle}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        handle = matrix_of(u.handle)
        turn = rotation_vector(handle @ matrix_of(x.last).T)
        R = rotation_of(where(x.was_open, 0.0, self._scale) * turn) @ matrix_of(x.held)
        target = rotation_of(x.loose * rotation_vector(handle)) @ R
        return {"orientation": rows_of(R), "seen": rows_of(target)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        is_open = _is_open(self._opened, u, t * self._period)
        rise = self._period / _GRIP_TIME
        return {
            "held": y.orientation,
            "last": u.handle,
            "was_open": is_open,
            "loose": where(is_open, ca.fmin(1.0, x.loose + rise), 0.0),
        }


def _is_open(opened: Sequence[ClutchParameters], u: Values, time: Any) -> Any:
    """Return whether a clutch is open."""
    is_open = 0.0 if u.opened is None else u.opened > 0.5
    for at in opened:
        is_open = ca.logic_or(is_open, ca.logic_and(time >= at.begin, time < at.end))
    return is_open
