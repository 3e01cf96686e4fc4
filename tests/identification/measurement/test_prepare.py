"""A file of a simulated robot with one fault at a time: each is named in one sentence."""

import re
from dataclasses import replace

import numpy as np
import pytest

from identification.excitation.fourier import FourierTrajectory
from identification.measurement.columns import Reading
from identification.measurement.experiment import prepare_motion, run_experiment
from identification.measurement.files import read_record, write_record
from identification.measurement.imperfections import shipped_imperfections
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError

PERIOD = 1.25


@pytest.fixture(scope="module")
def comau():
    return load_subject("comau_racer_1_4")


@pytest.fixture(scope="module")
def regressor(comau):
    return Regressor(comau)


@pytest.fixture(scope="module")
def lines(comau, tmp_path_factory):
    """The file's lines: period, names, samples."""
    rng = np.random.default_rng(0)
    a, b = rng.uniform(0.1, 0.25, (2, 6, 2))
    trajectory = FourierTrajectory([0.0, 1.0, 0.1, 0.0, 0.0, 0.0], a, b, PERIOD, (1, 3))
    noise = shipped_imperfections("comau_racer_1_4")
    record = run_experiment(comau, trajectory, noise, periods=3).record
    record = replace(record, v=np.gradient(record.q, 1e-3, axis=0))
    path = tmp_path_factory.mktemp("records") / "run.csv"
    write_record(path, record, comau)
    return path.read_text().splitlines()


class Table:
    """A file that is being spoilt."""

    def __init__(self, lines):
        self.period, self.names = lines[0], lines[1].split(", ")
        self.rows = np.array([line.split(", ") for line in lines[2:]], dtype=float)

    def column(self, start):
        return [i for i, name in enumerate(self.names) if name.startswith(start)]

    def scale(self, start, factor):
        self.rows[:, self.column(start)] *= factor

    def rename(self, old, new):
        self.names = [name.replace(old, new) for name in self.names]

    def drop(self, start):
        keep = [i for i in range(len(self.names)) if i not in self.column(start)]
        self.names, self.rows = [self.names[i] for i in keep], self.rows[:, keep]

    def shift(self, start, samples):
        columns = self.column(start)
        self.rows[:, columns] = np.roll(self.rows[:, columns], samples, axis=0)

    def write(self, path):
        head = [self.period] if self.period else []
        body = [", ".join(f"{value:.9g}" for value in row) for row in self.rows]
        path.write_text("\n".join([*head, ", ".join(self.names), *body]) + "\n")


def clip(table):
    column = table.column("tau_2")
    limit = 0.9 * np.abs(table.rows[:, column]).max()
    table.rows[:, column] = np.clip(table.rows[:, column], -limit, limit)


def cut(table, rows):
    table.rows = np.delete(table.rows, rows, axis=0)


def put(table, start, row, value):
    table.rows[row, table.column(start)] = value


# what is done to the file, and what is said about it
FAULTS = {
    "gap": (lambda f: cut(f, slice(3000, 3040)), r"gap of 0\.041 s in t after 2\.999 s"),
    "rows twice": (
        lambda f: put(f, "t [", 500, f.rows[499, 0]),
        "t does not increase from sample 500",
    ),
    "no number": (lambda f: put(f, "tau_3", 700, np.nan), "nan"),
    "degrees": (lambda f: f.scale("q_", 180.0 / np.pi), r"divided by 57\.3 .* look like \[deg\]"),
    "counts": (
        lambda f: f.rename("q_4 [rad]", "q_4 [counts]"),
        r"q_4: unit \[counts\]; allowed: rad, .*with a scale",
    ),
    "no unit": (lambda f: f.rename("tau_1 [Nm]", "tau_1"), "tau_1: no unit is stated"),
    "unit of a force": (lambda f: f.rename("tau_1 [Nm]", "tau_1 [N]"), r"unit \[N\]; allowed: Nm"),
    "milliseconds": (
        lambda f: f.scale("t [", 1e3),
        "v of joint_1 is 1000 times the derivative of q; .*unit",
    ),
    "torques in mNm": (lambda f: f.scale("tau_", 1e3), "times its limit; .*another unit"),
    "a joint too few": (lambda f: f.drop("tau_5"), r"no tau_5 \(joint_5\); tau of all 6 joints"),
    "a joint too many": (
        lambda f: f.rename("q_6", "q_7"),
        "of joint '7'; .* has the joints 1 to 6",
    ),
    "a column twice": (lambda f: f.rename("v_2", "v_1"), "v_1"),
    "no time": (lambda f: f.drop("t ["), r"no time; 't \[s\]' is required"),
    "clipped": (clip, "tau of joint_2 is clipped at"),
    "dead channel": (lambda f: f.scale("tau_6", 0.0), "tau of joint_6 is 0 Nm throughout"),
    "late torques": (lambda f: f.shift("tau_", 4), r"tau lags the motion by [34]\.?\d* ms"),
    "early torques": (lambda f: f.shift("tau_", -4), r"tau leads the motion by [34]\.?\d* ms"),
    "late velocities": (lambda f: f.shift("v_", 6), r"v of joint_1 lags .* by [56]\.?\d* ms"),
    "turned velocity": (lambda f: f.scale("v_3", -1.0), "v of joint_3 is -.* times the derivative"),
    "velocity in deg/s": (lambda f: f.scale("v_", 180.0 / np.pi), "v is .* rad/s in joint"),
    "no period": (lambda f: setattr(f, "period", ""), "period of the motion is not known"),
    "another period": (
        lambda f: setattr(f, "period", "# period [s] = 1.2"),
        "differs from period to period",
    ),
    "cut short": (lambda f: cut(f, slice(2000, None)), "are 1 whole periods of 1.25 s"),
    "another zero": (
        lambda f: put(f, "q_2", slice(None), f.rows[:, f.column("q_2")] + 2.5),
        "sign, zero, unit or order of the joints",
    ),
    "stands still": (lambda f: f.scale("q_", 0.0), "q of all joints is constant"),
}


def motion_of(file, regressor, reading=None):
    return prepare_motion(read_record(file, regressor.subject, None, reading), regressor)


def test_the_file_without_fault(lines, regressor, tmp_path):
    table = Table(lines)
    table.write(tmp_path / "run.csv")
    motion = motion_of(tmp_path / "run.csv", regressor)
    assert motion.periods == 2 and motion.period == PERIOD
    # what the file states otherwise, it may
    table.scale("q_", 180.0 / np.pi)
    table.scale("tau_3", 2.0)
    table.rename("q_", "angle_")
    for old, new in (("[rad]", "[deg]"), ("tau_3 [Nm]", "tau_3 [A]")):
        table.rename(old, new)
    table.write(tmp_path / "other.csv")
    names = {f"angle_{j}": f"q_{j}" for j in range(1, 7)}
    names |= {f"{s}_{j}": f"{s}_{j}" for s in ("tau", "v") for j in range(1, 7)} | {"t": "t"}
    reading = Reading(names=names, scale={"tau_3": 0.5})
    again = motion_of(tmp_path / "other.csv", regressor, reading)
    np.testing.assert_allclose(again.q, motion.q, atol=1e-7)
    np.testing.assert_allclose(again.tau, motion.tau, rtol=1e-6, atol=1e-6)


@pytest.mark.slow(
    but=[
        "late torques",
        "late velocities",
        "another period",
        "no period",
        "turned velocity",
        "a column twice",
        "velocity in deg/s",
    ]
)
@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named(lines, regressor, tmp_path, fault):
    spoil, message = FAULTS[fault]
    table = Table(lines)
    spoil(table)
    table.write(tmp_path / "run.csv")
    with pytest.raises(InputError, match=message) as caught:
        motion_of(tmp_path / "run.csv", regressor)
    text = str(caught.value)
    assert "\n" not in text
    assert re.search(r"run\.csv|tau l", text)
