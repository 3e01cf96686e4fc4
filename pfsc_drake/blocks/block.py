"""What a component is: ports, states, and expressions of what it puts out and remembers."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType, SimpleNamespace
from typing import Any, ClassVar


@dataclass(frozen=True)
class Port:
    """A vector that goes into a block or comes out of it.

    Attributes:
        size: Number of elements.
        unit: Their unit, or units, for people and for ``interface.json``.
        optional: Whether optional: of an input: whether it need not be connected.
    """

    size: int
    unit: str = ""
    optional: bool = False


class Values(SimpleNamespace):
    """Values by name: column vectors as attributes, None for an input that is not connected."""


class Block:
    """A sampled component: what it puts out, and what it remembers until the next tick.

    Three methods say all of it. They are written in CasADi operations and called with symbols once,
    when the block is compiled; called with numbers (``casadi.DM``) they calculate. So there is no
    ``if`` on a value, no loop that ends on one, and nothing is kept on ``self`` from tick to tick.
    Cases are written with :mod:`pfsc_drake.blocks.cases`.

    A derived class sets its ports and states when it is made, and says in its docstring what it
    does: the law, the ports with shapes and units, the states, where the formulas come from::

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

    What an output depends on is found in its expression: ``filtered`` above is no direct
    feedthrough, and a loop of such outputs is none.

    Attributes:
        inputs: Ports by name.
        outputs: Ports by name.
        states: Sizes of what is remembered, by name.
        inner: Sizes of what :meth:`output` finds beside the outputs and returns for :meth:`update`,
            so that nothing is evaluated twice, by name.
        expands: Whether the methods' functions may be written out as scalars, which makes them
            faster. Not for a block whose rare cases are skipped (``short_circuit``).
    """

    expands: ClassVar[bool] = True
    inputs: Mapping[str, Port]
    outputs: Mapping[str, Port]
    states: Mapping[str, int]
    inner: Mapping[str, int] = MappingProxyType({})

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero.

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
        """Return what is remembered at the next tick; what is left out stays.

        Args:
            x: States.
            u: Inputs; None if an optional one is not connected.
            y: Outputs at this tick, and what is :attr:`inner`.
            t: Number of the present tick.
        """
        del x, u, y, t
        return {}
