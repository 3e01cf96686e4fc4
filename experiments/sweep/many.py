"""Many runs on many processes: those of this machine, or those behind an address."""

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
from pfsc_drake.errors import InputError, shortened
from reporting import processes
from reporting.interruption import noticed_interruption
from reporting.processes import local_cluster
from reporting.terminal import one_line

if TYPE_CHECKING:
    from distributed import Client, Future

Key = TypeVar("Key", bound=Hashable)

_LOOK = 0.2  # s, how often Ctrl-C is noticed
_ASK = 1.0  # s, how often new workers are; asking takes time from those of this machine
# of a process [bytes], from which on it is replaced: every diagram leaves some megabytes behind
_MOST_MEMORY = 1.5e9
_RESTART_SECONDS = 120
_CONNECT_SECONDS = 10

_SETTINGS = {
    # a run whose process died is a row; trying it again would take the next process too
    "distributed.scheduler.allowed-failures": 0,
    # what takes all memory dies, nothing is paused or put on disk before
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
    """Runs scenarios side by side; every process has one run at a time.

    Args:
        tasks: The runs by any number.
        take: Told number and row of each run, in the order in which they end.
        interrupted: Whether to stop; runs that have not ended then are lost.
        scheduler: Address of a Dask scheduler; None for processes of this machine.
        workers: Number of processes of this machine; None for all its cores.
        idle: Told now and then how many processes there are.

    Returns:
        Why not all runs were made; None if all were, or on interruption.

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


def count_cores() -> int:
    """Return the number of cores that this process may use.

    Raises:
        InputError: If Dask or what keeps its tables is not installed.
    """
    cores = processes.count_cores()
    if importlib.util.find_spec("pyarrow") is None:
        raise InputError("pyarrow is not installed; allowed: make setup, or the extra 'sweep'")
    return cores


@contextmanager
def open_cluster(address: str | None, workers: int) -> Iterator["Client"]:
    """Connects to processes that take runs, until the end of the context.

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
        reason = shortened(" ".join(str(error).split()) or type(error).__name__, 200)
        raise InputError(
            f"--scheduler {shortened(address)}: no Dask scheduler answers: {reason}; "
            "allowed: an address such as tcp://127.0.0.1:8786"
        ) from None


def _check_program(client: "Client", address: str) -> None:
    """Refuses a scheduler or workers that cannot run the program; who comes later, is not asked."""
    if not client.nthreads():
        return
    try:
        client.submit(program_revision, pure=False).result()
    except Exception as error:  # whatever they raise, they cannot
        reason = shortened(" ".join(str(error).split()) or type(error).__name__, 200)
        raise InputError(
            f"--scheduler {shortened(address)}: it has not this program: {reason}; allowed: in a "
            "clone of this revision python -m dask scheduler, python -m dask worker ADDRESS"
        ) from None


@dataclass(frozen=True)
class _Run:
    """A run that was handed out.

    Attributes:
        future: Future of its row.
        address: Address of the process that it was meant for.
        begin: When [s].
    """

    future: "Future"
    address: str
    begin: float


class _Dispatcher:
    """Hands out runs, as many as there are processes.

    One that waited in the queue of a process would die with the run before it.
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
        """Hands out runs to processes that have none; returns why that is impossible."""
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
            row = RunRow(FAILED, shortened(reason, 500))
        self._take(number, row)

    def _restart(self, address: str) -> None:
        """Replaces a process that has nothing to do, while the others go on."""
        # one without nanny cannot be replaced; it goes on as it is
        with contextlib.suppress(Exception):
            self._client.restart_workers([address], timeout=_RESTART_SECONDS)
        self._restarting.discard(address)
