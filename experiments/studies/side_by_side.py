"""Runs of a study, on all cores."""

from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

from experiments.catalog.scenario_file import ScenarioFile
from experiments.sweep.many import run_many
from experiments.sweep.rows import RunRow
from experiments.sweep.worker import RunTask
from reporting.interruption import noticed_interruption

Key = TypeVar("Key", bound=Hashable)


def run_side_by_side(
    scenarios: Mapping[Key, ScenarioFile], take: Callable[[Key, RunRow], None]
) -> dict[Key, RunRow]:
    """Run scenarios on all cores, and return what came of each in their order.

    Args:
        scenarios: By any name.
        take: Told name and outcome of each run, in the order in which they end.

    Raises:
        KeyboardInterrupt: At Ctrl-C.
    """
    keys, rows = list(scenarios), dict[Key, RunRow]()

    def keep(number: int, row: RunRow) -> None:
        rows[keys[number]] = row
        take(keys[number], row)

    tasks = {number: RunTask.of(scenarios[key]) for number, key in enumerate(keys)}
    with noticed_interruption() as interrupted:
        run_many(tasks, keep, interrupted=interrupted)
        if interrupted():
            raise KeyboardInterrupt
    return {key: rows[key] for key in keys}
