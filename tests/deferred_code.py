"""Machine code that is made when it pays: most functions of a test are evaluated a few times."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled import bound_function
from pfsc_drake.compiled.native_code import native_code

# to make machine code takes as long as the interpreter takes for about so many evaluations
MANY = 1000


class DeferredCode:
    """Evaluates a function by CasADi's interpreter, and as machine code after many evaluations.

    The results are the same to the last bit, which ``tests/compiled`` checks.

    Args:
        function: The function.
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function

    def bind(
        self, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]
    ) -> Callable[[], None]:
        """Return a callable that calculates the results from the arguments, as machine code's."""
        buffer, evaluate = self._function.buffer()
        for i, values in enumerate(arguments):
            buffer.set_arg(i, values.data)
        for i, values in enumerate(results):
            buffer.set_res(i, values.data)
        left = MANY

        def call() -> None:
            nonlocal buffer, evaluate, left
            left -= 1
            if left == 0:
                code = native_code(self._function)
                if code is not None:
                    evaluate, buffer = code.bind(arguments, results), None
            evaluate()

        return call


@contextmanager
def compiled_at_once() -> Iterator[None]:
    """Compile all functions that are bound within the context, as a run does."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bound_function, "native_code", native_code)
        yield
