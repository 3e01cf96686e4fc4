"""A function that is evaluated a thousand times a second."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import ClassVar

import casadi as ca
import numpy as np

from pfsc_drake.compiled.native_code import native_code


class BoundFunction:
    """A CasADi function with arrays of its own for arguments and results.

    Nothing is allocated and nothing checked in an evaluation: write into the arguments, call
    :meth:`evaluate`, read the results.

    CasADi's interpreter evaluates the function at first. When that has happened so often that
    it pays, the function is compiled (:mod:`~pfsc_drake.compiled.native_code`), if that is
    possible; the results do not change by a bit.

    Args:
        function: The function; arguments and results must be dense.
        shared: Arrays to use for arguments or results of these names, so that functions
            need not copy from each other. Contiguous, of doubles.

    Attributes:
        arguments: Flat arrays by name, each (number of elements,); matrices by columns.
        results: The same of the results.
        compile_after: Number of evaluations by the interpreter before the function is compiled,
            which delays one evaluation; at 0 that is done at once. See also
            :func:`compiled_when_bound`.

    Raises:
        ValueError: If the function has sparse arguments or results, or a shared array does
            not fit.
    """

    compile_after: ClassVar[int] = 200

    def __init__(self, function: ca.Function, **shared: np.ndarray) -> None:
        self._function = function
        self._buffer, self._run = function.buffer()
        self.arguments: dict[str, np.ndarray] = {}
        self.results: dict[str, np.ndarray] = {}
        for i, name in enumerate(function.name_in()):
            values = _array(name, function.sparsity_in(i), shared)
            self._buffer.set_arg(i, values.data)
            self.arguments[name] = values
        for i, name in enumerate(function.name_out()):
            values = _array(name, function.sparsity_out(i), shared)
            self._buffer.set_res(i, values.data)
            self.results[name] = values
        self._left = self.compile_after + 1
        if not self.compile_after:
            self.compile()

    def evaluate(self) -> None:
        """Calculate the results from the arguments."""
        if self._left:
            self._left -= 1
            if not self._left:
                self.compile()
        self._run()

    def compile(self) -> bool:
        """Compile the function now, and return whether that was possible."""
        self._left = 0
        code = native_code(self._function)
        if code is None:
            return False
        self._run = code.bind(list(self.arguments.values()), list(self.results.values()))
        return True


@contextmanager
def compiled_when_bound() -> Iterator[None]:
    """Compile the functions that are bound in this context at once.

    For controllers that are built to run long, and must not pause in the middle: an elastic law
    of six axes takes 0.1 s, other functions a few milliseconds.
    """
    usual = BoundFunction.compile_after
    BoundFunction.compile_after = 0
    try:
        yield
    finally:
        BoundFunction.compile_after = usual


def _array(name: str, sparsity: ca.Sparsity, shared: dict[str, np.ndarray]) -> np.ndarray:
    """Return the array of an argument or result."""
    if not sparsity.is_dense():
        raise ValueError(f"{name}: has {sparsity.dim(True)} nonzeros; must be dense")
    if name not in shared:
        return np.zeros(sparsity.numel())
    values = shared[name]
    fits = values.dtype == np.float64 and values.size == sparsity.numel()
    if not (fits and values.flags.c_contiguous):
        raise ValueError(
            f"{name}: array of {values.size} {values.dtype}; must be {sparsity.numel()} "
            "contiguous doubles"
        )
    return values
