"""The reference point of trajectory tracking."""

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.geometry import Path, PathPointLayout


class TrajectoryPoint(LeafSystem):
    """The path at the arc length that time prescribes, in place of the tool's projection.

    Ports:
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,);
            its first entry is the arc length ``eta_d`` [m].
        manifold_point (output): The path at ``eta_d``, laid out by ``layout``.

    Args:
        path: The path.
        relative_degree: ``r`` of the law that reads the output.
        num_outputs: ``m``.
    """

    def __init__(self, path: Path, relative_degree: int, num_outputs: int) -> None:
        super().__init__()
        self._parameter = path.arc_length.parameter
        evaluator = path.evaluator(relative_degree)
        self._evaluate_at = evaluator.evaluate_at
        self.layout: PathPointLayout = evaluator.layout
        self._reference = self.DeclareVectorInputPort(
            "reference", (relative_degree + 1) * num_outputs
        )
        self.DeclareVectorOutputPort(
            "manifold_point",
            self.layout.size,
            self._calc_manifold_point,
            prerequisites_of_calc={self._reference.ticket()},
        )

    def _calc_manifold_point(self, context: Context, output: BasicVector) -> None:
        eta_d = self._reference.Eval(context).item(0)
        output.set_value(self._evaluate_at(self._parameter(eta_d)))
