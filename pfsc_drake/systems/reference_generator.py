"""Reference of the virtual output over time."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.geometry import Curve


class ReferenceGenerator(LeafSystem):
    """Motion along the path over time; transversal and rotational references are zero.

    Ports:
        reference (output): Derivatives 0..r of ``yhat_p = (eta_p, 0, ..)`` by rows,
            shape ((r + 1) m,) [m, m/s, ...].

    Args:
        eta_p: Tangential reference [m] over time [s], a curve of dimension 1; before
            its domain and after it the reference rests.
        relative_degree: ``r``.
        num_outputs: ``m``.
    """

    def __init__(self, eta_p: Curve, relative_degree: int, num_outputs: int) -> None:
        super().__init__()
        self._begin, self._end = eta_p.domain
        self._sample = eta_p.flat_sampler(relative_degree)
        self._reference = np.zeros(((relative_degree + 1), num_outputs))
        self.DeclareVectorOutputPort(
            "reference",
            self._reference.size,
            self._calc_reference,
            prerequisites_of_calc={self.time_ticket()},
        )

    def _calc_reference(self, context: Context, output: BasicVector) -> None:
        time = context.get_time()
        # only its first column is ever other than zero
        self._reference[:, 0] = self._sample(min(max(time, self._begin), self._end))
        if not self._begin <= time <= self._end:
            self._reference[1:, 0] = 0.0
        output.SetFromVector(self._reference.ravel())
