"""A force reference, added to the forces that a filter yields to."""

from collections.abc import Callable

from pydrake.systems.framework import BasicVector, Context, LeafSystem


class Pressing(LeafSystem):
    """Adds a force over time to one of the forces along the virtual output.

    Ports:
        manifold_force (input): Forces along the coordinates, shape (m,) [N, Nm].
        press (output): The force with which the tool is to press against the coordinate,
            shape (1,) [N].
        pressed_force (output): The input less ``press`` in its coordinate, shape (m,).

    Args:
        press: Force over time [s] -> [N].
        coordinate: Which coordinate it acts along.
        num_outputs: m.
    """

    def __init__(self, press: Callable[[float], float], coordinate: int, num_outputs: int) -> None:
        super().__init__()
        self._press, self._coordinate = press, coordinate
        self._force = self.DeclareVectorInputPort("manifold_force", num_outputs)
        time = self.time_ticket()
        self.DeclareVectorOutputPort("press", 1, self._calc_press, prerequisites_of_calc={time})
        self.DeclareVectorOutputPort(
            "pressed_force",
            num_outputs,
            self._calc_pressed_force,
            prerequisites_of_calc={time, self._force.ticket()},
        )

    def _calc_press(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([self._press(context.get_time())])

    def _calc_pressed_force(self, context: Context, output: BasicVector) -> None:
        force = self._force.Eval(context).copy()
        force[self._coordinate] -= self._press(context.get_time())
        output.SetFromVector(force)
