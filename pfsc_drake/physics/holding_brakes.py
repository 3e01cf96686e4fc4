"""Holding brakes of the motors, which close at a stop of category 0."""

import functools
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values

# s, in which the holding torque builds up
_RISE = 0.02


class HoldingBrakes(Block):
    """Closing time, anchors and compliance of holding brakes.

    A brake is a spring between its motor and an anchor, which slides where the spring would exceed
    ``c(t) f_c``, with c from 0 to 1 in 20 ms from ``delay`` after the tick of a request. Its torque
    is computed by :class:`~pfsc_drake.systems.physics.brake_torque.BrakeTorque`.

    Ports:
        request_0, request_1, .. (input): Stop categories, each (1,): 0 closes the brakes.
        joint_state (input): Actual ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        anchor (output): Motor position without brake torque [rad or m], shape (N,); equal to the
            motor position while the brakes are open.
        give (output): Largest displacement from the anchor, ``c delta`` [rad or m], shape (N,).

    State:
        ``age`` of the first request [s], from one period on; 0 before; and the outputs.

    Args:
        presliding: ``delta``, displacement at the full holding torque [rad or m], shape (N,).
        requests: Number of requests, one or more.
        delay: Delay between request and closing [s].
        period: Sampling time [s].
    """

    def __init__(self, presliding: np.ndarray, requests: int, delay: float, period: float) -> None:
        self._presliding, self._delay, self._period = presliding, delay, period
        n = self._size = presliding.size
        self.inputs = {f"request_{k}": Port(1) for k in range(requests)}
        self.inputs["joint_state"] = Port(4 * n)
        self.outputs = {name: Port(n) for name in ("anchor", "give")}
        self.states = {"age": 1, "anchor": n, "give": n}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"anchor": self._motors(u)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"anchor": x.anchor, "give": x.give}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        requests = [getattr(u, name) == 0.0 for name in self.inputs if name != "joint_state"]
        requested = functools.reduce(ca.logic_or, requests, x.age > 0.0)
        age = x.age + self._period * requested
        # relative to the request, whose first tick is included in the age
        share = ca.fmin(ca.fmax((age - self._period - self._delay) / _RISE, 0.0), 1.0)
        give, motors = share * self._presliding, self._motors(u)
        return {
            "age": age,
            "anchor": motors + ca.fmin(ca.fmax(x.anchor - motors, -give), give),
            "give": give,
        }

    def _motors(self, u: Values) -> Any:
        return u.joint_state[2 * self._size : 3 * self._size]
