"""A force with which a tool is to press on a surface, over time."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from pfsc_drake.control.law.transition import Transition
from pfsc_drake.errors import InputError

# of the largest reference, by which the force may differ from it
_ALLOWED = 1.5


@dataclass
class PressParameters:
    """Force reference of the transversal coordinate, in place of a place.

    With the impedance ``m xi'' + d xi' = tau_perp + f`` and no stiffness the tool moves at
    ``|f| / d`` until the workpiece bears it, and then presses with ``|f|``: on the way to the
    workpiece with little, to be slow without much damping, which would turn a slope of the
    workpiece into a force; from touch-down with all of it; in the end the other way, off the
    workpiece.

    Attributes:
        force: With which it presses against the normal [N].
        approach: The same until touch-down [N].
        retreat: With which it is taken off along the normal [N].
        begin: When it sets off [s].
        touching: From which measured force on the tool is on the workpiece [N]; the approach
            must reach it.
        retreat_time: How long before the end of the reference it is taken off [s].
        ramp: Time of every change, which is C^4 [s].
        limit: By how much the measured force may differ from its reference, either way, before
            that is a fault [N]; 0 for one and a half times the largest reference. While the tool
            moves free it differs by the reference itself.
    """

    force: float = 20.0
    approach: float = 6.0
    retreat: float = 6.0
    begin: float = 0.1
    touching: float = 3.0
    retreat_time: float = 0.5
    ramp: float = 0.1
    limit: float = 0.0

    def __post_init__(self) -> None:
        for key in ("force", "approach", "retreat", "begin", "retreat_time"):
            self._require(key, 0.0 <= getattr(self, key) <= 1e6, "zero or a positive number")
        self._require("ramp", 0.0 < self.ramp <= 1e6, "a positive number of seconds")
        if self.force > 0.0:
            reached = 0.0 < self.touching < self.approach
            allowed = f"a positive number below approach = {self.approach:g} N"
            self._require("touching", reached, allowed)
        wide = self.limit == 0.0 or self._largest < self.limit <= 1e6
        allowed = f"0, or more than the largest reference of {self._largest:g} N"
        self._require("limit", wide, allowed)

    @property
    def _largest(self) -> float:
        """Largest magnitude of the reference [N]."""
        return max(self.force, self.approach, self.retreat)

    @property
    def allowed_difference(self) -> float:
        """By how much the measured force may differ from its reference [N]."""
        return self.limit or _ALLOWED * self._largest

    def _require(self, key: str, good: bool, allowed: str) -> None:
        if not good:
            raise InputError(f"{key} = {getattr(self, key)}: must be {allowed}")

    def over_time(self, end: float) -> Callable[[float, float], float]:
        """Return the force along the inward normal that the workpiece is to bear.

        Args:
            end: When the reference ends [s].

        Returns:
            Function of the time and of the time of touch-down, infinite before it, [s] -> [N].
        """
        rest = Transition(self.ramp, 0)
        off = end - self.retreat_time

        def change(time: float, begin: float) -> float:
            return float(1.0 - rest.at(time - begin)[0])

        def force(time: float, touch_down: float) -> float:
            pressed = self.approach * change(time, self.begin)
            if touch_down < math.inf:
                pressed += (self.force - self.approach) * change(time, touch_down)
            share_off = change(time, off)
            return (1.0 - share_off) * pressed - share_off * self.retreat

        return force
