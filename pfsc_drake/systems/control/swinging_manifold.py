"""A reference on a manifold that moves along its normals."""

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.control.law.swing import SwingingReference


class SwingingManifold(LeafSystem):
    """Adds swings to a reference, see :class:`SwingingReference`.

    Ports:
        reference (input): Derivatives 0..r of m outputs by rows, shape ((r + 1) m,).
        reference (output): The same with the swings.

    Args:
        swings: What is added.
        size: (r + 1) m.
    """

    def __init__(self, swings: SwingingReference, size: int) -> None:
        super().__init__()
        self._swings = swings
        self._reference = self.DeclareVectorInputPort("reference", size)
        self.DeclareVectorOutputPort(
            "reference",
            size,
            self._calc_reference,
            prerequisites_of_calc={self._reference.ticket(), self.time_ticket()},
        )

    def _calc_reference(self, context: Context, output: BasicVector) -> None:
        swings = self._swings.at(context.get_time()).ravel()
        output.SetFromVector(self._reference.Eval(context) + swings)
