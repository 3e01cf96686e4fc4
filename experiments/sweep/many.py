"""Many runs on processes of this machine or of a Dask scheduler."""

import contextlib
import importlib.util
import logging
import math
import queue
import threading
import time
import uuid
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from experiments.scenario_file import ScenarioFile
from experiments.sweep.worker import DIED, FAILED, RunRow, RunTask, program_revision, run_task
from pfsc_drake.errors import InputError, shorten
from reporting import processes
from reporting.interruption import watch_interruption
from reporting.processes import local_cluster
from reporting.terminal import one_line

if TYPE_CHECKING:
    from distributed import Client, Future

Key = TypeVar("Key", bound=Hashable)

_LOOK = 0.2  # s, interval of checks for Ctrl-C
_ASK = 1.0  # s, interval of checks for new workers, which take time from local ones
# memory of a process at which it is replaced [bytes]: each diagram leaks some megabytes
_MOST_MEMORY = 1.5e9
_RESTART_SECONDS = 120
_CONNECT_SECONDS = 10

_SETTINGS = {
    # a run whose process died is a row; a retry could kill the next process, too
    "distributed.scheduler.allowed-failures": 0,
    # a process out of memory is killed, without pausing or spilling before
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
}


def run_many(
    tasks: Mapping[int, RunTask],
    take: Callable[[int, RunRow], None],
    *,
    interrupted: Callable[[], bool],
    scheduler: str | None = None,
    workers: int | None = None,
    idle: Callable[[int], None] = lambda workers: None,
) -> str | None:
    """Run scenarios side by side; every process has one run at a time.

    Args:
        tasks: Runs by number.
        take: Receives number and row of each run, in the order in which they end.
        interrupted: Whether to stop; runs that have not ended then are lost.
        scheduler: Address of a Dask scheduler; None for processes of this machine.
        workers: Number of processes of this machine; None for all its cores.
        idle: Receives the number of processes from time to time.

    Returns:
        Why runs are missing; None if all were performed, or after an interruption.

    Raises:
        InputError: If no scheduler answers, or Dask is not installed.
    """
    if not tasks:
        return None
    with open_cluster(scheduler, min(workers or count_cores(), len(tasks))) as client:
        return _Dispatcher(client, tasks, take, idle).run(interrupted)


def run_side_by_side(
    scenarios: Mapping[Key, ScenarioFile], take: Callable[[Key, RunRow], None]
) -> dict[Key, RunRow]:
    """Run scenarios on all cores, and return their rows in order.

    Args:
        scenarios: Scenarios by any name.
        take: Receives name and row of each run, in the order in which they end.

    Raises:
        KeyboardInterrupt: At Ctrl-C.
    """
    keys, rows = list(scenarios), dict[Key, RunRow]()

    def keep(number: int, row: RunRow) -> None:
        rows[keys[number]] = row
        take(keys[number], row)

    tasks = {number: RunTask.of(scenarios[key]) for number, key in enumerate(keys)}
    with watch_interruption() as interrupted:
        run_many(tasks, keep, interrupted=interrupted)
        if interrupted():
            raise KeyboardInterrupt
    return {key: rows[key] for key in keys}


def count_cores() -> int:
    """Return the number of cores that this process may use.

    Raises:
        InputError: If Dask or pyarrow is not installed.
    """
    cores = processes.count_cores()
    if importlib.util.find_spec("pyarrow") is None:
        raise InputError("pyarrow is not installed; allowed: make setup, or the extra 'sweep'")
    return cores


@contextmanager
def open_cluster(address: str | None, workers: int) -> Iterator["Client"]:
    """Connect to processes for runs, until the end of the context.

    Args:
        address: Address of a Dask scheduler, e.g. ``tcp://10.0.0.1:8786``; None for processes of
            this machine, which listen on its loopback address alone. Scheduler and workers must
            find the program: ``python -m dask scheduler`` and ``python -m dask worker ADDRESS
            --nthreads 1`` in a clone of the same revision.
        workers: Number of processes; of this machine only.

    Raises:
        InputError: If Dask is not installed, no scheduler answers, or it lacks the program.
    """
    count_cores()
    if address is None:
        with local_cluster(workers, "experiments.sweep.worker", _SETTINGS) as client:
            yield client
        return
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with _connect(address) as client:
        _check_program(client, address)
        yield client


def _connect(address: str) -> "Client":
    from distributed import Client
    from distributed.comm import parse_address, parse_host_port

    try:
        parse_host_port(parse_address(address)[1])  # a Client that fails at this leaves a mess
        return Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError, RuntimeError, ImportError) as error:
        reason = shorten(" ".join(str(error).split()) or type(error).__name__, 200)
        raise InputError(
            f"--scheduler {shorten(address)}: no Dask scheduler answers: {reason}; "
            "allowed: an address such as tcp://127.0.0.1:8786"
        ) from None


def _check_program(client: "Client", address: str) -> None:
    """Reject a scheduler or workers that cannot run the program; later workers are not checked."""
    if not client.nthreads():
        return
    try:
        client.submit(program_revision, pure=False).result()
    except Exception as error:  # whatever they raise, they cannot
        reason = shorten(" ".join(str(error).split()) or type(error).__name__, 200)
        raise InputError(
            f"--scheduler {shorten(address)}: it lacks this program: {reason}; allowed: in a "
            "clone of this revision python -m dask scheduler, python -m dask worker ADDRESS"
        ) from None


@dataclass(frozen=True)
class _Run:
    """Submitted run.

    Attributes:
        future: Future of its row.
        address: Address of its intended process.
        begin: Time of submission [s].
    """

    future: "Future"
    address: str
    begin: float


class _Dispatcher:
    """Submission of runs, one per process.

    A run in the queue of a process would be lost together with the run before it.
    """

    def __init__(
        self,
        client: "Client",
        tasks: Mapping[int, RunTask],
        take: Callable[[int, RunRow], None],
        idle: Callable[[int], None],
    ) -> None:
        self._client, self._tasks, self._take, self._idle = client, tasks, take, idle
        self._waiting = list(reversed(list(tasks)))
        self._running: dict[int, _Run] = {}
        self._ended: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._restarting: set[str] = set()  # addresses
        self._processes: list[str] = []
        self._asked = -math.inf  # when they were asked for [s]
        self._batch = uuid.uuid4().hex

    def run(self, interrupted: Callable[[], bool]) -> str | None:
        try:
            while (self._waiting or self._running) and not interrupted():
                problem = self._hand_out()
                if problem is not None:
                    return problem
                with contextlib.suppress(queue.Empty):
                    self._finish(self._ended.get(timeout=_LOOK))
        finally:
            with contextlib.suppress(Exception):  # of a scheduler that is gone
                self._client.cancel([run.future for run in self._running.values()], force=True)
        return None

    def _hand_out(self) -> str | None:
        """Submit runs to idle processes; return why that is impossible, or None."""
        if time.monotonic() - self._asked >= _ASK:
            try:
                self._processes = list(self._client.nthreads())
            except (OSError, ValueError, RuntimeError) as error:
                return f"the scheduler is gone: {one_line(str(error)) or type(error).__name__}"
            self._asked = time.monotonic()
            self._idle(len(self._processes))
        busy = {run.address for run in self._running.values()} | self._restarting
        for address in (address for address in self._processes if address not in busy):
            if not self._waiting or len(self._running) >= len(self._processes):
                break
            number = self._waiting.pop()
            future = self._client.submit(
                run_task,
                self._tasks[number],
                key=f"run-{number}-{self._batch}",
                pure=False,
                workers=[address],
                allow_other_workers=True,  # should it be gone by then
            )
            self._running[number] = _Run(future, address, time.perf_counter())
            future.add_done_callback(lambda _, number=number: self._ended.put(number))
        return None

    def _finish(self, number: int) -> None:
        from distributed import KilledWorker

        run = self._running.pop(number)
        try:
            row = run.future.result()
            if row.memory > _MOST_MEMORY:
                self._restarting.add(run.address)
                threading.Thread(target=self._restart, args=[run.address], daemon=True).start()
        except KilledWorker:
            self._processes = [address for address in self._processes if address != run.address]
            seconds = time.perf_counter() - run.begin
            reason = "its process ended in the middle of it: killed, crashed, or out of memory"
            row = RunRow(DIED, reason, seconds=seconds)
        except Exception as error:  # e.g. a worker without this program; the other runs go on
            reason = one_line(f"{type(error).__name__}: {error}")
            row = RunRow(FAILED, shorten(reason, 500))
        self._take(number, row)

    def _restart(self, address: str) -> None:
        """Replace an idle process while the others continue."""
        # a process without nanny cannot be replaced and continues
        with contextlib.suppress(Exception):
            self._client.restart_workers([address], timeout=_RESTART_SECONDS)
        self._restarting.discard(address)
