"""Runs of shipped scenarios that several tests look at, shortened, and wrong ones.

Logs are read with h5py, as a script of a user would. Runs are made once per session.
"""

import contextlib
import io
import json
import shutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest

from experiments import integration, simulation
from experiments.cli import main
from experiments.results.run_log import RunLog
from experiments.scenario_file import find_scenario
from reporting import style as figure_style

BARE = ("--no-figures", "--no-recording")
FIRST_MOVE = "1.7"  # s, of pfc_elastic_3r


@dataclass
class Run:
    """What a run left."""

    status: int
    folder: Path
    stdout: str

    def __post_init__(self) -> None:
        with h5py.File(self.folder / "log.h5") as file:
            self.log = {name: dataset[:] for name, dataset in file.items()}
            self.marks = {name: dict(dataset.attrs) for name, dataset in file.items()}
            self.attributes = dict(file.attrs)
        text = (self.folder / "metrics.json").read_text(encoding="utf-8")
        self.metrics = json.loads(text)

    def __getitem__(self, signal: str) -> np.ndarray:
        return self.log[signal]

    @property
    def t(self) -> np.ndarray:
        """Times of the samples [s]."""
        return self.log["t"]

    def after(self, t: float) -> np.ndarray:
        """Which samples are later."""
        return self.t >= t


@contextlib.contextmanager
def few_pixels():
    """Draw figures where it only matters that something is drawn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figure_style, "DPI", 30)
        patch.setitem(figure_style.STYLE, "figure.constrained_layout.use", False)
        yield


@pytest.fixture
def coarse():
    """Draw all figures of a test with few pixels."""
    with few_pixels():
        yield


def run(out, scenario, *arguments, complete=False):
    stdout = io.StringIO()
    with contextlib.redirect_stdout(stdout), few_pixels():
        arguments = [*arguments, *(() if complete else BARE)]
        status = main(["run", str(scenario), "--out", str(out), *arguments])
    return Run(status, out, stdout.getvalue())


@pytest.fixture(scope="session", autouse=True)
def few_ticks_measured():
    """Measure the tick a few times: that would take as long as to simulate, and no test looks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "_SAMPLES", 10)
        yield


@pytest.fixture(scope="session", autouse=True)
def short_trials():
    """Try integrations for as long as it takes to tell them apart, roughly."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(integration, "_STEPS", 20)
        patch.setattr(integration, "_TICKS", 4)
        yield


@pytest.fixture(scope="session")
def run_scenario():
    """Return a function that runs a scenario; ``complete`` with figures and recording."""
    return run


@pytest.fixture(scope="session")
def three_axes(tmp_path_factory):
    """Return the shipped three-axis scenario, run once per set of overrides."""

    @cache
    def get(*overrides, duration=FIRST_MOVE):
        changes = [argument for change in overrides for argument in ("--set", change)]
        out = tmp_path_factory.mktemp("three") / "out"
        return run(out, "pfc_elastic_3r", "--duration", duration, *changes)

    return get


@pytest.fixture(scope="session")
def six_axes(tmp_path_factory):
    """The shipped six-axis scenario with everything that a run can write.

    It starts beside the path, without transition, and without integral part.
    """
    out = tmp_path_factory.mktemp("six") / "out"
    gains = [f"controller.gains.elastic.{kind}.integral_pole=0" for kind in ("eta", "xi", "phi")]
    changes = [x for change in ("start.transition=0", *gains) for x in ("--set", change)]
    return run(out, "pfc_elastic_6r", "--duration", "0.15", *changes, complete=True)


@pytest.fixture
def mine(tmp_path):
    """Return the path of a shipped scenario, copied into a folder of the user's own."""

    def copy(name="pfc_elastic_3r"):
        return str(shutil.copy(find_scenario(name), tmp_path / f"my_{name}.yaml"))

    return copy


@pytest.fixture
def refused(tmp_path, capfd):
    """Run a scenario that is wrong and check the line on stderr."""

    def check(scenario, *parts, changes=(), file=None):
        out = tmp_path / "out"
        overrides = [argument for change in changes for argument in ("--set", change)]
        capfd.readouterr()
        arguments = ["run", str(scenario), "--out", str(out), "--duration", "0.02", *BARE]
        status = main([*arguments, *overrides])
        stderr = capfd.readouterr().err
        assert status == 2, stderr
        assert stderr.startswith("error: ")
        assert stderr.endswith("\n")
        assert stderr.count("\n") == 1
        assert str(file or scenario) in stderr
        for part in parts:
            assert part in stderr
        assert not (out / "log.h5").exists()

    return check


@pytest.fixture
def drawn_log():
    """A made-up log of 1 s, six axes with elastic joints, with everything that is ever drawn."""
    time = np.linspace(0.0, 1.0, 201)
    decay, pushed = np.exp(-9.0 * time), (time > 0.4) & (time < 0.6)
    log = RunLog(time)
    log.add("y_t", np.stack([0.3 * time, 0.01 * decay, 0.0 * time + 0.5], axis=1), "m")
    log.add("eta", 0.3 * time, "m")
    log.add("eta_p", 0.3 * time + 1e-3, "m")
    log.add("eta_dot", np.full(201, 0.3), "m/s")
    log.add("xi", np.stack([0.01 * decay, 0.0 * time], axis=1), "m")
    log.add("xi_p", np.zeros((201, 2)), "m")
    log.add("phi", np.outer(decay, [1e-3, 2e-3, 3e-3]), "rad")
    names = ["v_eta", "v_xi_1", "v_xi_2", "v_phi_1", "v_phi_2", "v_phi_3"]
    log.add("virtual_input", np.outer(decay, np.arange(1.0, 7.0)), "SI/s^4", names)
    log.add("angles_e", np.outer(time, [0.1, 0.2, 0.3]), "rad", ["z", "y", "x"])
    log.add("angles_d", np.outer(time, [0.1, 0.2, 0.2]), "rad", ["z", "y", "x"])
    for name, unit in (("q_J", "rad"), ("q_M", "rad"), ("v_J", "rad/s"), ("v_M", "rad/s")):
        log.add(name, np.outer(time, np.arange(6.0)), unit)
    log.add("tau_d", np.outer(np.sin(9.0 * time), np.arange(1.0, 7.0)), "Nm", limits=5.0)
    log.add("tau_f", np.outer(np.sign(time - 0.5), np.arange(1.0, 7.0)), "Nm")
    wrench, labels = np.outer(pushed, [30.0, 0.0, 0.0, 0.0, 2.0, 0.0]), "f_x f_y f_z mu_x mu_y mu_z"
    log.add("wrench_ext", wrench, "N, Nm", labels.split())
    log.add("wrench_measured", 1.1 * wrench, "N, Nm", labels.split())
    labels = "tau_par tau_perp tau_cross tau_z tau_y tau_x"
    log.add("manifold_force", 0.9 * wrench, "N, Nm", labels.split())
    log.add("tared", time >= 0.1, "1")
    log.add("sensor_fault", time > 0.9, "1")
    return log
