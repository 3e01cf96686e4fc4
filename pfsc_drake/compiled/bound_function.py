"""Functions for evaluation a thousand times a second, on fixed arrays."""

import functools
import struct
from collections.abc import Callable

import casadi as ca
import numpy as np

from pfsc_drake.compiled.native_code import native_code


class BoundFunction:
    """A CasADi function with its own arrays for arguments and results.

    An evaluation allocates nothing and checks nothing: write into the arguments, call
    :attr:`evaluate`, read the results.

    The function is compiled when it is bound, so that all evaluations take the same time
    (:mod:`~pfsc_drake.compiled.native_code`: once per content, with a cache on disk). A function
    that cannot be compiled is left to CasADi's interpreter; the results are the same to the last
    bit.

    Args:
        function: The function; arguments and results must be dense.
        often: Whether it is evaluated so often that machine code pays off.
        shared: Arrays to use for arguments or results of these names, so that functions need not
            copy from each other. Contiguous, of doubles.

    Attributes:
        arguments: Flat arrays by name, each (number of elements,); matrices by columns.
        results: The same for the results.
        evaluate: Compute the results from the arguments.

    Raises:
        ValueError: If the function has sparse arguments or results, or a shared array does
            not fit.
    """

    def __init__(self, function: ca.Function, often: bool = True, /, **shared: np.ndarray) -> None:
        self.arguments = {
            name: _array(name, function.sparsity_in(i), shared)
            for i, name in enumerate(function.name_in())
        }
        self.results = {
            name: _array(name, function.sparsity_out(i), shared)
            for i, name in enumerate(function.name_out())
        }
        self.evaluate: Callable[[], None]
        self._function = function
        code = native_code(function) if often else None
        if code is None:
            self.evaluate = self._bind_interpreter(function)
        else:
            self.evaluate = code.bind([*self.arguments.values()], [*self.results.values()])

    def __content__(self) -> ca.Function:
        """Return the content that determines it: the arrays are written before every use."""
        return self._function

    def _bind_interpreter(self, function: ca.Function) -> Callable[[], None]:
        buffer, evaluate = function.buffer()
        for i, values in enumerate(self.arguments.values()):
            buffer.set_arg(i, values.data)
        for i, values in enumerate(self.results.values()):
            buffer.set_res(i, values.data)
        call = functools.partial(evaluate)
        vars(call)["keeps_alive"] = buffer
        return call


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


class PlainFunction:
    """A CasADi function that takes and returns plain floats, see :class:`BoundFunction`.

    For callers that compute with single floats: in a tick of 1 ms an array costs more than many
    formulas.

    Args:
        function: The function; arguments and results must be dense.
    """

    def __init__(self, function: ca.Function) -> None:
        arguments, results = function.name_in(), function.name_out()
        inputs = np.zeros(sum(function.numel_in(name) for name in arguments))
        outputs = np.zeros(sum(function.numel_out(name) for name in results))
        parts: dict[str, np.ndarray] = {}
        for names, sizes, flat in (
            (arguments, function.numel_in, inputs),
            (results, function.numel_out, outputs),
        ):
            ends = np.cumsum([sizes(name) for name in names])
            parts |= dict(zip(names, np.split(flat, ends[:-1]), strict=True))
        self._evaluate = BoundFunction(function, **parts).evaluate
        self._inputs, self._outputs = inputs.data, outputs.data
        self._write = struct.Struct(f"{inputs.size}d").pack_into
        self._read = struct.Struct(f"{outputs.size}d").unpack_from

    def __call__(self, *values: float) -> tuple[float, ...]:
        """Return all elements of the results from all elements of the arguments, in order."""
        self._write(self._inputs, 0, *values)
        self._evaluate()
        return self._read(self._outputs)
