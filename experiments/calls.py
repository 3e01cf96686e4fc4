"""What all calls from scripts and notebooks share: scenarios, folders, progress, silence."""

import logging
import shutil
import tempfile
import warnings
import weakref
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from diagrams.scenario import Scenario
from experiments.finished_run import RunOutcome
from experiments.kept_run import Run, load
from experiments.scenario_file import ScenarioFile, apply_change, expand_home, read_scenario
from pfsc_drake.errors import WriteError
from pfsc_drake.yaml.typed import typed_data
from reporting.notebook import NotebookProgress, in_notebook
from reporting.progress import ProgressDisplay


def read_given(scenario: str | Path | Scenario, changes: Mapping[str, Any]) -> ScenarioFile:
    """Return a scenario with changes.

    Args:
        scenario: Name of a shipped scenario, path of a YAML file, or one as made in Python.
        changes: Values by ``key.path``.

    Raises:
        InputError: If there is none, or no such key.
    """
    if isinstance(scenario, Scenario):
        path = Path.cwd() / f"{scenario.name or 'scenario'}.yaml"
        loaded = ScenarioFile(path, typed_data(scenario))
    else:
        loaded = read_scenario(str(scenario), [])
    for key, value in changes.items():
        apply_change(loaded.data, key, value)
    return loaded


@dataclass
class ResultFolder:
    """Where a run leaves its results.

    Attributes:
        path: The folder.
        is_temporary: Whether it goes with the run that is returned.
    """

    path: Path
    is_temporary: bool

    def run_of(self, outcome: RunOutcome) -> Run:
        """Return the run that is in the folder.

        Args:
            outcome: What is known of how it ended.

        Raises:
            WriteError: If results could not be written.
        """
        if outcome.problem is not None:
            raise WriteError(outcome.problem)
        result = load(self.path)
        if self.is_temporary:
            weakref.finalize(result, shutil.rmtree, str(self.path), ignore_errors=True)
        return result


@contextmanager
def result_folder(out: str | Path | None) -> Iterator[ResultFolder]:
    """Give a folder for results; a temporary one is gone where nothing came of it.

    Args:
        out: The folder; None for a temporary one.
    """
    if out is not None:
        yield ResultFolder(expand_home(Path(out)), False)
        return
    folder = Path(tempfile.mkdtemp(prefix="pfsc_drake_run_"))
    try:
        yield ResultFolder(folder, True)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


class _Silence:
    """Shows nothing."""

    def expect(self, duration: float) -> None:
        """Leave it."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Leave it."""


@contextmanager
def _silence() -> Iterator[_Silence]:
    yield _Silence()


def shown_progress(
    title: str, duration: float | None, quiet: bool, *, paced: bool = True
) -> AbstractContextManager[NotebookProgress | ProgressDisplay | _Silence]:
    """Return what shows progress here.

    Args:
        title: Name of what goes on.
        duration: Simulated time [s], if it is known.
        quiet: Whether to show nothing.
        paced: Whether there is a simulated time.
    """
    if quiet:
        return _silence()
    if in_notebook():
        return NotebookProgress(title)
    return ProgressDisplay(Console(), title, duration, paced=paced)


@contextmanager
def only_own_words() -> Iterator[None]:
    """Let libraries be silent: what matters is in the outcome, in words of its own."""
    drake = logging.getLogger("drake")
    level = drake.level
    drake.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        drake.setLevel(level)
