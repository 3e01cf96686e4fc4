"""Whatever happens around a run: the user's files stay, and what was logged is kept."""

import json
import os
import shutil
import signal
from pathlib import Path

import h5py
import pytest
import yaml

from experiments.cli import main
from experiments.scenario_file import read_scenario
from experiments.simulated_run import RunOptions, run_scenario

BARE = ("--no-figures", "--no-recording")


class Happening:
    """Listens to the progress of a run and does something once, at some time in some phase."""

    def __init__(self, do, phase, time=0.0):
        self.do, self.phase, self.time = do, phase, time

    def expect(self, duration):
        self.duration = duration

    def __call__(self, simulated_time, phase):
        if self.do is not None and phase == self.phase and simulated_time >= self.time:
            do, self.do = self.do, None
            do()


def run(out, happening, figures=False):
    overrides = ["controller.law=rigid"]
    return run_scenario(
        read_scenario("pfc_elastic_3r", overrides),
        out=out,
        options=RunOptions(0.3, figures=figures, recording=False),
        progress=happening,
    )


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


def samples(log: Path) -> int:
    with h5py.File(log) as file:
        return len(file["t"])


def test_an_interrupted_simulation_is_kept(tmp_path):
    out = tmp_path / "out"
    outcome = run(out, Happening(interrupt, "simulating", 0.1), figures=True)
    assert (outcome.interrupted, outcome.fault, outcome.problem) == (True, None, None)
    count = samples(out / "log.h5")
    assert 101 <= count <= 151
    with h5py.File(out / "log.h5") as file:
        assert file.attrs["interrupted"] == f"at t = {file['t'][-1]:.3f} s"
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["peak_torque_1"]["value"] > 0.0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "interrupted" in page
    assert "✓ completed" not in page
    assert not (out / "figures").exists()  # who presses Ctrl-C wants no pictures


def test_interrupted_after_the_simulation_the_log_is_complete(tmp_path):
    outcome = run(tmp_path / "out", Happening(interrupt, "measuring the tick"), figures=True)
    assert outcome.interrupted
    assert samples(tmp_path / "out" / "log.h5") == 301
    assert not (tmp_path / "out" / "figures").exists()


def test_interrupted_before_the_simulation_nothing_is_left(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "out", Happening(lambda: signal.raise_signal(signal.SIGINT), "preparing"))
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_a_run_that_fails_leaves_the_earlier_results_whole(tmp_path):
    """Until there is a log of its own."""
    out = tmp_path / "out"
    run(out, Happening(None, ""))
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def fail():
        found = {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}
        assert found == before
        raise MemoryError

    for phase in ("simulating", "measuring the tick"):
        with pytest.raises(MemoryError):
            run(out, Happening(fail, phase))
        if phase == "simulating":
            assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    # of the second there was a log
    names = {path.name for path in out.iterdir()}
    assert names == {"manifest.json", "scenario.yaml", "log.h5"} < before.keys()


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_a_folder_removed_during_the_run_loses_nothing(tmp_path, monkeypatch):
    out, temporary = tmp_path / "out", tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    outcome = run(out, Happening(lambda: shutil.rmtree(out), "simulating", 0.1), figures=True)
    assert not out.exists()
    (kept,) = temporary.iterdir()
    assert outcome.problem == (
        "cannot write log.h5, metrics.json, figures, report.html, scenario.yaml into "
        f"{out}: No such file or directory; saved in {kept}"
    )
    assert (kept / "scenario.yaml").is_file()
    assert samples(kept / "log.h5") == 301
    assert outcome.report == kept / "report.html"
    assert {path.name for path in (kept / "figures").iterdir()} >= {"path.png", "progress.png"}


@pytest.mark.slow
def test_results_beside_the_scenario(mine, tmp_path, capfd):
    """``--out .`` with everything of the user's in the same folder."""
    scenario = Path(mine())
    (tmp_path / "notes.txt").write_text("mine")
    own = {path: path.read_bytes() for path in tmp_path.iterdir()}
    arguments = ["--out", str(tmp_path), "--duration", "0.01", *BARE]
    for _ in range(2):
        assert main(["run", str(scenario), *arguments]) == 0
        assert {path: path.read_bytes() for path in own} == own

    taken = tmp_path / "scenario.yaml"
    assert main(["run", str(taken), *arguments]) == 2
    assert "its scenario.yaml is an input of this run" in capfd.readouterr().err
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "photo.png").write_text("mine")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert main(["run", str(scenario), *arguments]) == 2
    assert "it holds figures/photo.png, which no run has written" in capfd.readouterr().err
    assert before == {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}


def test_every_input_of_a_scenario_is_protected(tmp_path, capfd):
    """Also a table of points that bears the name of a result."""
    out = tmp_path / "out"
    out.mkdir()
    points = "\n".join(f"{0.5 + 0.01 * i},{0.001 * i * i},0.5" for i in range(20))
    (out / "metrics.json").write_text(f"x,y,z\n{points}\n")
    (out / "manifest.json").write_text(
        json.dumps({"program": "pfsc_drake", "results": "run", "files": ["metrics.json"]})
    )
    change = f"path.shape=!Waypoints {{file: {out / 'metrics.json'}}}"
    assert main(["run", "pfc_elastic_3r", "--set", change, "--out", str(out)]) == 2
    assert "its metrics.json is an input of this run" in capfd.readouterr().err
    assert (out / "metrics.json").read_text().startswith("x,y,z")


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (f"duration=1{'0' * 400}", ("'duration'", "1329 bits", "magnitude up to 1.8e+308")),
        (f"start.offset=[1{'0' * 400}, 0]", ("'start.offset[0]'", "1329 bits")),
        ("controller.sampling_time='1_0'", ("'controller.sampling_time'", "'1_0'", "a number")),
        ("targets.rigid.max_path_deviatoin={bound: '< 1'}", ("targets.rigid.max_path_deviatoin",)),
        (
            "targets.velocity_servo.max_orientation_error={bound: '< 1'}",
            ("targets.velocity_servo.max_orientation_error: no such metric", "allowed: settling"),
        ),
        (f"robot.model={'n' * 300}.urdf", ("nnn", "no such file")),
        (f"path.shape=!Waypoints {{file: {'n' * 300}.csv}}", ("File name too long",)),
    ],
)
def test_refused(refused, mine, change, parts):
    refused(mine(), *parts, changes=[change])


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--duration", "1e300"], ("--duration 1e300", "at most 1,000,000 s")),
        (["--set", "duration=1000.002"], ("duration = 1000 s", "3.33 minutes", "GB of memory")),
        (["--set", "reference.velocity=1e-6"], ("duration = ", "days", "up to 1000 s")),
    ],
)
def test_runs_that_would_hardly_end(tmp_path, capfd, arguments, parts):
    out = tmp_path / "out"
    assert main(["run", "pfc_elastic_3r", *arguments, "--out", str(out)]) == 2
    stderr = capfd.readouterr().err
    assert stderr.startswith("error: ")
    assert stderr.count("\n") == 1
    for part in parts:
        assert part in stderr
    assert not out.exists()


def test_targets_of_laws_that_are_not_run(run_scenario, mine, tmp_path):
    """The rigid law, not the elastic one, has a metric of the motors."""
    change = "targets.rigid.max_path_deviation_of_motors={bound: '< 1'}"
    arguments = ["--duration", "0.02", "--set", change]
    assert run_scenario(tmp_path / "out", mine(), *arguments).status == 0


@pytest.mark.slow
def test_no_hand_by_null(run_scenario, tmp_path):
    """``hand: null`` means the same as no key: the shipped hand can be taken off."""
    arguments = ["--duration", "0.02", "--set", "hand=null"]
    result = run_scenario(tmp_path / "out", "operator_hand_6r", *arguments)
    assert result.status == 0
    resolved = yaml.safe_load(
        (result.folder / "scenario.yaml").read_text(encoding="utf-8").replace("!", "")
    )
    assert resolved.get("hand") is None
    assert "wrench_ext" not in result.log or not result["wrench_ext"].any()
