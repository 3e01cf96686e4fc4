"""A compiled function of plain floats."""

import struct

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction


class PlainFunction:
    """A CasADi function that takes and returns plain floats, see :class:`BoundFunction`.

    For callers that compute with single floats: in a tick of 1 ms an array costs more than many a
    formula.

    Args:
        function: The function; arguments and results must be dense.
    """

    def __init__(self, function: ca.Function) -> None:
        arguments, results = function.name_in(), function.name_out()
        given = np.zeros(sum(function.numel_in(name) for name in arguments))
        made = np.zeros(sum(function.numel_out(name) for name in results))
        parts: dict[str, np.ndarray] = {}
        for names, sizes, flat in (
            (arguments, function.numel_in, given),
            (results, function.numel_out, made),
        ):
            ends = np.cumsum([sizes(name) for name in names])
            parts |= dict(zip(names, np.split(flat, ends[:-1]), strict=True))
        self._evaluate = BoundFunction(function, **parts).evaluate
        self._given, self._made = given.data, made.data
        self._write = struct.Struct(f"{given.size}d").pack_into
        self._read = struct.Struct(f"{made.size}d").unpack_from

    def __call__(self, *values: float) -> tuple[float, ...]:
        """Return all elements of the results from those of the arguments, one after the other."""
        self._write(self._given, 0, *values)
        self._evaluate()
        return self._read(self._made)
