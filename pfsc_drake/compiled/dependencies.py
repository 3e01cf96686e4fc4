"""Dependencies of a CasADi function's results on its arguments.

The sparsity of a Jacobian does not show them all: an index into a table has no derivative, and
CasADi omits dependencies through it. Here a value depends on everything that its computation reads.
"""

from typing import TypeAlias

import casadi as ca
import numpy as np
import scipy.sparse as sp

__all__ = ["dependencies", "nonzero_dependencies"]

Pattern: TypeAlias = sp.csr_array | np.ndarray

# any result may depend on any operand, and the Jacobian does not show it all
_READS_EVERYTHING = {
    ca.OP_FIND,
    ca.OP_GETNONZEROS_PARAM,
    ca.OP_SETNONZEROS_PARAM,
    ca.OP_ADDNONZEROS_PARAM,
}
# from this number of entries, operations on sparse patterns are faster than on dense ones
_MANY = 1_000_000


def dependencies(function: ca.Function) -> np.ndarray:
    """Return the dependencies of a function's results on its arguments.

    Args:
        function: Any function.

    Returns:
        Array of bool (number of results, number of arguments), from the structure, not from values:
        true wherever a dependency cannot be excluded.
    """
    # for each element the argument that it belongs to: smaller than all elements
    arguments = np.repeat(np.eye(function.n_in(), dtype=bool), _sizes_in(function), axis=0)
    elements = _Walk().through(function, arguments)
    results = np.split(elements, _ends(_sizes_out(function))[:-1])
    return np.array([rows.any(axis=0) for rows in results]).reshape(-1, function.n_in())


def nonzero_dependencies(function: ca.Function) -> sp.csr_array:
    """Return the dependencies of result elements on argument elements of a function.

    Args:
        function: Any function.

    Returns:
        Array of bool (nonzeros of all results, nonzeros of all arguments), in the order of the
        function.
    """
    return _Walk().function(function)


class _Walk:
    """A traversal of a function and those that it calls, each of them once."""

    def __init__(self) -> None:
        # with the functions, for the keys are their addresses
        self._known: dict[int, tuple[ca.Function, sp.csr_array]] = {}

    def function(self, function: ca.Function) -> sp.csr_array:
        """Return the dependencies of a function, (nonzeros out, nonzeros in)."""
        key = function.__hash__()
        if key not in self._known:
            self._known[key] = function, sp.csr_array(self._of_its_kind(function))
        return self._known[key][1]

    def through(self, function: ca.Function, arguments: np.ndarray) -> np.ndarray:
        """Return the dependencies of the results, from those of the arguments' elements."""
        if function.class_name() == "MXFunction":
            return self._matrices(function, arguments)
        return np.asarray(self.function(function) @ arguments)

    def _of_its_kind(self, function: ca.Function) -> sp.sparray:
        kind, parts = function.class_name(), function.info()
        if kind == "MXFunction":
            elements = sp.eye_array(sum(_sizes_in(function)), dtype=bool, format="csr")
            small = function.sz_w() * elements.shape[0] < _MANY
            return self._matrices(function, elements.toarray() if small else elements)
        if kind == "SXFunction" and not _calls(function):
            return _jacobian(function)
        if kind == "Map":
            return self._map(parts["f"], parts["n"])
        if kind == "Switch" and not parts["project_in"] and not parts["project_out"]:
            return self._switch([*parts["f"], parts["f_def"]])
        return _everything(sum(_sizes_out(function)), sum(_sizes_in(function)))

    def _matrices(self, function: ca.Function, arguments: Pattern) -> Pattern:
        """Return the same for a function of matrix expressions, instruction by instruction."""
        first = [0, *_ends(_sizes_in(function))]
        nothing = arguments[:0]
        # dependencies of the elements in each slot of the interpreter's memory at present
        slots: dict[int, Pattern] = {}
        results = []
        for k in range(function.n_instructions()):
            node, operation = function.instruction_MX(k), function.instruction_id(k)
            if operation == ca.OP_INPUT:
                start = first[node.info()["ind"]] + node.info()["offset"]
                values = arguments[start : start + node.nnz()]
            else:
                read = [
                    slots[slot] if slot >= 0 else _nothing(node.dep(i).nnz(), nothing)
                    for i, slot in enumerate(function.instruction_input(k))
                ]
                if operation == ca.OP_OUTPUT:
                    results.append((node.info()["ind"], node.info()["offset"], read[0]))
                    continue
                values = self._instruction(operation, node, _stack(read, nothing))
            # a node of several results has no size of its own
            several = node.is_call() or node.n_out() > 1
            row = 0
            for i, slot in enumerate(function.instruction_output(k)):
                n_rows = (node.get_output(i) if several else node).nnz()
                if slot >= 0:
                    slots[slot] = values[row : row + n_rows]
                row += n_rows
        results.sort(key=lambda result: result[:2])
        return _stack([values for _, _, values in results], nothing)

    def _instruction(self, operation: int, node: ca.MX, operands: Pattern) -> Pattern:
        """Return the dependencies of an instruction's results, from those of its operands."""
        if not node.n_dep():
            return _nothing(node.nnz(), operands)
        if operation == ca.OP_CALL:
            return self.function(node.which_function()) @ operands
        if operation in _READS_EVERYTHING:
            return _of_all(operands, node.nnz())
        if operation == ca.OP_LOW:
            table, sought = operands[: node.dep(0).nnz()], operands[node.dep(0).nnz() :]
            return _of_all(table, node.nnz()) + sought
        if node.is_unary() or node.is_binary():
            pattern = _entry_by_entry(node, operands)
            if pattern is not None:
                return pattern
        # in isolation, so that the pattern shows this instruction only
        symbols = [ca.MX.sym(f"x{i}", node.dep(i).sparsity()) for i in range(node.n_dep())]
        return _jacobian(ca.Function("f", symbols, node.eval_mx(symbols))) @ operands

    def _map(self, function: ca.Function, repetitions: int) -> sp.sparray:
        """Return the same for a function that is evaluated for one set of columns after another."""
        each = sp.eye_array(repetitions, dtype=bool)
        once = self.function(function)
        rows = np.split(np.arange(once.shape[0]), _ends(_sizes_out(function))[:-1])
        columns = np.split(np.arange(once.shape[1]), _ends(_sizes_in(function))[:-1])
        return sp.block_array([[sp.kron(each, once[r][:, c]) for c in columns] for r in rows])

    def _switch(self, cases: list[ca.Function]) -> sp.sparray:
        """Return the same for a function whose first argument selects one of several."""
        any_case = sum((self.function(case) for case in cases[1:]), self.function(cases[0]))
        return sp.hstack([_everything(any_case.shape[0], 1), any_case])


def _entry_by_entry(node: ca.MX, operands: Pattern) -> Pattern | None:
    """Return the same for an elementwise operation; None if entries do not correspond."""
    sizes = [node.dep(i).nnz() for i in range(node.n_dep())]
    if any(size not in (1, node.nnz()) for size in sizes):
        return None
    pattern = operands[:0]
    for size, last in zip(sizes, _ends(sizes), strict=True):
        rows = operands[np.arange(last - size, last) if size > 1 else [last - 1] * node.nnz()]
        pattern = pattern + rows if pattern.shape[0] else rows
    return pattern


def _jacobian(function: ca.Function) -> sp.csr_array:
    """Return the Jacobian's pattern, (nonzeros out, nonzeros in)."""
    rows: list[int] = []
    columns: list[int] = []
    first_row = 0
    for o, n_rows in enumerate(_sizes_out(function)):
        first_column = 0
        for i, n_columns in enumerate(_sizes_in(function)):
            block = function.jac_sparsity(o, i, True).get_triplet()
            rows += [first_row + row for row in block[0]]
            columns += [first_column + column for column in block[1]]
            first_column += n_columns
        first_row += n_rows
    shape = first_row, sum(_sizes_in(function))
    return sp.csr_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=shape)


def _calls(function: ca.Function) -> bool:
    """Return whether a function of scalar expressions calls others."""
    return bool(function.find_functions())


def _everything(n_rows: int, n_columns: int) -> sp.csr_array:
    """Return a pattern in which everything depends on everything."""
    return sp.csr_array(np.ones((n_rows, n_columns), dtype=bool))


def _of_all(operands: Pattern, n_rows: int) -> Pattern:
    """Return the pattern of results that each depend on all operands, of any number."""
    if isinstance(operands, np.ndarray):
        return np.repeat(operands.any(axis=0, keepdims=True), n_rows, axis=0)
    columns = np.unique(operands.nonzero()[1])
    rows, every = np.repeat(np.arange(n_rows), len(columns)), np.tile(columns, n_rows)
    shape = n_rows, operands.shape[1]
    return sp.csr_array((np.ones(len(rows), dtype=bool), (rows, every)), shape=shape)


def _nothing(n_rows: int, like: Pattern) -> Pattern:
    """Return a pattern in which nothing depends on anything."""
    shape = n_rows, like.shape[1]
    if isinstance(like, np.ndarray):
        return np.zeros(shape, dtype=bool)
    return sp.csr_array(shape, dtype=bool)


def _stack(patterns: list[Pattern], nothing: Pattern) -> Pattern:
    """Return patterns below each other; there may be none."""
    if isinstance(nothing, np.ndarray):
        return np.vstack([nothing, *patterns])
    return sp.vstack([nothing, *patterns], format="csr")


def _sizes_in(function: ca.Function) -> list[int]:
    """Return the number of nonzeros of each argument."""
    return [function.nnz_in(i) for i in range(function.n_in())]


def _sizes_out(function: ca.Function) -> list[int]:
    """Return the number of nonzeros of each result."""
    return [function.nnz_out(i) for i in range(function.n_out())]


def _ends(sizes: list[int]) -> np.ndarray:
    """Return the ends of consecutive pieces."""
    return np.cumsum(np.array(sizes, dtype=int))
