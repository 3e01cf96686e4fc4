"""Exact derivative of a network over one tick, from the derivatives of its functions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.blocks.network import TICK, Network, Node, Source
from pfsc_drake.blocks.stage import evaluation_order

# relative to an argument, or absolute if that is larger
_DIFFERENCE = 1e-6
# rows of an adjoint by their variables, shape (k, size) each
Adjoint = dict[Source, np.ndarray]


class NetworkSlope:
    """Derivative of a network by the chain rule over its functions.

    CasADi differentiates a function when its derivative is first needed, and none that does not
    affect the requested results.

    Args:
        network: The network.

    Attributes:
        network: The same.
        order: Its nodes, in an order of evaluation.
    """

    def __init__(self, network: Network) -> None:
        self.network = network
        self.order = evaluation_order(network.nodes)
        self._jacobians: dict[int, ca.Function] = {}

    def at(
        self,
        x: Mapping[str, np.ndarray],
        u: Mapping[str, np.ndarray],
        t: float,
        parameters: Mapping[str, float] | None = None,
    ) -> "SlopeAt":
        """Return the derivative at a tick.

        Args:
            x: States by name.
            u: Inputs by name.
            t: Number of the tick.
            parameters: Values of the parameters by name, if the network has some.
        """
        known = {Source("state", name): value for name, value in x.items()}
        known |= {Source("input", name): value for name, value in u.items()}
        known[TICK] = np.array([t])
        values = parameters or {}
        for node in [*self.order, *self.network.updates]:
            for source in node.sources:
                if source.kind == "parameter" and source not in known:
                    known[source] = np.array([values[name] for name in source.name.split()])
        for node in self.order:
            results = node.function.call([ca.DM(known[source]) for source in node.sources])
            for name, value in zip(node.results, results, strict=True):
                known[Source("wire", name)] = value.full().ravel()
        return SlopeAt(self, known)

    def jacobian(self, node: Node, known: Mapping[Source, np.ndarray]) -> list[list[np.ndarray]]:
        """Return the derivatives of a node's results (rows) by its arguments (columns).

        Args:
            node: The node.
            known: Its arguments.
        """
        if id(node) not in self._jacobians:
            self._jacobians[id(node)] = _jacobian(node)
        arguments = [ca.DM(known[source]) for source in node.sources]
        nothing = [ca.DM(*node.function.size_out(i)) for i in range(node.function.n_out())]
        blocks = [block.full() for block in self._jacobians[id(node)].call(arguments + nothing)]
        n = len(_variables(node))
        for column in range(n):
            for k in np.flatnonzero(_unknown(blocks[column::n])):
                difference = _difference(node.function, arguments, column, int(k))
                for block, entries in zip(blocks[column::n], difference, strict=True):
                    block[:, k] = np.where(np.isfinite(block[:, k]), block[:, k], entries)
        return [blocks[row * n : (row + 1) * n] for row in range(len(node.results))]


@dataclass(frozen=True)
class SlopeAt:
    """The derivative of a network at one tick.

    Attributes:
        slope: Derivative of the network.
        known: All values at that tick: states, inputs, wires.
    """

    slope: NetworkSlope
    known: Mapping[Source, np.ndarray]

    def wire(self, name: str) -> np.ndarray:
        """Return the value of a wire."""
        return self.known[Source("wire", name)]

    def derivatives(self, states: Sequence[str], wires: Sequence[str]) -> Adjoint:
        """Return derivatives of states at the next tick, then of wires, one below the other.

        Args:
            states: Names of the states.
            wires: Names of the wires.

        Returns:
            By each state and each input that any of them depends on, shape (k, size).
        """
        network, found = self.slope.network, Adjoint()
        sizes = [network.states[name] for name in states] + [network.wires[w] for w in wires]
        pieces = np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1], axis=1)
        of_next = dict(zip(states, pieces, strict=False))
        for name, weights in zip(wires, pieces[len(states) :], strict=True):
            _add(found, Source("wire", name), weights)
        for node in network.updates:
            self._through(node, {n: of_next.pop(n) for n in node.results if n in of_next}, found)
        for name, weights in of_next.items():  # unchanged states
            _add(found, Source("state", name), weights)
        for node in reversed(self.slope.order):
            sources = [(name, Source("wire", name)) for name in node.results]
            self._through(node, {n: found.pop(s) for n, s in sources if s in found}, found)
        found.pop(TICK, None)
        return found

    def reaching(self, wires: Sequence[str]) -> list[str]:
        """Return the states that wires depend on, now or some ticks later.

        Args:
            wires: Names of the wires.
        """
        reaching: dict[str, None] = {}
        new: list[str] = []
        outputs = list(wires)
        while new or outputs:
            found = self.derivatives(new, outputs)
            depended = [s.name for s, rows in found.items() if s.kind == "state" and rows.any()]
            new, outputs = [name for name in depended if name not in reaching], []
            reaching |= dict.fromkeys(new)
        return list(reaching)

    def _through(self, node: Node, weights: Mapping[str, np.ndarray], found: Adjoint) -> None:
        """Add the contributions of a node's results through its arguments."""
        weights = {name: rows for name, rows in weights.items() if rows.any()}
        if not weights:
            return
        jacobian = dict(zip(node.results, self.slope.jacobian(node, self.known), strict=True))
        for name, rows in weights.items():
            for source, block in zip(_variables(node), jacobian[name], strict=True):
                if block.any():
                    _add(found, source, rows @ block)


def _variables(node: Node) -> list[Source]:
    """Return the sources that a node is differentiated by."""
    return [source for source in node.sources if source.kind != "parameter"]


def _jacobian(node: Node) -> ca.Function:
    """Return CasADi's function of the derivatives, without those by parameters."""
    function, n = node.function, len(_variables(node))
    if n == function.n_in():
        return function.jacobian()
    arguments, results = function.sx_in(), function.sx_out()
    y, x = ca.vertcat(*function.call(arguments)), ca.vertcat(*arguments[:n])
    rows = np.cumsum([0, *(function.numel_out(i) for i in range(function.n_out()))]).tolist()
    columns = np.cumsum([0, *(function.numel_in(i) for i in range(n))]).tolist()
    blocks = ca.blocksplit(ca.jacobian(y, x), rows, columns)
    return ca.Function("jacobian", [*arguments, *results], [b for row in blocks for b in row])


def _unknown(blocks: list[np.ndarray]) -> np.ndarray:
    """Return a flag for each column that has a NaN or infinite entry in any of several matrices."""
    return np.any([~np.isfinite(block).all(axis=0) for block in blocks], axis=0)


def _difference(
    function: ca.Function, arguments: list[ca.DM], column: int, k: int
) -> list[np.ndarray]:
    """Return finite differences of all results by one element without analytic derivative.

    Such an element is a length that is zero, or belongs to an inactive case that divides by zero.
    The derivative of a result that is not finite is zero.
    """
    value = float(arguments[column][k])
    step, sides = _DIFFERENCE * max(1.0, abs(value)), []
    for sign in (1.0, -1.0):
        shifted = ca.DM(arguments[column])
        shifted[k] = value + sign * step
        shifted_arguments = [*arguments[:column], shifted, *arguments[column + 1 :]]
        sides.append([result.full().ravel() for result in function.call(shifted_arguments)])
    with np.errstate(invalid="ignore"):
        differences = [(a - b) / (2.0 * step) for a, b in zip(*sides, strict=True)]
    return [np.where(np.isfinite(entries), entries, 0.0) for entries in differences]


def _add(found: Adjoint, source: Source, rows: np.ndarray) -> None:
    found[source] = found[source] + rows if source in found else rows
