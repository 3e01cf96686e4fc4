"""Runs on real processes of this machine: they end well or badly, and all say how."""

import signal

import psutil
import pytest

from experiments.scenario_file import read_scenario
from experiments.sweep import many
from experiments.sweep.many import run_many
from experiments.sweep.summary import MACHINE_METRICS
from experiments.sweep.worker import COMPLETED, DIED, REFUSED, RunTask, run_task

pytestmark = pytest.mark.slow

DURATION = 0.05  # s


def task(*overrides, duration=DURATION):
    return RunTask.of(read_scenario("pfc_elastic_3r", list(overrides)), duration)


def workers():
    """The processes that runs go to."""
    children = psutil.Process().children(recursive=True)
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def without_machine(row):
    """Metrics of a run, but for those of the machine."""
    return {k: v for k, v in row.to_data()["metrics"].items() if k not in MACHINE_METRICS}


def test_two_processes_one_of_which_is_killed():
    tasks = {9: task(duration=500.0), 7: task("reference.velocity=-1"), 0: task(), 1: task()}
    rows, started, listening = {}, [], []
    before = {c.laddr for c in psutil.Process().net_connections()}  # other tests' servers

    def take(number, row):
        rows[number] = row
        if len(rows) == 3:  # only the long run is left
            started.extend(workers())
            for process in [psutil.Process(), *started]:
                listening.extend(c for c in process.net_connections() if c.status == "LISTEN")
            listening[:] = [c for c in listening if c.laddr not in before]
            busiest = max(started, key=lambda process: process.cpu_percent(0.3))
            busiest.send_signal(signal.SIGKILL)

    assert run_many(tasks, take, interrupted=lambda: False, workers=2) is None
    assert list(rows) == [7, 0, 1, 9]
    ends = {number: row.status for number, row in rows.items()}
    assert ends == {0: COMPLETED, 1: COMPLETED, 7: REFUSED, 9: DIED}
    assert "velocity = -1" in rows[7].reason
    assert "its process ended in the middle of it" in rows[9].reason
    # a process of its own makes of a run what this one does
    here = run_task(tasks[0])
    for row in (rows[0], rows[1]):
        assert without_machine(row) == without_machine(here)
        assert row.end == here.end == DURATION
        assert row.revision == here.revision != ""
    # nothing can be reached from elsewhere, and nothing is left behind
    assert listening
    assert {connection.laddr.ip for connection in listening} == {"127.0.0.1"}
    assert len(started) == 2
    assert workers() == []


def test_a_process_that_has_grown_is_replaced(monkeypatch):
    """What runs leave behind in memory does not add up over thousands of them."""
    monkeypatch.setattr(many, "_MOST_MEMORY", 0.0)
    rows, processes = {}, []

    def take(number, row):
        rows[number] = row
        processes.append({process.pid for process in workers()})

    tasks = {0: task(), 1: task()}
    assert run_many(tasks, take, interrupted=lambda: False, workers=1) is None
    assert [row.status for row in rows.values()] == [COMPLETED, COMPLETED]
    assert rows[0].memory > 1e8
    assert processes[0].isdisjoint(processes[1])


def test_nothing_to_do_starts_nothing():
    assert run_many({}, lambda number, row: None, interrupted=lambda: False) is None
