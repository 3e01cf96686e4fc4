"""Projection of the tool point onto the path, with the moving frame."""

import numpy as np

from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.systems.control.manifold_projector import ManifoldProjector


class PathProjector(ManifoldProjector):
    """Orthogonal projection (3.6) onto a path and everything a law needs there.

    The only memory is the path parameter ``theta*`` of the last tick, unwrapped. Arc length and
    parallel transport frame are functions of the parameter, so that neither drifts nor depends
    on the speed.

    Ports and state: See :class:`ManifoldProjector`.

    Args:
        path: The path.
        relative_degree: ``r`` of the law that reads the output.
        period: Sampling time [s].
    """

    def __init__(self, path: Path, relative_degree: int, period: float) -> None:
        evaluator = path.evaluator(relative_degree)
        self.layout: PathPointLayout = evaluator.layout
        super().__init__(
            self.layout,
            lambda y_t, memory: evaluator(y_t, memory[0]),
            lambda y_t: np.array(evaluator.find(y_t)).ravel(),
            period,
        )
