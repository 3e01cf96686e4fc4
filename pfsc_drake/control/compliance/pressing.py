"""A force with which a tool is to press on a surface, added to what a filter yields to."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_of, where
from pfsc_drake.control.law.reference import Transition
from pfsc_drake.errors import require
from pfsc_drake.yaml.rules import Parameters, Range

# of the largest reference, by which the force may differ from it
_ALLOWED = 1.5


@dataclass
class PressParameters(Parameters):
    """Force reference of the transversal coordinate, in place of a place.

    With the impedance ``m xi'' + d xi' = tau_perp + f`` and no stiffness the tool moves at
    ``|f| / d`` until the workpiece bears it, and then presses with ``|f|``: on the way to the
    workpiece with little, to be slow without much damping, which would turn a slope of the
    workpiece into a force; from touch-down with all of it; in the end the other way, off the
    workpiece. A force that went on would carry the tool away for ever, and so would what is left
    of the sensor's bias: the last part of the way off is led by a spring, which holds the tool
    there.

    Attributes:
        force: With which it presses against the normal [N].
        approach: The same until touch-down [N].
        retreat: With which it is taken off along the normal [N], a positive number.
        clearance: How far it is taken off from where it pressed [m], a positive number.
        begin: When it sets off [s].
        touching: From which measured force on the tool is on the workpiece [N]; the approach
            must reach it.
        retreat_time: How long before the end of the reference it is taken off [s].
        ramp: Time of every change, which is C^4 [s].
        limit: By how much the measured force may differ from its reference, either way, before
            that is a fault [N]; 0 for one and a half times the largest reference. While the tool
            moves free it differs by the reference itself.
    """

    force: Annotated[float, Range(0.0, 1e6, "N")] = 20.0
    approach: Annotated[float, Range(0.0, 1e6, "N")] = 6.0
    # without it nothing would hold the tool once it does not press any more
    retreat: Annotated[float, Range(0.0, 1e6, "N", open=True)] = 6.0
    clearance: Annotated[float, Range(0.0, 1e3, "m", open=True)] = 0.01
    begin: Annotated[float, Range(0.0, 1e6, "s")] = 0.1
    touching: float = 3.0
    retreat_time: Annotated[float, Range(0.0, 1e6, "s")] = 0.5
    ramp: Annotated[float, Range(0.0, 1e6, "s", open=True)] = 0.1
    limit: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.force > 0.0:
            reached = 0.0 < self.touching < self.approach
            allowed = f"a positive number below approach = {self.approach:g} N"
            require(reached, "touching", self.touching, allowed)
        wide = self.limit == 0.0 or self._largest < self.limit <= 1e6
        allowed = f"0, or more than the largest reference of {self._largest:g} N"
        require(wide, "limit", self.limit, allowed)

    @property
    def _largest(self) -> float:
        """Largest magnitude of the reference [N]."""
        return max(self.force, self.approach, self.retreat)

    @property
    def allowed_difference(self) -> float:
        """By how much the measured force may differ from its reference [N]."""
        return self.limit or _ALLOWED * self._largest

    def taken_off(self, end: float) -> float:
        """Return from when on the tool is taken off [s].

        Args:
            end: When the reference ends [s].
        """
        return end - self.retreat_time

    def over_time(self, end: float, stiffest: float) -> Callable[[Any, Any, Any], Any]:
        """Return the force along the inward normal that the workpiece is to bear.

        Args:
            end: When the reference ends [s].
            stiffest: Stiffness up to which the tool does not swing, ``d^2 / (4 m)`` [N/m]; that of
                the spring in the end is half the clearance's for ``retreat``, or this if less.

        Returns:
            Function of the time, of the time of touch-down, infinite before it, and of how far the
            tool is from where it was when it began to be taken off, [s], [s], [m] -> [N]; of
            numbers or expressions.
        """
        rest, off = Transition(self.ramp, 0), self.taken_off(end)
        stiffness = min(2.0 * self.retreat / self.clearance, stiffest)

        def change(time: Any, begin: Any) -> Any:
            return 1.0 - rest.at(time - begin)

        def force(time: Any, touch_down: Any, lifted: Any) -> Any:
            pressed = self.approach * change(time, self.begin)
            pressed += (self.force - self.approach) * change(time, touch_down)
            share_off = change(time, off)
            spring = stiffness * (self.clearance - lifted)
            lift = ca.fmax(-self.retreat, ca.fmin(self.retreat, spring))
            return (1.0 - share_off) * pressed - share_off * lift

        return force


class Pressing(Block):
    """Adds a force over time to one of the forces along the virtual output.

    It remembers when the tool first met the workpiece: the first tick at which the force along the
    coordinate is measured, tared, and at least ``touching``. From ``off`` on it tells the force how
    far the tool, as it is led, has gone from where it was then.

    It watches the force, too: a loop that bounces, a sensor that is late or whose bias jumps, and
    a workpiece that is not where it was taught show in the difference of what is measured and
    what is asked for.

    Ports:
        manifold_force (input): Forces along the coordinates, shape (m,) [N, Nm].
        reference (input): Where the filter leads the coordinates, derivatives by rows, shape
            (reference_size,) [m, rad].
        ready (input): Whether these are to be trusted, shape (1,): 1 once the sensor is tared.
        press (output): The force with which the tool is to press against the coordinate,
            shape (1,) [N].
        pressed_force (output): The input less ``press`` in its coordinate, shape (m,).
        lost (output): Whether that is more than is allowed, either way, 1 or 0, shape (1,); 0 until
            the forces are to be trusted.

    Args:
        press: Force over time and time of touch-down [s], which is infinite before, and over the
            way since ``off`` [m], which is zero before -> [N].
        touching: Force of touch-down [N].
        coordinate: Which coordinate it acts along.
        num_outputs: m.
        reference_size: Reference size of the port.
        period: Between looks at the force [s].
        allowed: Difference of measured force and reference that is allowed [N].
        off: From when on the way counts [s].

    State:
        Time of touch-down (``touch_down``) [s] and place at ``off`` (``place``) [m], both infinite
        before.
    """

    def __init__(
        self,
        press: Callable[[Any, Any, Any], Any],
        touching: float,
        coordinate: int,
        num_outputs: int,
        reference_size: int,
        period: float,
        allowed: float = math.inf,
        off: float = math.inf,
    ) -> None:
        self._press, self._touching, self._coordinate = press, touching, coordinate
        self._period, self._allowed, self._off = period, allowed, off
        self.inputs = {
            "manifold_force": Port(num_outputs, "N, Nm"),
            "reference": Port(reference_size, "m, rad, per s, .."),
            "ready": Port(1),
        }
        self.outputs = {
            "press": Port(1, "N"),
            "pressed_force": Port(num_outputs, "N, Nm"),
            "lost": Port(1),
        }
        self.states = {"touch_down": 1, "place": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"touch_down": ca.DM.inf(), "place": ca.DM.inf()}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        place = u.reference[self._coordinate]
        lifted = where(x.place < ca.inf, place - x.place, 0.0)
        press = self._press(t * self._period, x.touch_down, lifted)
        along = ca.DM.zeros(u.manifold_force.numel())
        along[self._coordinate] = 1.0
        difference = u.manifold_force[self._coordinate] - press
        lost = ca.logic_and(u.ready > 0.5, ca.fabs(difference) > self._allowed)
        return {"press": press, "pressed_force": u.manifold_force - along * press, "lost": lost}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        time, met = t * self._period, u.manifold_force[self._coordinate] >= self._touching
        touches = all_of(met, u.ready > 0.5, x.touch_down == ca.inf)
        lifts = ca.logic_and(time >= self._off, x.place == ca.inf)
        return {
            "touch_down": where(touches, time, x.touch_down),
            "place": where(lifts, u.reference[self._coordinate], x.place),
        }
