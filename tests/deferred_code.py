"""Machine code that is made when it pays: most functions of a test are evaluated a few times."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled import bound_function
from pfsc_drake.compiled.content import function_digest
from pfsc_drake.compiled.native_code import native_code

# after so many evaluations it is looked at what they take
BATCH = 100
# of the interpreter, over all tests of a process [s]: to make machine code takes about as long
ENOUGH = 2.0

_batches: Counter[bytes] = Counter()
# of one evaluation [s]: the least that was seen, as a busy machine makes some of them longer
_least: dict[bytes, float] = {}


class DeferredCode:
    """Evaluates a function by CasADi's interpreter until that has taken long, then as machine code.

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
        left = BATCH

        def call() -> None:
            nonlocal buffer, evaluate, left
            left -= 1
            if left:
                evaluate()
                return
            begin = time.thread_time()
            evaluate()
            elapsed, key = time.thread_time() - begin, function_digest(self._function)
            _batches[key] += 1
            _least[key] = min(elapsed, _least.get(key, elapsed))
            spent = BATCH * _batches[key] * _least[key]
            code = native_code(self._function) if spent > ENOUGH else None
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
