"""Look-up in tables, and elements at indices that are calculated."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from pfsc_drake.compiled.code import Code, Values, elements
from pfsc_drake.compiled.operations import Untranslatable, literal

__all__ = ["get_computed", "indices", "look_up", "set_computed"]


def look_up(code: Code, operands: Sequence[Values], mode: str) -> Values:
    """Add a look-up in a table, and return the places.

    Args:
        code: Where it goes.
        operands: The grid and what is looked for.
        mode: ``linear``, ``binary`` or ``exact``.
    """
    grid, sought = operands
    table = code.pointer(grid)
    return [code.low(mode, table, len(grid), x) for x in sought]


def get_computed(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    """Add instructions that read elements at computed indices; beyond the end there is NaN."""
    source, *places = operands
    given = [[code.index(x) for x in p] for p in places]
    part = node.info()
    sums: list[str]
    if "inner" in part:
        sums = [code.plus(i, j) for i in given[0] for j in indices(part["inner"])]
    elif "outer" in part:
        sums = [code.plus(i, j) for j in indices(part["outer"]) for i in given[0]]
    elif len(given) == 2:
        sums = [code.plus(i, j) for j in given[1] for i in given[0]]
    else:
        sums = given[0]
    if not source:
        return [literal(np.nan)] * len(sums)
    array, size = code.pointer(source), len(source)
    return [code.get(array, size, i) for i in sums]


def set_computed(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    """Add instructions that replace or raise elements at computed indices, if there are such."""
    # of other kinds the node does not say the slice
    if len(operands) != 3 or "ParamVector" not in node.class_name():
        raise Untranslatable("assignment at several computed indices")
    old, new, places = operands
    if not old:
        return old
    array, size = code.copy(old), len(old)
    for value, x in zip(new, places, strict=True):
        index = code.index(x)
        if node.op() == ca.OP_ADDNONZEROS_PARAM:
            value = code.apply(ca.OP_ADD, code.get(array, size, index), value)
        code.put(array, size, index, value)
    return elements(array, size)


def indices(part: dict[str, int]) -> range:
    """Return the indices of a slice, as CasADi describes it."""
    return range(part["start"], part["stop"], part["step"])
