"""Blocks: ports, states, and expressions of outputs and state updates."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType, SimpleNamespace
from typing import Any, ClassVar


@dataclass(frozen=True)
class Port:
    """A vector input or output of a block.

    Attributes:
        size: Number of elements.
        unit: Unit, or units, for readers and for ``interface.json``.
        optional: Whether an input need not be connected.
    """

    size: int
    unit: str = ""
    optional: bool = False


class Values(SimpleNamespace):
    """Values by name: column vectors as attributes, None for an input that is not connected."""


class Block:
    """A sampled component with inputs, outputs and discrete states.

    Three methods define it. They are written in CasADi operations and called with symbols once,
    when the block is compiled; with numbers (``casadi.DM``) they evaluate. Therefore they contain
    no ``if`` on a value and no loop that ends on one, and store nothing on ``self`` between ticks.
    Cases are written with :mod:`pfsc_drake.blocks.cases`.

    A derived class sets its ports and states in its constructor. Its docstring specifies the law,
    the ports with shapes and units, the states, and the source of the formulas::

        class LowPass(Block):
            def __init__(self, size: int, rate: float, period: float) -> None:
                self.inputs = {"value": Port(size)}
                self.outputs = {"filtered": Port(size)}
                self.states = {"filtered": size}
                self._share = 1.0 - math.exp(-rate * period)

            def initial(self, u, t):
                return {"filtered": u.value}

            def output(self, x, u, t):
                return {"filtered": x.filtered}

            def update(self, x, u, y, t):
                return {"filtered": x.filtered + self._share * (u.value - x.filtered)}

    Direct feedthrough is found from the expressions: ``filtered`` above has none, and a loop of
    such outputs is not algebraic.

    Attributes:
        inputs: Ports by name.
        outputs: Ports by name.
        states: Sizes of the states, by name.
        inner: Sizes of intermediate values, by name, that :meth:`output` returns beside the outputs
            for :meth:`update`, so that nothing is evaluated twice.
        expands: Whether the methods' functions may be expanded into scalars, which makes them
            faster. False for a block whose rare cases are skipped (``short_circuit``).
    """

    expands: ClassVar[bool] = True
    inputs: Mapping[str, Port]
    outputs: Mapping[str, Port]
    states: Mapping[str, int]
    inner: Mapping[str, int] = MappingProxyType({})

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the states at the start; states left out are zero.

        Args:
            u: Inputs at the start.
            t: Tick at the start.
        """
        del u, t
        return {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values.

        Args:
            x: States.
            u: Inputs; None if an optional one is not connected.
            t: Number of the present tick, since time zero.
        """
        raise NotImplementedError

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; states left out stay the same.

        Args:
            x: States.
            u: Inputs; None if an optional one is not connected.
            y: Outputs and inner values (:attr:`inner`) at this tick.
            t: Number of the present tick.
        """
        del x, u, y, t
        return {}
