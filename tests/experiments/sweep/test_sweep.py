"""Sweeps into a folder, on a scheduler of this machine: stopped, gone on with, refused."""

import csv
import io
import json
import logging
import os
import shlex
import signal
import sys

import pytest
from distributed import LocalCluster
from pyarrow import parquet
from rich.console import Console

from experiments.cli import main
from experiments.sweep import many
from experiments.sweep.definition import RECORD
from experiments.sweep.summary import MACHINE_METRICS
from experiments.sweep.sweep import define_sweep, run_sweep
from reporting.folder import check_folder

VARY = ("reference.velocity=0.5:1.5", "controller.law=elastic,rigid")
METRIC = "static_path_deviation"


@pytest.fixture(scope="module")
def address():
    """Address of a scheduler with one process."""
    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        preload=["experiments.sweep.worker"],
        silence_logs=logging.CRITICAL,
    ) as cluster:
        yield cluster.scheduler_address


class Impatient(io.StringIO):
    """A terminal whose user presses Ctrl-C as soon as a text stands there."""

    def __init__(self, text):
        super().__init__()
        self._text = text

    def write(self, text):
        if self._text in text:
            os.kill(os.getpid(), signal.SIGINT)
        return super().write(text)


def defined(seed=0):
    return define_sweep("pfc_elastic_3r", VARY, duration=0.05, samples=2, seed=seed)


def rows_of(out):
    with (out / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_stopped_gone_on_with_and_done(address, tmp_path, capfd):
    out = tmp_path / "out"
    console = Console(file=Impatient("2 of 4 runs"), width=200)
    outcome = run_sweep(defined(), out, console, scheduler=address)
    assert outcome.interrupted
    assert (len(outcome.rows), outcome.total) == (2, 4)
    assert "interrupted" in outcome.report.read_text(encoding="utf-8")
    before = json.loads((out / RECORD).read_text())["rows"]
    assert len(rows_of(out)) == len(before) == 2

    options = [word for option in VARY for word in ("--vary", option)]
    command = ["sweep", "pfc_elastic_3r", *options, "--samples", "2", "--duration", "0.05"]
    command += ["--out", str(out), "--scheduler", address]
    assert main([*command, "--seed", "1"]) == 2
    assert "it holds another sweep (--seed 0)" in capfd.readouterr().err
    assert main(command) == 0
    shown = capfd.readouterr()
    assert "pfc_elastic_3r: 2 of 4 runs, starting" in shown.out
    assert "pfc_elastic_3r: 4 of 4 runs" in shown.out
    assert shown.err == ""

    # what was there was not run again
    after = json.loads((out / RECORD).read_text())["rows"]
    assert {number: after[number] for number in before} == before
    table = rows_of(out)
    assert [row["status"] for row in table] == ["completed"] * 4
    assert parquet.read_table(out / "sweep.parquet").num_rows == 4
    velocities = [sample.varied["reference.velocity"] for sample in defined().samples]
    assert [float(row["reference.velocity"]) for row in table] == velocities
    for name in ("histogram", "parameters"):
        assert (out / "figures" / f"{name}.png").stat().st_size > 10_000
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "varied: controller.law=elastic,rigid" in page
    assert "interrupted" not in page
    check_folder(out, "sweep")  # every file is as it was written

    # the command that is told repeats the worst run
    (line,) = [line for line in shown.out.splitlines() if "experiments run" in line]
    again = [*shlex.split(line)[3:], "--out", str(tmp_path / "again"), "--no-figures"]
    assert main([*again, "--no-recording"]) == 0
    worst = max(table, key=lambda row: float(row[METRIC]))
    metrics = json.loads((tmp_path / "again" / "metrics.json").read_text())
    for name in metrics:
        if name not in MACHINE_METRICS and metrics[name]["value"] is not None:
            assert metrics[name]["value"] == float(worst[name])


def test_every_run_refused(address, tmp_path, capfd):
    arguments = ["--vary", "robot.tool_frame=here,there", "--duration", "0.05"]
    arguments += ["--out", str(tmp_path / "out"), "--scheduler", address]
    assert main(["sweep", "pfc_elastic_3r", *arguments]) == 2
    error = capfd.readouterr().err
    assert error.startswith("error: no run could start: ")
    assert "has no frame 'here'" in error
    assert error.count("\n") == 1
    assert [row["status"] for row in rows_of(tmp_path / "out")] == ["refused"] * 2


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([], "--vary: missing"),
        (["--vary", "reference.velocit=1,2"], "unknown key 'reference.velocit' = 1"),
        (["--vary", "reference.velocity=a,b"], "key 'reference.velocity' is 'a'"),
        (["--vary", "description.no=1,2"], "--vary description.no=1: description is "),
        (["--vary", "duration=0:1"], "--samples: missing"),
        (
            ["--vary", "duration=1,2", "--scheduler", "tcp://a:1", "--workers", "2"],
            "--workers 2: --scheduler brings its own",
        ),
        (["--vary", "duration=1,2", "--scheduler", "here"], "no Dask scheduler answers"),
        pytest.param(
            ["--vary", "duration=1,2", "--scheduler", "tcp://127.0.0.1:1"],
            "--scheduler tcp://127.0.0.1:1: no Dask scheduler answers",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(arguments, reason, tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(many, "_CONNECT_SECONDS", 0.5)
    status = main(["sweep", "pfc_elastic_3r", *arguments, "--out", str(tmp_path / "out")])
    error = capfd.readouterr().err
    assert status == 2
    assert reason in error
    assert error.count("\n") == 1


def test_without_the_extra(tmp_path, capfd, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    arguments = ["--vary", "duration=1,2", "--out", str(tmp_path / "out")]
    assert main(["sweep", "pfc_elastic_3r", *arguments]) == 2
    error = capfd.readouterr().err
    assert error.startswith("error: distributed is not installed; allowed: make setup")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_value_that_is_wrong_in_some_samples_is_the_business_of_their_rows():
    sweep = define_sweep("pfc_elastic_3r", ["reference.velocity=-1,1"])
    assert len(sweep.tasks) == 2


@pytest.mark.slow
def test_surfaces_that_differ(address, tmp_path):
    out = tmp_path / "out"
    vary = ("surface.shape.coefficient=1.4,1.667",)
    sweep = define_sweep("sfc_viscoelastic_3r", vary, duration=0.05, samples=None, seed=0)
    run_sweep(sweep, out, Console(file=io.StringIO()), scheduler=address)
    flat, deep = rows_of(out)
    assert flat["status"] == deep["status"] == "completed"
    # of z = c (x^2 + y^2) over a square
    assert 0.0 < float(flat["surface_area"]) < float(deep["surface_area"])
