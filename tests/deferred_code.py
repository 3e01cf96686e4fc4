"""Machine code that is made when it pays: most functions of a test are evaluated a few times."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled import bound_function
from pfsc_drake.compiled.content import function_digest
from pfsc_drake.compiled.native_code import native_code

# evaluations are counted by so many
BATCH = 100
# over all tests of a process: to make machine code takes the interpreter's time for as many
ENOUGH = 3000

_evaluations: Counter[bytes] = Counter()


class DeferredCode:
    """Evaluates a function by CasADi's interpreter, and as machine code when that has paid.

    Evaluations are counted, not timed: a process that others disturb would make code too early. The
    results are the same to the last bit, which ``tests/compiled`` checks.

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
        left = BATCH

        def call() -> None:
            nonlocal buffer, evaluate, left
            left -= 1
            if left:
                evaluate()
                return
            evaluate()
            key = function_digest(self._function)
            _evaluations[key] += BATCH
            code = native_code(self._function) if _evaluations[key] >= ENOUGH else None
            if code is None:
                left = BATCH
            else:
                evaluate, buffer = code.bind(arguments, results), None

        return call


@contextmanager
def code_made(make: Callable[[ca.Function], object]) -> Iterator[None]:
    """Bind all functions within the context to what a function returns for them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bound_function, "native_code", make)
        yield


def compiled_at_once() -> AbstractContextManager[None]:
    """Compile all functions that are bound within the context, as a run does."""
    return code_made(native_code)


def interpreted() -> AbstractContextManager[None]:
    """Leave all functions that are bound within the context to CasADi's interpreter for good."""
    return code_made(lambda function: None)
