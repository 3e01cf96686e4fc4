"""The reference point of trajectory tracking."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.geometry import Path, PathPointLayout

_SAMPLES, _STEPS = 2001, 6


class TrajectoryPoint(Block):
    """The path at the arc length that time prescribes, in place of the tool's projection.

    Ports:
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,);
            its first entry is the arc length ``eta_d`` [m].
        manifold_point (output): The path at ``eta_d``, laid out by ``layout``.

    Args:
        path: The path.
        relative_degree: ``r`` of the law that reads the output.
        num_outputs: ``m``.

    Attributes:
        layout: Of the manifold's point.
    """

    def __init__(self, path: Path, relative_degree: int, num_outputs: int) -> None:
        self._at = path.evaluator(relative_degree).at
        self.layout: PathPointLayout = path.evaluator(relative_degree).layout
        self._length = path.length if path.closed else np.inf
        self._period = path.position.period
        self._theta = np.linspace(*path.position.domain, _SAMPLES)
        self._eta = np.array([path.arc_length(theta) for theta in self._theta])
        self.inputs = {"reference": Port((relative_degree + 1) * num_outputs)}
        self.outputs, self.states = {"manifold_point": Port(self.layout.size)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"manifold_point": self._at(self._parameter(ca.MX(u.reference[0])))}

    def _parameter(self, eta: ca.MX) -> ca.MX:
        """Return the parameter with an arc length, by Newton's method from a table."""
        laps = ca.floor(eta / self._length)
        within = eta - (laps * self._length if np.isfinite(self._length) else 0.0)
        lengths, parameters = ca.MX(ca.DM(self._eta)), ca.MX(ca.DM(self._theta))
        k = ca.low(lengths, within, {"lookup_mode": "binary"})
        share = (within - lengths[k]) / (lengths[k + 1] - lengths[k])
        theta = parameters[k] + share * (parameters[k + 1] - parameters[k])
        for _ in range(_STEPS):
            point = self._at(theta)
            slope = point[self.layout.position][3:6]
            theta += (within - point[self.layout.eta]) / ca.norm_2(slope)
        return theta + laps * self._period
