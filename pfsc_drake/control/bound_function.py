"""A compiled function that is called a thousand times a second."""

import casadi as ca
import numpy as np


class BoundFunction:
    """A CasADi function with arrays of its own for arguments and results.

    Nothing is allocated and nothing checked in a call: write into the arguments, call
    :attr:`evaluate`, read the results.

    Args:
        function: The function; arguments and results must be dense.
        shared: Arrays to use for arguments or results of these names, so that functions
            need not copy from each other. Contiguous, of doubles.

    Attributes:
        arguments: Flat arrays by name, each (number of elements,); matrices by columns.
        results: The same of the results.
        evaluate: Calculates the results from the arguments.
    """

    def __init__(self, function: ca.Function, **shared: np.ndarray) -> None:
        self._buffer, self.evaluate = function.buffer()
        self.arguments: dict[str, np.ndarray] = {}
        self.results: dict[str, np.ndarray] = {}
        for i, name in enumerate(function.name_in()):
            values = shared.get(name, np.zeros(function.numel_in(i)))
            self._buffer.set_arg(i, values.data)
            self.arguments[name] = values
        for i, name in enumerate(function.name_out()):
            values = shared.get(name, np.zeros(function.numel_out(i)))
            self._buffer.set_res(i, values.data)
            self.results[name] = values
