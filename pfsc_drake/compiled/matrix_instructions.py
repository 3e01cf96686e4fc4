"""Instructions of CasADi's matrix functions as instructions on numbers.

Moving numbers (slices, concatenation, transposition) costs nothing: they only get other names. The
order of every sum is the interpreter's.
"""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from pfsc_drake.compiled.code import Code, LiteralTable, Value, Values, elements
from pfsc_drake.compiled.operations import Untranslatable, is_known, literal, operation_name

__all__ = [
    "get_computed",
    "indices",
    "look_up",
    "project",
    "set_computed",
    "translate_instruction",
]


def look_up(code: Code, operands: Sequence[Values], mode: str) -> Values:
    """Add a look-up in a table, and return the indices.

    Args:
        code: Code that it is added to.
        operands: The grid and the numbers to look up.
        mode: ``linear``, ``binary`` or ``exact``.
    """
    grid, sought = operands
    table = code.pointer(grid)
    return [code.low(mode, table, len(grid), x) for x in sought]


def get_computed(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    """Add instructions that read elements at computed indices; out of range there is NaN."""
    source, *indices_in = operands
    computed = [[code.index(x) for x in p] for p in indices_in]
    part = node.info()
    sums: list[str]
    if "inner" in part:
        sums = [code.plus(i, j) for i in computed[0] for j in indices(part["inner"])]
    elif "outer" in part:
        sums = [code.plus(i, j) for j in indices(part["outer"]) for i in computed[0]]
    elif len(computed) == 2:
        sums = [code.plus(i, j) for j in computed[1] for i in computed[0]]
    else:
        sums = computed[0]
    if not source:
        return [literal(np.nan)] * len(sums)
    array, size = code.pointer(source), len(source)
    return [code.get(array, size, i) for i in sums]


def set_computed(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    """Add instructions that replace, or add to, elements at computed indices within range."""
    # for other kinds the node does not contain the slice
    if len(operands) != 3 or "ParamVector" not in node.class_name():
        raise Untranslatable("assignment at several computed indices")
    old, new, indices_in = operands
    if not old:
        return old
    array, size = code.copy(old), len(old)
    for value, x in zip(new, indices_in, strict=True):
        index = code.index(x)
        if node.op() == ca.OP_ADDNONZEROS_PARAM:
            value = code.apply(ca.OP_ADD, code.get(array, size, index), value)
        code.put(array, size, index, value)
    return elements(array, size)


def indices(part: dict[str, int]) -> range:
    """Return the indices of a slice, as CasADi describes it."""
    return range(part["start"], part["stop"], part["step"])


def translate_instruction(
    code: Code, operation: int, node: ca.MX, operands: Sequence[Values]
) -> list[Values]:
    """Add an instruction of a matrix function, and return its results' nonzeros.

    Args:
        code: Code that it is added to.
        operation: The instruction as CasADi counts them; no input, output, call or table look-up.
        node: Expression of the instruction.
        operands: Nonzeros of its operands.

    Raises:
        Untranslatable: If the instruction is not known.
    """
    if is_known(operation):
        return [_elementwise(code, operation, operands)]
    if operation in _SEVERAL_RESULTS:
        return _split(node, operands[0])
    if operation not in _INSTRUCTIONS:
        raise Untranslatable(f"operation {operation_name(operation)}")
    return [_INSTRUCTIONS[operation](code, node, operands)]


def project(values: Values, source: ca.Sparsity, target: ca.Sparsity) -> Values:
    """Return the nonzeros of a matrix with another pattern."""
    number_of = {element: i for i, element in enumerate(source.find())}
    return [values[number_of[i]] if i in number_of else literal(0.0) for i in target.find()]


def _elementwise(code: Code, operation: int, operands: Sequence[Values]) -> Values:
    size = max(len(values) for values in operands)
    if any(len(values) not in (1, size) for values in operands):
        raise Untranslatable(f"sizes of {operation_name(operation)}")
    spread = [[*values] * size if len(values) == 1 else values for values in operands]
    return [code.apply(operation, *values) for values in zip(*spread, strict=True)]


def _constant(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return LiteralTable(np.array(node.to_DM().nonzeros()))


def _same(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return operands[0]


def _concatenate(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return [value for values in operands for value in values]


def _split(node: ca.MX, values: Values) -> list[Values]:
    ends = np.cumsum([node.get_output(i).nnz() for i in range(node.n_out())]).tolist()
    return [values[start:end] for start, end in zip([0, *ends], ends, strict=False)]


def _repeat(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return [*operands[0]] * (node.nnz() // max(len(operands[0]), 1))


def _sum(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    result: list[Value] = [literal(0.0)] * node.nnz()
    for start in range(0, len(operands[0]), max(node.nnz(), 1)):
        block = operands[0][start : start + node.nnz()]
        result = [code.apply(ca.OP_ADD, x, r) for x, r in zip(block, result, strict=True)]
    return result


def _transpose(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    _, order = node.dep(0).sparsity().transpose()
    return [operands[0][i] for i in order]


def _project(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return project(operands[0], node.dep(0).sparsity(), node.sparsity())


def _select(node: ca.MX) -> list[int]:
    """Return the nonzeros that an instruction reads or writes; negative indices are none."""
    what = node.info()
    if "nz" in what:
        return what["nz"]
    if "slice" in what:
        return list(indices(what["slice"]))
    return [o + i for o in indices(what["outer"]) for i in indices(what["inner"])]


def _get(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return [operands[0][i] if i >= 0 else literal(0.0) for i in _select(node)]


def _set(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    result, new = list(operands[0]), operands[1]
    for i, value in zip(_select(node), new, strict=True):
        if i >= 0:
            result[i] = code.apply(ca.OP_ADD, result[i], value) if node.info()["add"] else value
    return result


def _product(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    result, x, y = list(operands[0]), operands[1], operands[2]
    number_of = {at: i for i, at in enumerate(zip(*node.sparsity().get_triplet(), strict=True))}
    left, right = node.dep(1).sparsity(), node.dep(2).sparsity()
    starts, rows = left.colind(), left.row()
    for k, (inner, column) in enumerate(zip(*right.get_triplet(), strict=True)):
        for i in range(starts[inner], starts[inner + 1]):
            z = number_of.get((rows[i], column))
            if z is not None:
                term = code.apply(ca.OP_MUL, x[i], y[k])
                result[z] = code.apply(ca.OP_ADD, result[z], term)
    return result


def _rank_one(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    matrix, (factor,), x, y = operands
    result: list[Value] = []
    for a, row, column in zip(matrix, *node.sparsity().get_triplet(), strict=True):
        term = code.apply(ca.OP_MUL, code.apply(ca.OP_MUL, factor, x[row]), y[column])
        result.append(code.apply(ca.OP_ADD, a, term))
    return result


def _bilinear(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    matrix, x, y = operands
    result: Value = literal(0.0)
    for a, row, column in zip(matrix, *node.dep(0).sparsity().get_triplet(), strict=True):
        term = code.apply(ca.OP_MUL, code.apply(ca.OP_MUL, x[row], a), y[column])
        result = code.apply(ca.OP_ADD, result, term)
    return [result]


def _kronecker(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    left, right = (
        dict(zip(zip(*node.dep(i).sparsity().get_triplet(), strict=True), values, strict=True))
        for i, values in enumerate(operands)
    )
    n_rows, n_columns = node.dep(1).shape
    return [
        code.apply(
            ca.OP_MUL,
            left[row // n_rows, column // n_columns],
            right[row % n_rows, column % n_columns],
        )
        for row, column in zip(*node.sparsity().get_triplet(), strict=True)
    ]


def _dot(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    result: Value = literal(0.0)
    for x, y in zip(*operands, strict=True):
        result = code.apply(ca.OP_ADD, result, code.apply(ca.OP_MUL, x, y))
    return [result]


def _norm_2(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return [code.apply(ca.OP_SQRT, *_dot(code, node, [operands[0], operands[0]]))]


def _norm_1(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return _reduce(code, ca.OP_ADD, 0.0, [code.apply(ca.OP_FABS, x) for x in operands[0]])


def _norm_inf(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    return _reduce(code, ca.OP_FMAX, 0.0, [code.apply(ca.OP_FABS, x) for x in operands[0]])


def _largest(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    start = -np.inf if node.dep(0).is_dense() else 0.0
    return _reduce(code, ca.OP_FMAX, start, operands[0])


def _smallest(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    start = np.inf if node.dep(0).is_dense() else 0.0
    return _reduce(code, ca.OP_FMIN, start, operands[0])


def _reduce(code: Code, operation: int, start: float, values: Values) -> Values:
    result: Value = literal(start)
    for value in values:
        # of 0 and -0 the interpreter takes the last, the operation the first
        result = code.apply(operation, value, result)
    return [result]


def _find(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    sparsity = node.dep(0).sparsity()
    result = literal(float(sparsity.size1()))
    for value, row in reversed(list(zip(operands[0], sparsity.row(), strict=True))):
        is_zero = code.apply(ca.OP_EQ, value, literal(0.0))
        further = code.apply(ca.OP_IF_ELSE_ZERO, is_zero, result)
        here = code.apply(ca.OP_NOT, is_zero)
        result = code.apply(
            ca.OP_ADD, further, code.apply(ca.OP_IF_ELSE_ZERO, here, literal(float(row)))
        )
    return [result]


_SEVERAL_RESULTS = {ca.OP_VERTSPLIT, ca.OP_HORZSPLIT, ca.OP_DIAGSPLIT}
_INSTRUCTIONS: dict[int, Callable[[Code, ca.MX, Sequence[Values]], Values]] = {
    ca.OP_CONST: _constant,
    ca.OP_RESHAPE: _same,
    ca.OP_SPARSITY_CAST: _same,
    ca.OP_VERTCAT: _concatenate,
    ca.OP_HORZCAT: _concatenate,
    ca.OP_DIAGCAT: _concatenate,
    ca.OP_HORZREPMAT: _repeat,
    ca.OP_HORZREPSUM: _sum,
    ca.OP_TRANSPOSE: _transpose,
    ca.OP_PROJECT: _project,
    ca.OP_GETNONZEROS: _get,
    ca.OP_SETNONZEROS: _set,
    ca.OP_ADDNONZEROS: _set,
    ca.OP_GETNONZEROS_PARAM: get_computed,
    ca.OP_SETNONZEROS_PARAM: set_computed,
    ca.OP_ADDNONZEROS_PARAM: set_computed,
    ca.OP_MTIMES: _product,
    ca.OP_RANK1: _rank_one,
    ca.OP_BILIN: _bilinear,
    ca.OP_KRON: _kronecker,
    ca.OP_DOT: _dot,
    ca.OP_NORMF: _norm_2,
    ca.OP_NORM1: _norm_1,
    ca.OP_NORMINF: _norm_inf,
    ca.OP_MMAX: _largest,
    ca.OP_MMIN: _smallest,
    ca.OP_FIND: _find,
}
