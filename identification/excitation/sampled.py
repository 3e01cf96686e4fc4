"""A CasADi function of one sample, evaluated for all samples of a motion."""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from pfsc_drake.compiled.native_code import native_code


class SampledFunction:
    """Evaluates a function K times at once, as machine code where that is possible.

    Args:
        function: SX inside, with dense results.
        samples: Number K.
    """

    def __init__(self, function: ca.Function, samples: int) -> None:
        inputs, outputs = range(function.n_in()), range(function.n_out())
        self._arguments = [np.zeros((samples, function.numel_in(i))) for i in inputs]
        self._results = [np.zeros((samples, function.numel_out(i))) for i in outputs]
        self._calls: list[Callable[[], None]] = []
        code = native_code(function)
        if code is not None:
            rows = range(samples)
            self._calls = [
                code.bind([x[k] for x in self._arguments], [x[k] for x in self._results])
                for k in rows
            ]
        else:
            self._mapped = function.map(samples)
            self._buffer, run = self._mapped.buffer()
            for i, array in enumerate(self._arguments):
                self._buffer.set_arg(i, array.ravel().data)
            for i, array in enumerate(self._results):
                self._buffer.set_res(i, array.ravel().data)
            self._calls = [run]

    def __call__(self, *arguments: np.ndarray) -> Sequence[np.ndarray]:
        """Return the results.

        They are overwritten by the next call.

        Args:
            arguments: One array (K, n) each; matrices by columns.

        Returns:
            One array (K, n) each; matrices by columns.
        """
        for own, given in zip(self._arguments, arguments, strict=True):
            own[:] = given.reshape(own.shape)
        for call in self._calls:
            call()
        return self._results
