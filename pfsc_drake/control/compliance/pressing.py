"""A force reference, added to the forces that a filter yields to."""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_of, where


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
        reference_size: Of the port.
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
        """See :class:`Block`."""
        return {"touch_down": ca.DM.inf(), "place": ca.DM.inf()}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        place = u.reference[self._coordinate]
        lifted = where(x.place < ca.inf, place - x.place, 0.0)
        press = self._press(t * self._period, x.touch_down, lifted)
        along = ca.DM.zeros(u.manifold_force.numel())
        along[self._coordinate] = 1.0
        difference = u.manifold_force[self._coordinate] - press
        lost = ca.logic_and(u.ready > 0.5, ca.fabs(difference) > self._allowed)
        return {"press": press, "pressed_force": u.manifold_force - along * press, "lost": lost}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        time, met = t * self._period, u.manifold_force[self._coordinate] >= self._touching
        touches = all_of(met, u.ready > 0.5, x.touch_down == ca.inf)
        lifts = ca.logic_and(time >= self._off, x.place == ca.inf)
        return {
            "touch_down": where(touches, time, x.touch_down),
            "place": where(lifts, u.reference[self._coordinate], x.place),
        }
