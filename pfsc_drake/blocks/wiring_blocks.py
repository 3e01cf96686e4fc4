"""Blocks that only route vectors."""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values


class Collect(Block):
    """Several vectors as one.

    Ports:
        (inputs): One for each part.
        all (output): The parts one after another.

    Args:
        sizes: Sizes of the parts, by the names of their ports.

    Attributes:
        rows: Slices of the parts in the whole vector.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        ends = np.cumsum([0, *sizes.values()]).tolist()
        self.rows = {
            name: slice(a, b) for name, a, b in zip(sizes, ends[:-1], ends[1:], strict=True)
        }
        self.inputs = {name: Port(size) for name, size in sizes.items()}
        self.outputs, self.states = {"all": Port(ends[-1])}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"all": ca.vertcat(*(getattr(u, name) for name in self.inputs))}


class Rows(Block):
    """Some elements of a vector.

    Ports:
        whole (input): The vector, shape (size,).
        part (output): The elements, shape (len(rows),).

    Args:
        size: Size of the whole vector.
        rows: Indices of the elements.
    """

    def __init__(self, size: int, rows: Sequence[int]) -> None:
        self._rows = [int(row) for row in rows]
        self.inputs, self.outputs = {"whole": Port(size)}, {"part": Port(len(self._rows))}
        self.states = {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"part": u.whole[self._rows]}


class Linear(Block):
    """A constant matrix times a vector.

    Ports:
        vector (input): Shape (columns,).
        product (output): Shape (rows,).

    Args:
        matrix: Shape (rows, columns).
    """

    def __init__(self, matrix: np.ndarray) -> None:
        self._matrix = ca.sparsify(ca.DM(np.asarray(matrix, dtype=float)))
        rows, columns = self._matrix.shape
        self.inputs, self.outputs = {"vector": Port(columns)}, {"product": Port(rows)}
        self.states = {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"product": ca.densify(self._matrix @ u.vector)}


class Sum(Block):
    """The sum of vectors of one size.

    Ports:
        term_0, term_1, .. (input): The terms.
        sum (output): Their sum, from the first to the last.

    Args:
        count: Number of terms.
        size: Size of each.
    """

    def __init__(self, count: int, size: int) -> None:
        self.inputs = {f"term_{k}": Port(size) for k in range(count)}
        self.outputs, self.states = {"sum": Port(size)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        terms = [getattr(u, name) for name in self.inputs]
        return {"sum": sum(terms[1:], terms[0])}


class Constant(Block):
    """A constant vector.

    Ports:
        value (output): The vector.

    Args:
        value: The vector.
    """

    def __init__(self, value: Sequence[float] | np.ndarray) -> None:
        self._value = ca.DM(np.array(value, dtype=float))
        self.inputs, self.states = {}, {}
        self.outputs = {"value": Port(self._value.numel())}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"value": self._value}


class Hold(Block):
    """A delay of one tick or several ticks.

    Ports:
        value (input): The vector.
        held (output): The vector one tick, or ``ticks`` ticks, ago, zero before; without direct
            feedthrough.

    State:
        The last ``ticks`` vectors as ``held``, the oldest first, shape (ticks size,).

    Args:
        size: Size of the vector.
        ticks: Number of ticks of the delay.
    """

    def __init__(self, size: int, ticks: int = 1) -> None:
        self.inputs, self.outputs = {"value": Port(size)}, {"held": Port(size)}
        self.states, self._size = {"held": ticks * size}, size

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"held": x.held[: self._size]}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; states left out stay the same."""
        return {"held": ca.vertcat(*ca.vertsplit(x.held, self._size)[1:], u.value)}
