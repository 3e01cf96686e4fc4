"""A hand-held device that leads a robot elsewhere: its handle, motors, encoders and clutch."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.errors import require, require_positive


@dataclass
class LeaderParameters:
    """A hand-held device with three axes.

    Attributes:
        mass: Of the handle [kg].
        damping: Viscous friction of an axis [N s/m].
        friction: Coulomb friction of an axis [N].
        resolution: Of the encoders, at the handle [m]; 0 if they are perfect.
        force_limit: Largest force of the motors [N].
        largest_speed: Fastest that a hand moves it [m/s].
    """

    mass: float = 0.35
    damping: float = 0.5
    friction: float = 0.3
    resolution: float = 1e-5
    force_limit: float = 30.0
    largest_speed: float = 2.0

    def __post_init__(self) -> None:
        for key in ("mass", "force_limit", "largest_speed"):
            require_positive(key, getattr(self, key))
        for key in ("damping", "friction", "resolution"):
            value = getattr(self, key)
            require(0.0 <= value < math.inf, key, value, "zero or a positive number")


@dataclass
class ClutchParameters:
    """A time for which the leader is let loose, to be taken hold of elsewhere.

    Attributes:
        begin: From when on it moves nothing [s].
        end: Until when [s].
    """

    begin: float = 0.0
    end: float = 1.0

    def __post_init__(self) -> None:
        good = 0.0 <= self.begin < self.end < math.inf
        require(good, "begin, end", [self.begin, self.end], "ascending times [s]")


class LeaderDevice(Block):
    """A mass with friction, between a hand and motors.

    ``m v' = f_hand + f_motor - d v - f_c sgn(v)`` along each axis, forces held over a tick, by
    implicit steps::

        v+ = shrink(v + T f / m, T f_c / m) / (1 + T d / m),   x+ = x + T v+

    shrink taking off up to the second argument. So the hand's and the motors' work, force times
    displacement, is never less than what the kinetic energy gains.

    Ports:
        motor_force (input): On the handle [N], shape (3,).
        hand_wrench (input): Of the hand on it, shape (6,), of which the force counts [N].
        position (output): As the encoders tell, shape (3,) [m].
        state (output): Position and velocity as they are, shape (6,) [m, m/s].

    State:
        position, velocity: Zero at the start.

    Args:
        parameters: The device.
        period: Sampling time T [s].
    """

    def __init__(self, parameters: LeaderParameters, period: float) -> None:
        self._device, self._period = parameters, period
        self.inputs = {"motor_force": Port(3, "N"), "hand_wrench": Port(6, "N, Nm")}
        self.outputs = {"position": Port(3, "m"), "state": Port(6, "m, m/s")}
        self.states = {"position": 3, "velocity": 3}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        step, measured = self._device.resolution, x.position
        if step > 0.0:
            measured = step * ca.floor(x.position / step + 0.5)
        return {"position": measured, "state": ca.vertcat(x.position, x.velocity)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        device, T = self._device, self._period
        force = u.motor_force + u.hand_wrench[:3]
        force = where(all_finite(force), force, 0.0)
        driven = x.velocity + T / device.mass * force
        least = T / device.mass * device.friction
        slid = ca.sign(driven) * ca.fmax(0.0, ca.fabs(driven) - least)
        velocity = slid / (1.0 + T * device.damping / device.mass)
        return {"position": x.position + T * velocity, "velocity": velocity}


# s, within which a hand that takes hold again feels the follower's force in full
_GRIP_TIME = 0.2


class Clutch(Block):
    """Where the follower is to be, for where the leader's handle is.

    ``x = y_0 + mu (p - p_0)``. While the clutch is open x stays, the leader feels nothing, and p_0
    moves along with p; thereafter the force comes back within 0.2 s.

    Ports:
        handle (input): p as measured [m], shape (3,).
        opened (input, optional): Above 0.5 while a person opens it, shape (1,).
        position (output): x, in the world of the follower [m], shape (3,).
        grip (output): Share of the force that the leader feels, shape (1,).
        pose (output): What a hand at the handle goes by, in place of a tool's pose
            ``[y_t, R_e]``, shape (12,): x; while the clutch is open, the way of the handle from
            the middle of its room, beside x, so that a hand whose target is x brings it there.

    State:
        held: x; last: p at the last tick; was_open: Whether it was open then; grip, loose: Shares
        from 0 to 1.

    Args:
        scale: mu.
        start: y_0 [m], shape (3,).
        opened: When it is open.
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
        self.inputs = {"handle": Port(3, "m"), "opened": Port(1, optional=True)}
        self.outputs = {"position": Port(3, "m"), "grip": Port(1), "pose": Port(12, "m, 1")}
        self.states = {"held": 3, "last": 3, "was_open": 1, "grip": 1, "loose": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"held": self._start, "last": u.handle, "grip": 1.0}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        position = x.held + where(x.was_open, 0.0, self._scale) * (u.handle - x.last)
        seen = position + x.loose * u.handle
        pose = ca.vertcat(seen, ca.DM([1, 0, 0, 0, 1, 0, 0, 0, 1]))
        grip = where(self._is_open(u, t), 0.0, x.grip)
        return {"position": position, "grip": grip, "pose": pose}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        is_open, rise = self._is_open(u, t), self._period / _GRIP_TIME
        return {
            "held": y.position,
            "last": u.handle,
            "was_open": is_open,
            "grip": where(is_open, 0.0, ca.fmin(1.0, x.grip + rise)),
            "loose": where(is_open, ca.fmin(1.0, x.loose + rise), 0.0),
        }

    def _is_open(self, u: Values, t: Any) -> Any:
        """Return whether the clutch is open."""
        time, is_open = t * self._period, 0.0 if u.opened is None else u.opened > 0.5
        for at in self._opened:
            is_open = ca.logic_or(is_open, ca.logic_and(time >= at.begin, time < at.end))
        return is_open
