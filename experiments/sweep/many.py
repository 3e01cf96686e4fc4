"""Many runs on many processes."""

import contextlib
import math
import queue
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from experiments.sweep.cluster import count_cores, open_cluster
from experiments.sweep.rows import DIED, FAILED, RunRow
from experiments.sweep.worker import RunTask, run_task
from pfsc_drake.errors import shortened
from reporting.terminal import one_line

if TYPE_CHECKING:
    from distributed import Client, Future

_LOOK = 0.2  # s, how often Ctrl-C is noticed
_ASK = 1.0  # s, how often new workers are; asking takes time from those of this machine
# of a process [bytes], from which on it is replaced: every diagram leaves some megabytes behind
_MOST_MEMORY = 1.5e9
_RESTART_SECONDS = 120


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
    processes = min(workers or count_cores(), len(tasks))
    with open_cluster(scheduler, processes) as client:
        return _Dispatcher(client, tasks, take, idle).run(interrupted)


@dataclass(frozen=True)
class _Run:
    """A run that was handed out.

    Attributes:
        future: Of its row.
        address: Of the process that it was meant for.
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
