"""What others do in processes side by side, done here, where nothing has to be imported anew."""

import pickle
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import pytest

from identification import steps
from identification.measurement.experiment import run_experiment

# of a simulated experiment; the first one is left out, and noise is told from two
FEW_PERIODS = 3


@contextmanager
def one_after_the_other(
    workers: int | None, most: int
) -> Iterator[Callable[[Any, Any, Iterable[Any]], Iterator[Any]]]:
    """Give what runs tasks here, with copies of what would be sent to processes."""

    def run(function: Any, common: Any, tasks: Iterable[Any]) -> Iterator[Any]:
        for task in tasks:
            yield pickle.loads(pickle.dumps(function))(*pickle.loads(pickle.dumps((common, task))))

    yield run


@contextmanager
def short_experiments() -> Iterator[None]:
    """Simulate experiments of few periods, all of them here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steps, "side_by_side", one_after_the_other)
        patch.setattr(steps, "run_experiment", partial(run_experiment, periods=FEW_PERIODS))
        yield
