"""Runs of studies, one after the other in the tests' own process."""

import pytest

from experiments.sweep import many
from experiments.sweep.worker import run_task


@pytest.fixture(scope="module", autouse=True)
def in_this_process():
    """Run what a study runs side by side here, where it finds what other runs have built.

    Processes side by side are the subject of ``tests/experiments/sweep``.
    """

    def run_many(tasks, take, *, interrupted):
        for number, task in tasks.items():
            take(number, run_task(task))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(many, "run_many", run_many)
        yield
