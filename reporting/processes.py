"""Parallel processes on this machine."""

import logging
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from pfsc_drake.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

Common = TypeVar("Common")
Task = TypeVar("Task")
Result = TypeVar("Result")

_LOOPBACK = "127.0.0.1"
_SETTINGS = {
    # monitoring of the processes takes time from them
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    # no dashboard for other machines
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


class SideBySide(Protocol):
    """Runs tasks in parallel processes."""

    def __call__(
        self, function: Callable[[Common, Task], Result], common: Common, tasks: Iterable[Task]
    ) -> Iterator[Result]:
        """Yield results in the order of completion.

        Args:
            function: Function of a module, to be called with ``common`` and each task.
            common: Argument that is sent with each of them.
            tasks: Tasks.
        """


@contextmanager
def side_by_side(workers: int | None, most: int) -> Iterator[SideBySide]:
    """Return a runner of tasks, until the end of the context.

    Args:
        workers: Number of processes; one for each core by default; with 1, this process.
        most: Largest useful number of processes; with 1, this process.

    Raises:
        InputError: If several processes are requested and Dask is not installed, or their number is
            below 1.
    """
    if workers is not None and workers < 1:
        raise InputError(f"workers = {workers}; must be 1 or more")
    if 1 in (workers, most):
        yield lambda function, common, tasks: (function(common, task) for task in tasks)
        return
    cores = count_cores("one worker")
    with local_cluster(min(workers or cores, most), __name__) as client:
        from distributed import KilledWorker, as_completed

        def run(
            function: Callable[[Common, Task], Result], common: Common, tasks: Iterable[Task]
        ) -> Iterator[Result]:
            # sent with each task: scattered data are lost with their process, and Dask waits
            # forever for
            # a process that ends meanwhile
            futures = [client.submit(function, common, task, pure=False) for task in tasks]
            for future in as_completed(futures, loop=client.loop):
                try:
                    yield future.result()
                except KilledWorker:
                    raise InputError(
                        "a process ended in the middle of its work, again and again: killed, "
                        "crashed, or out of memory; allowed: fewer of them, or less to do"
                    ) from None

        yield run


@contextmanager
def local_cluster(
    workers: int, preload: str, settings: Mapping[str, Any] = MappingProxyType({})
) -> Iterator["Client"]:
    """Return a client of processes on this machine, which listen on its loopback address only.

    They accept work from each other only: their certificate exists as long as they do.

    Args:
        workers: Number of processes.
        preload: Module that prepares each of them, see :func:`dask_setup`.
        settings: Further settings of Dask.
    """
    import dask
    from distributed import Client, LocalCluster, Security

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with (
        TemporaryDirectory(prefix="pfsc_drake_workers_", ignore_cleanup_errors=True) as folder,
        dask.config.set({**_SETTINGS, **settings}),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host=_LOOPBACK,
            protocol="tls",
            security=Security.temporary(),
            dashboard_address=f"{_LOOPBACK}:0",
            scheduler_kwargs={"dashboard": False},
            local_directory=folder,
            preload=[preload],
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def count_cores(instead: str = "") -> int:
    """Return the number of cores that this process may use.

    Args:
        instead: Alternative to the installation of Dask, for the message.

    Raises:
        InputError: If Dask is not installed.
    """
    try:
        import cryptography  # noqa: F401  for the cluster's certificate
        import distributed  # noqa: F401
        from dask.system import CPU_COUNT
    except ImportError as error:
        ways = ["make setup", "the extra 'sweep'", *([instead] if instead else [])]
        raise InputError(
            f"{error.name} is not installed; allowed: {', '.join(ways[:-1])}, or {ways[-1]}"
        ) from None
    return int(CPU_COUNT)


def dask_setup(_worker: Any) -> None:
    """Prepare a process before it takes tasks; called by Dask."""
    # signals of a terminal reach all its processes; the first process ends the others, by SIGTERM
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
