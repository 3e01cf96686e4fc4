"""What a person set while a robot moved, played back."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem


class RecordedControls(LeafSystem):
    """Controls as they were recorded, held from one change to the next.

    Ports:
        controls (output): Those of the last row whose tick has come, before it those of the
            first, shape (size,).

    Args:
        ticks: When they changed, in sampling intervals, increasing, shape (rows,).
        rows: What they became, shape (rows, size).
        period: Sampling interval [s].
    """

    def __init__(self, ticks: np.ndarray, rows: np.ndarray, period: float) -> None:
        super().__init__()
        self._ticks, self._rows, self._period = ticks, rows, period
        self.DeclareVectorOutputPort(
            "controls",
            rows.shape[1],
            self._calc_controls,
            prerequisites_of_calc={self.time_ticket()},
        )

    def _calc_controls(self, context: Context, output: BasicVector) -> None:
        tick = round(context.get_time() / self._period)
        row = max(int(np.searchsorted(self._ticks, tick, side="right")) - 1, 0)
        output.SetFromVector(self._rows[row])
