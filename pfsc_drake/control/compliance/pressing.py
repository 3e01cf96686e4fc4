"""Contact force reference of a tool on a surface, added to the input of an impedance filter."""

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

# default of the allowed difference, as a multiple of the largest reference
_ALLOWED = 1.5


@dataclass
class PressParameters(Parameters):
    """Force reference of the transversal coordinate, instead of a position reference.

    With the impedance ``m xi'' + d xi' = tau_perp + f`` and no stiffness the tool moves at
    ``|f| / d`` until it touches the workpiece, and then presses with ``|f|``. The approach uses a
    small force, because a large damping would turn a slope of the workpiece into a force; after
    touch-down the full force acts; finally the force is reversed and the tool retreats. A constant
    force or a residual bias of the sensor would move the tool away without bound. Hence a spring
    controls the last part of the retreat and holds the tool at the clearance.

    Attributes:
        force: Contact force against the normal [N].
        approach: Force until touch-down [N].
        retreat: Force of the retreat along the normal [N], a positive number.
        clearance: Distance of the retreat from the point of contact [m], a positive number.
        begin: Start of the approach [s].
        touching: Measured force from which on the tool is in contact [N]; the approach must exceed
            it.
        retreat_time: Time between the retreat and the end of the reference [s].
        ramp: Time of every change, which is C^4 [s].
        limit: Largest difference of the measured force from its reference, of either sign, before
            a fault [N]; 0 for one and a half times the largest reference. While the tool moves
            freely the difference is the reference itself.
    """

    force: Annotated[float, Range(0.0, 1e6, "N")] = 20.0
    approach: Annotated[float, Range(0.0, 1e6, "N")] = 6.0
    # without it no force would act on the tool after contact
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
        """Largest allowed difference of the measured force from its reference [N]."""
        return self.limit or _ALLOWED * self._largest

    def retreat_begin(self, end: float) -> float:
        """Return the time at which the retreat begins [s].

        Args:
            end: End of the reference [s].
        """
        return end - self.retreat_time

    def over_time(self, end: float, stiffest: float) -> Callable[[Any, Any, Any], Any]:
        """Return the force on the workpiece along the inward normal over time.

        Args:
            end: End of the reference [s].
            stiffest: Largest stiffness without oscillation, ``d^2 / (4 m)`` [N/m]; the stiffness of
                the spring of the retreat is ``2 retreat / clearance``, at most this value.

        Returns:
            Function of the time, of the time of touch-down, infinite before it, and of the distance
            since the begin of the retreat, [s], [s], [m] -> [N]; of numbers or expressions.
        """
        rest, off = Transition(self.ramp, 0), self.retreat_begin(end)
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

    The block stores the time of touch-down: the first tick at which the sensor is tared and the
    measured force along the coordinate is at least ``touching``. From the time ``off`` on the force
    depends on the distance that the reference has travelled since then.

    The block also monitors the difference of measured force and reference. It is large if the
    loop bounces, if the sensor is delayed or its bias jumps, or if the workpiece is not at its
    taught position.

    Ports:
        manifold_force (input): Forces along the coordinates, shape (m,) [N, Nm].
        reference (input): Compliant reference of the filter, derivatives by rows, shape
            (reference_size,) [m, rad].
        ready (input): Whether the forces are valid, shape (1,): 1 once the sensor is tared.
        press (output): Reference of the contact force against the coordinate, shape (1,) [N].
        pressed_force (output): The input less ``press`` in its coordinate, shape (m,).
        lost (output): Whether the difference exceeds its limit, 1 or 0, shape (1,); 0 until the
            forces are valid.

    Args:
        press: Force as a function of time, time of touch-down [s], infinite before, and distance
            since ``off`` [m], zero before -> [N].
        touching: Force of touch-down [N].
        coordinate: Index of its coordinate.
        num_outputs: m.
        reference_size: Size of the port ``reference``.
        period: Sampling time [s].
        allowed: Largest difference of measured force and reference [N].
        off: Begin of the retreat [s].

    State:
        Time of touch-down (``touch_down``) [s] and position at ``off`` (``lift_off``) [m], both
        infinite before.
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
        self.states = {"touch_down": 1, "lift_off": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"touch_down": ca.DM.inf(), "lift_off": ca.DM.inf()}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        position = u.reference[self._coordinate]
        lifted = where(x.lift_off < ca.inf, position - x.lift_off, 0.0)
        press = self._press(t * self._period, x.touch_down, lifted)
        along = ca.DM.zeros(u.manifold_force.numel())
        along[self._coordinate] = 1.0
        difference = u.manifold_force[self._coordinate] - press
        lost = ca.logic_and(u.ready > 0.5, ca.fabs(difference) > self._allowed)
        return {"press": press, "pressed_force": u.manifold_force - along * press, "lost": lost}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        time, met = t * self._period, u.manifold_force[self._coordinate] >= self._touching
        touches = all_of(met, u.ready > 0.5, x.touch_down == ca.inf)
        lifts = ca.logic_and(time >= self._off, x.lift_off == ca.inf)
        return {
            "touch_down": where(touches, time, x.touch_down),
            "lift_off": where(lifts, u.reference[self._coordinate], x.lift_off),
        }
