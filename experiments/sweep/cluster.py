"""The processes that a sweep runs in: those of this machine, or those behind an address."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from experiments.sweep.worker import program_revision
from pfsc_drake.errors import InputError, shortened

if TYPE_CHECKING:
    from distributed import Client

_LOOPBACK = "127.0.0.1"
_CONNECT_SECONDS = 10

_SETTINGS = {
    # a run whose process died is a row; trying it again would take the next process too
    "distributed.scheduler.allowed-failures": 0,
    # what takes all memory dies, nothing is paused or put on disk before
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    # what watches the process takes time from the run
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    # nothing to look at from elsewhere
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


def count_cores() -> int:
    """Returns the number of cores that this process may use.

    Raises:
        InputError: If Dask is not installed.
    """
    _require_dask()
    from dask.system import CPU_COUNT

    return int(CPU_COUNT)


@contextmanager
def open_cluster(address: str | None, workers: int) -> Iterator["Client"]:
    """Connects to processes that take runs, until the end of the context.

    Args:
        address: Of a Dask scheduler, e.g. ``tcp://10.0.0.1:8786``; None for processes of this
            machine, which listen on its loopback address alone. Scheduler and workers must find
            the program: ``python -m dask scheduler`` and ``python -m dask worker ADDRESS
            --nthreads 1`` in a clone of the same revision.
        workers: Number of processes; of this machine only.

    Raises:
        InputError: If Dask is not installed, no scheduler answers, or it lacks the program.
    """
    _require_dask()
    import dask
    from distributed import Client, LocalCluster

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    if address is not None:
        with _connect(address) as client:
            _check_program(client, address)
            yield client
        return
    with (
        TemporaryDirectory(prefix="pfsc_drake_workers_", ignore_cleanup_errors=True) as folder,
        dask.config.set(_SETTINGS),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host=_LOOPBACK,
            dashboard_address=f"{_LOOPBACK}:0",
            scheduler_kwargs={"dashboard": False},
            local_directory=folder,
            preload=["experiments.sweep.worker"],
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
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


def _require_dask() -> None:
    try:
        import distributed  # noqa: F401
        import pyarrow  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"{error.name} is not installed; allowed: make setup, or the extra 'sweep'"
        ) from None
