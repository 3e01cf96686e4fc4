"""A hand that takes hold of a link, moves by a given way, and lets go or comes back."""

from dataclasses import dataclass, field

import numpy as np

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


class LinkHandModel:
    """Force of a hand on a point of a link, see :class:`HandModel`.

    Args:
        parameters: Its properties.
    """

    def __init__(self, parameters: LinkHandParameters) -> None:
        self._begin, self._hand = parameters.begin, HandModel(parameters.hand())

    def holds(self, time: float) -> bool:
        """Return whether the hand has taken hold at a time [s], whether or not it let go since."""
        return time >= self._begin

    def force(
        self, time: float, point: np.ndarray, velocity: np.ndarray, start: np.ndarray
    ) -> np.ndarray:
        """Return the force on the link, world axes, shape (3,) [N].

        Args:
            time: [s].
            point: Where the point is [m], shape (3,).
            velocity: Of the point [m/s], shape (3,).
            start: Where the point was when the hand took hold [m], shape (3,).
        """
        twist = np.concatenate([velocity, np.zeros(3)])
        wanted = self._hand.wanted(time, point - start, twist)
        return self._hand.delivered(time, wanted)[:3]
