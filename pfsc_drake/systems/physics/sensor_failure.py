"""A sensor that stops working, to see what a controller makes of it."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem


class SensorFailure(LeafSystem):
    """Passes a measurement through until one component becomes NaN.

    Ports:
        measured (input): Any vector, shape (size,).
        delivered (output): The same; from ``time`` on, component ``index`` is NaN.

    Args:
        size: Size of the measurement.
        index: Component that fails.
        time: When it fails [s].
    """

    def __init__(self, size: int, index: int, time: float) -> None:
        super().__init__()
        self._index, self._time = index, time
        self._measured = self.DeclareVectorInputPort("measured", size)
        self.DeclareVectorOutputPort("delivered", size, self._calc_delivered)

    def _calc_delivered(self, context: Context, output: BasicVector) -> None:
        value = self._measured.Eval(context).copy()
        if context.get_time() >= self._time:
            value[self._index] = np.nan
        output.SetFromVector(value)
