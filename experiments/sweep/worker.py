"""One run of many: the task that is sent to a process, and the row that is kept of it."""

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
from pfsc_drake.errors import InputError, shortened
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
    """What is kept of one run.

    Attributes:
        status: One of STATUSES.
        reason: Why it did not complete; empty if it did.
        metrics: Its metrics; none if it never started.
        warnings: What may not have gone as well as hoped, one sentence each.
        end: Simulated time at the end [s].
        seconds: Wall clock time [s].
        host: Machine that ran it.
        revision: Revision of the program there.
        memory: Memory of its process after the run [bytes]; not kept in files.
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
        """Whether the same run would end in the same way; not if the machine is to blame."""
        return self.status not in (FAILED, DIED)

    def value(self, metric: str) -> float:
        """Returns the value of a metric; NaN if the run did not complete."""
        return self.metrics[metric].value if self.status == COMPLETED else math.nan

    def to_data(self) -> dict[str, Any]:
        """Returns the row as data for JSON; NaN is null."""
        kept = {field.name: getattr(self, field.name) for field in fields(self)}
        del kept["memory"]
        kept["metrics"] = self.metrics.to_data()
        return kept | {name: None for name in _TIMES if not math.isfinite(kept[name])}

    @classmethod
    def from_data(cls, data: dict[str, Any]) -> "RunRow":
        """Returns the row of what :meth:`to_data` gave.

        Raises:
            KeyError, TypeError, ValueError, AttributeError: If it is something else.
        """
        if data["status"] not in STATUSES:
            raise ValueError(data["status"])
        kept: dict[str, Any] = {name: str(data[name]) for name in _TEXTS}
        kept |= {name: math.nan if data[name] is None else float(data[name]) for name in _TIMES}
        kept["metrics"] = Metrics.from_data(data["metrics"])
        kept["warnings"] = [str(warning) for warning in data["warnings"]]
        return cls(**kept)


@dataclass(frozen=True)
class RunTask:
    """One run, as it is sent to a worker.

    Attributes:
        file: Name of the scenario's file.
        folder: Its folder, which names in it are relative to; None for a shipped scenario, which
            every machine has in a folder of its own.
        data: Its content with everything set.
        duration: Simulated time [s] instead of the scenario's; or None.
    """

    file: str
    folder: Path | None
    data: dict[str, Any]
    duration: float | None

    @classmethod
    def of(cls, scenario: ScenarioFile, duration: float | None = None) -> "RunTask":
        """Returns the task to run a scenario."""
        folder = scenario.path.parent.resolve()
        is_shipped = folder == SCENARIO_DIRECTORY
        return cls(scenario.path.name, None if is_shipped else folder, scenario.data, duration)

    def scenario(self) -> ScenarioFile:
        """Returns the scenario as this machine has it."""
        return ScenarioFile((self.folder or SCENARIO_DIRECTORY) / self.file, self.data)


class _Clock:
    """Remembers how far a run is."""

    def __init__(self) -> None:
        self.simulated_time = 0.0

    def expect(self, duration: float) -> None:
        """Ignores the length."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Takes the time [s]."""
        self.simulated_time = max(self.simulated_time, simulated_time)


def run_task(task: RunTask) -> RunRow:
    """Runs a scenario as ``run`` does, without figures and recording; keeps its row alone.

    Whatever is wrong with the run is said in its row.
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
        return RunRow(FAILED, shortened(reason, 500))
    status = FAULT if outcome.fault else COMPLETED
    return RunRow(status, outcome.fault or "", outcome.metrics, outcome.warnings)


@cache
def program_revision() -> str:
    """Returns the revision of the program in this process."""
    return git_revision()


def dask_setup(worker: Any) -> None:
    """Prepares a process on this machine before it takes runs; called by Dask."""
    processes.dask_setup(worker)
    silence_libraries()
    import experiments.simulated_run  # noqa: F401  # before the first run rather than in it
