"""Many runs on many processes."""

import contextlib
import queue
import time
import uuid
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from experiments.sweep.cluster import count_cores, open_cluster
from experiments.sweep.rows import DIED, FAILED, RunRow
from experiments.sweep.worker import RunTask, run_task
from experiments.terminal import one_line
from pfsc_drake.errors import shortened

if TYPE_CHECKING:
    from distributed import Client, Future

_LOOK = 0.2  # s, how often Ctrl-C and new workers are noticed


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
        self._running: dict[int, tuple[Future, float]] = {}  # and when it was handed out [s]
        self._ended: queue.SimpleQueue[int] = queue.SimpleQueue()
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
                self._client.cancel([future for future, _ in self._running.values()], force=True)
        return None

    def _hand_out(self) -> str | None:
        """Hands out runs to processes that have none; returns why that is impossible."""
        try:
            processes = len(self._client.nthreads())
        except (OSError, ValueError, RuntimeError) as error:
            return f"the scheduler is gone: {one_line(str(error)) or type(error).__name__}"
        self._idle(processes)
        while self._waiting and len(self._running) < processes:
            number = self._waiting.pop()
            key = f"run-{number}-{self._batch}"
            future = self._client.submit(run_task, self._tasks[number], key=key, pure=False)
            self._running[number] = future, time.perf_counter()
            future.add_done_callback(lambda _, number=number: self._ended.put(number))
        return None

    def _finish(self, number: int) -> None:
        from distributed import KilledWorker

        future, begin = self._running.pop(number)
        try:
            row = future.result()
        except KilledWorker:
            seconds = time.perf_counter() - begin
            reason = "its process ended in the middle of it: killed, crashed, or out of memory"
            row = RunRow(DIED, reason, seconds=seconds)
        except Exception as error:  # e.g. a worker without this program; the other runs go on
            reason = one_line(f"{type(error).__name__}: {error}")
            row = RunRow(FAILED, shortened(reason, 500))
        self._take(number, row)
