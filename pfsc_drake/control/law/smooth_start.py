"""A reference that starts where the tool is."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.control.law.transition import Transition


class SmoothStart(Block):
    """Lets a reference start where the tool is, and go over to the wanted one, see Transition.

        y_p(t) = y_d(t) + s(t) (y(0) - y_d(0))

    Ports:
        desired_reference (input): Derivatives 0..order of the wanted reference ``y_d`` by rows,
            shape ((order + 1) m,).
        manifold_state (input): Derivatives 0.. of the virtual output y by rows, m each, which is
            read at the start only.
        reference (output): Derivatives 0..order of ``y_p`` by rows, shape ((order + 1) m,).

    State:
        distance: ``y(0) - y_d(0)``, shape (m,); a tool that is nowhere has none. begin: Tick at
        the start.

    Args:
        duration: How long the transition takes [s].
        order: Highest derivative.
        num_outputs: m.
        state_size: Of ``manifold_state``.
        period: Sampling time [s].

    Raises:
        InputError: If duration or order are out of range.
    """

    def __init__(
        self, duration: float, order: int, num_outputs: int, state_size: int, period: float
    ) -> None:
        self._transition, self._m, self._period = Transition(duration, order), num_outputs, period
        size = (order + 1) * num_outputs
        self.inputs = {"desired_reference": Port(size), "manifold_state": Port(state_size)}
        self.outputs = {"reference": Port(size)}
        self.states = {"distance": num_outputs, "begin": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        distance = u.manifold_state[: self._m] - u.desired_reference[: self._m]
        return {"distance": where(is_finite(distance), distance, 0.0), "begin": t}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        elapsed = (t - x.begin) * self._period
        left = ca.vec(x.distance @ self._transition.at(elapsed).T)
        rest = where(elapsed < self._transition.duration, left, 0.0)
        return {"reference": u.desired_reference + rest}
