"""One of many runs: the task for a process, and the row of its results."""

import logging
import math
import socket
import threading
import time
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from experiments.scenario_file import SCENARIO_DIRECTORY, ScenarioFile
from pfsc_drake.errors import InputError, shorten
from pfsc_drake.yaml.source import Locations
from reporting import processes
from reporting.metrics import Metrics
from reporting.provenance import git_revision
from reporting.terminal import one_line, silence_libraries

COMPLETED = "completed"
FAULT = "fault"  # the run was stopped by one
REFUSED = "refused"  # the scenario is wrong
FAILED = "failed"  # an error of the program or of the machine
DIED = "died"  # the process that ran it has ended
STATUSES = (COMPLETED, FAULT, REFUSED, FAILED, DIED)
_TEXTS, _TIMES = ("status", "reason", "host", "revision"), ("end", "seconds")
# of a worker that has several threads: compilation and the garbage collector know but one run
_ONE_AT_A_TIME = threading.Lock()


@dataclass
class RunRow:
    """Row of one run.

    Attributes:
        status: One of STATUSES.
        reason: Why it did not complete; empty if it did.
        metrics: Its metrics; none if it never started.
        warnings: Warnings, one sentence each.
        end: Simulated time at the end [s].
        seconds: Wall clock time [s].
        host: Machine that ran it.
        revision: Revision of the program there.
        memory: Memory of its process after the run [bytes]; not saved.
    """

    status: str
    reason: str = ""
    metrics: Metrics = field(default_factory=Metrics)
    warnings: list[str] = field(default_factory=list)
    end: float = math.nan
    seconds: float = math.nan
    host: str = ""
    revision: str = ""
    memory: float = 0.0

    @property
    def is_final(self) -> bool:
        """Whether a repetition would have the same outcome; not after errors of the machine."""
        return self.status not in (FAILED, DIED)

    def value(self, metric: str) -> float:
        """Return the value of a metric; NaN if the run did not complete."""
        return self.metrics[metric].value if self.status == COMPLETED else math.nan

    def to_data(self) -> dict[str, Any]:
        """Return the row as data for JSON; NaN is null."""
        data = {field.name: getattr(self, field.name) for field in fields(self)}
        del data["memory"]
        data["metrics"] = self.metrics.to_data()
        return data | {name: None for name in _TIMES if not math.isfinite(data[name])}

    @classmethod
    def from_data(cls, data: dict[str, Any]) -> "RunRow":
        """Return the row from data of :meth:`to_data`.

        Raises:
            KeyError, TypeError, ValueError, AttributeError: If it is something else.
        """
        if data["status"] not in STATUSES:
            raise ValueError(data["status"])
        values: dict[str, Any] = {name: str(data[name]) for name in _TEXTS}
        values |= {name: math.nan if data[name] is None else float(data[name]) for name in _TIMES}
        values["metrics"] = Metrics.from_data(data["metrics"])
        values["warnings"] = [str(warning) for warning in data["warnings"]]
        return cls(**values)


@dataclass(frozen=True)
class RunTask:
    """Run as a task for a worker.

    Attributes:
        file: Name of the scenario's file.
        folder: Its folder, which names in it are relative to; None for a shipped scenario, which
            every machine has in its own folder.
        data: Its content with all overrides.
        duration: Simulated time [s] instead of the scenario's; or None.
        locations: Locations of its keys, for messages.
    """

    file: str
    folder: Path | None
    data: dict[str, Any]
    duration: float | None
    locations: Locations = field(default_factory=dict)

    @classmethod
    def of(cls, scenario: ScenarioFile, duration: float | None = None) -> "RunTask":
        """Return the task to run a scenario."""
        folder = scenario.path.parent.resolve()
        is_shipped = folder == SCENARIO_DIRECTORY
        return cls(
            scenario.path.name,
            None if is_shipped else folder,
            scenario.data,
            duration,
            scenario.locations,
        )

    def scenario(self) -> ScenarioFile:
        """Return the scenario on this machine."""
        path = (self.folder or SCENARIO_DIRECTORY) / self.file
        return ScenarioFile(path, self.data, self.locations)


class _Clock:
    """Progress listener that stores the simulated time."""

    def __init__(self) -> None:
        self.simulated_time = 0.0

    def expect(self, duration: float) -> None:
        """Ignore the duration."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Take the time [s]."""
        self.simulated_time = max(self.simulated_time, simulated_time)


def run_task(task: RunTask) -> RunRow:
    """Run a scenario without figures and recording, and return its row.

    Errors of the run are reported in its row.
    """
    import psutil  # comes with Dask

    begin, clock = time.perf_counter(), _Clock()
    with _ONE_AT_A_TIME:
        row = _run(task, clock)
    row.end, row.seconds = clock.simulated_time, time.perf_counter() - begin
    row.host, row.revision = socket.gethostname(), program_revision()
    row.memory = float(psutil.Process().memory_info().rss)
    return row


def _run(task: RunTask, clock: _Clock) -> RunRow:
    logging.getLogger("drake").setLevel(logging.CRITICAL)
    try:
        from experiments.simulated_run import (
            RunOptions,
            run_scenario,
        )  # Drake takes seconds to import

        with TemporaryDirectory(prefix="pfsc_drake_sweep_") as folder:
            outcome = run_scenario(
                task.scenario(),
                out=Path(folder) / "run",
                options=RunOptions(task.duration, figures=False, recording=False),
                progress=clock,
            )
    except InputError as error:
        return RunRow(REFUSED, one_line(str(error)))
    except Exception as error:  # whatever it is, the other runs go on
        reason = one_line(f"{type(error).__name__}: {error}")
        return RunRow(FAILED, shorten(reason, 500))
    status = FAULT if outcome.fault else COMPLETED
    return RunRow(status, outcome.fault or "", outcome.metrics, outcome.warnings)


@cache
def program_revision() -> str:
    """Return the revision of the program in this process."""
    return git_revision()


def dask_setup(worker: Any) -> None:
    """Prepare a process on this machine for runs; called by Dask."""
    processes.dask_setup(worker)
    silence_libraries()
    import experiments.simulated_run  # noqa: F401  # before the first run rather than in it
