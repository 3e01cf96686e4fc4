"""A hand that takes hold of a link, moves by a given way, and lets go or comes back."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, any_of, where
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_profile import require_vector
from pfsc_drake.physics.hand_model import HandModel, HandParameters, HandWaypoint


@dataclass
class LinkHandParameters:
    """Properties of a hand on a link; stiffness and damping as of a relaxed human arm's.

    It pulls a point of the link by a spring and a damper, with a limited force, towards where
    the point was when the hand took hold, plus a way that grows with minimum jerk.

    Attributes:
        link: Link or frame of the robot's model that it holds.
        point: Where, in the axes of that link or frame [m], shape (3,).
        way: How far the hand moves, world axes [m], shape (3,).
        begin: When it takes hold and begins to move [s].
        duration: Of the way [s].
        hold: How long it stays at the end of the way [s].
        comes_back: Whether it then goes the way back, and lets go there; else it lets go.
        stiffness: K [N/m].
        damping: D [N s/m].
        force_limit: Largest magnitude of the force [N].
        grip_ramp: Time in which the hand takes hold and lets go [s].
    """

    link: str = ""
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    way: np.ndarray = field(default_factory=lambda: np.zeros(3))
    begin: float = 0.0
    duration: float = 1.0
    hold: float = 0.0
    comes_back: bool = False
    stiffness: float = 300.0
    damping: float = 30.0
    force_limit: float = 45.0
    grip_ramp: float = 0.2

    def __post_init__(self) -> None:
        self.point = require_vector("point", self.point)
        self.way = require_vector("way", self.way)
        for key, at_least in (("begin", "zero"), ("hold", "zero"), ("duration", None)):
            value = getattr(self, key)
            if not (0.0 <= value < np.inf and (at_least or value > 0.0)):
                allowed = "finite, zero or positive" if at_least else "finite and positive"
                raise InputError(f"{key} = {value}: must be {allowed}")
        self.hand()

    def hand(self) -> HandParameters:
        """Return the hand, its waypoints from where the point is when it takes hold."""
        there = self.begin + self.duration
        times = [self.begin, there, there + self.hold]
        positions = [np.zeros(3), self.way, self.way]
        if self.hold == 0.0:
            del times[2], positions[2]
        if self.comes_back:
            times.append(times[-1] + self.duration)
            positions.append(np.zeros(3))
        return HandParameters(
            waypoints=[HandWaypoint(*pair) for pair in zip(times, positions, strict=True)],
            stiffness=self.stiffness,
            damping=self.damping,
            force_limit=self.force_limit,
            grip_ramp=self.grip_ramp,
            release=times[-1],
        )


class LinkHand(Block):
    """A spring-damper from a point of a link to a hand that moves, see :class:`HandModel`.

    The hand sees the point once per period, takes its velocity from the last two looks, and
    holds its force until the next. Its way begins where the point is when it takes hold.

    Ports:
        point (input): Where the point is in the world, shape (3,) [m].
        wrench (output): ``[force, torque]`` on the robot at the point, world axes, the torque
            zero, shape (6,) [N, Nm]; zero before the hand takes hold, and where the point is not
            finite.

    State:
        wrench; the point at the last look (``last``), and whether it was ``seen`` then; where it
        was when the hand took hold (``start``), and whether it ``holds``.

    Args:
        parameters: Properties of the hand.
        period: Sampling time [s].
    """

    expands = False  # tables

    def __init__(self, parameters: LinkHandParameters, period: float) -> None:
        self._begin, self._hand = parameters.begin, HandModel(parameters.hand())
        self._period = period
        self.inputs = {"point": Port(3, "m")}
        self.outputs = {"wrench": Port(6, "N, Nm")}
        self.states = {"wrench": 6, "last": 3, "seen": 1, "start": 3, "holds": 1}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"wrench": x.wrench}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        time, sees = t * self._period, all_finite(u.point)
        takes = all_of(ca.logic_not(x.holds), time >= self._begin, sees)
        start = where(takes, u.point, x.start)
        holds = any_of(x.holds, takes)
        force = self.force(time, u.point, (u.point - x.last) / self._period, start)
        acts = all_of(holds, x.seen, sees)
        return {
            "wrench": ca.vertcat(where(acts, force, 0.0), ca.DM.zeros(3)),
            "last": u.point,
            "seen": sees,
            "start": start,
            "holds": holds,
        }

    def force(self, time: Any, point: Any, velocity: Any, start: Any) -> Any:
        """Return the force on the link, world axes, shape (3,) [N].

        Args:
            time: [s].
            point: Where the point is [m], shape (3,).
            velocity: Of the point [m/s], shape (3,).
            start: Where the point was when the hand took hold [m], shape (3,).
        """
        twist = ca.vertcat(velocity, ca.DM.zeros(3))
        return self._hand.delivered(time, self._hand.wanted(time, point - start, twist))[:3]
