"""A force reference, added to the forces that a filter yields to."""

import math
from collections.abc import Callable

from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem


class Pressing(LeafSystem):
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
        Discrete: time of touch-down [s], infinite before; place at ``off`` [m], infinite before.
    """

    def __init__(
        self,
        press: Callable[[float, float, float], float],
        touching: float,
        coordinate: int,
        num_outputs: int,
        reference_size: int,
        period: float,
        allowed: float = math.inf,
        off: float = math.inf,
    ) -> None:
        super().__init__()
        self._press, self._touching, self._coordinate = press, touching, coordinate
        self._allowed, self._off = allowed, off
        self._force = self.DeclareVectorInputPort("manifold_force", num_outputs)
        self._reference = self.DeclareVectorInputPort("reference", reference_size)
        self._ready = self.DeclareVectorInputPort("ready", 1)
        self.DeclareDiscreteState([math.inf, math.inf])
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._look)
        reference = {self.time_ticket(), self.xd_ticket(), self._reference.ticket()}
        self.DeclareVectorOutputPort("press", 1, self._calc_press, prerequisites_of_calc=reference)
        self.DeclareVectorOutputPort(
            "pressed_force",
            num_outputs,
            self._calc_pressed_force,
            prerequisites_of_calc=reference | {self._force.ticket()},
        )
        self.DeclareVectorOutputPort(
            "lost",
            1,
            self._calc_lost,
            prerequisites_of_calc=reference | {self._force.ticket(), self._ready.ticket()},
        )

    def _look(self, context: Context, memory: DiscreteValues) -> None:
        touch_down, place = context.get_discrete_state_vector().value()
        if touch_down == math.inf:
            met = self._force.Eval(context)[self._coordinate] >= self._touching
            if met and self._ready.Eval(context)[0] > 0.5:
                touch_down = context.get_time()
        if place == math.inf and context.get_time() >= self._off:
            place = self._place(context)
        memory.set_value([touch_down, place])

    def _place(self, context: Context) -> float:
        return float(self._reference.Eval(context)[self._coordinate])

    def _pressed(self, context: Context) -> float:
        touch_down, place = context.get_discrete_state_vector().value()
        lifted = self._place(context) - place if place < math.inf else 0.0
        return self._press(context.get_time(), touch_down, lifted)

    def _calc_press(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([self._pressed(context)])

    def _calc_pressed_force(self, context: Context, output: BasicVector) -> None:
        force = self._force.Eval(context).copy()
        force[self._coordinate] -= self._pressed(context)
        output.SetFromVector(force)

    def _calc_lost(self, context: Context, output: BasicVector) -> None:
        difference = self._force.Eval(context)[self._coordinate] - self._pressed(context)
        trusted = self._ready.Eval(context)[0] > 0.5
        output.SetFromVector([float(trusted and abs(difference) > self._allowed)])
