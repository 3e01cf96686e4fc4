"""A sensor that stops working, to see what a controller makes of it."""

from typing import Any, Literal

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.errors import InputError

FailureKind = Literal["nan", "frozen", "jump"]
KINDS = ("nan", "frozen", "jump")


class SensorFailure(Block):
    """Passes a measurement through until some of its components fail.

    Ports:
        measured (input): Any vector, shape (size,).
        delivered (output): The same; from ``time`` on, the failing components are NaN, rest
            at what they were at the last tick before, or are off by ``jump``.

    State:
        Where it freezes: the measurement of the ``last`` tick before the failure.

    Args:
        size: Size of the measurement.
        indices: Components that fail.
        time: When they fail [s].
        period: Of the ticks [s].
        kind: How: ``nan``, ``frozen`` or ``jump``.
        jump: By how much a jumping one is off.

    Raises:
        InputError: If the kind is not known.
    """

    def __init__(
        self,
        size: int,
        indices: list[int],
        time: float,
        period: float,
        kind: str = "nan",
        jump: float = 0.0,
    ) -> None:
        if kind not in KINDS:
            raise InputError(f"kind of a sensor's failure: {kind!r}; must be {', '.join(KINDS)}")
        self._fails = np.zeros(size)
        self._fails[indices] = 1.0
        self._time, self._period, self._kind, self._jump = time, period, kind, jump
        self.inputs, self.outputs = {"measured": Port(size)}, {"delivered": Port(size)}
        self.states = {"last": size} if kind == "frozen" else {}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"last": u.measured} if self.states else {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        wrong = u.measured + self._jump
        if self._kind == "nan":
            wrong = np.nan
        elif self._kind == "frozen":
            wrong = x.last
        return {"delivered": where(ca.DM(self._fails) * self._has_failed(t), wrong, u.measured)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"last": where(self._has_failed(t), x.last, u.measured)} if self.states else {}

    def _has_failed(self, t: Any) -> Any:
        return t * self._period >= self._time
