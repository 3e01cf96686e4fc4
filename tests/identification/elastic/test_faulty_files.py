"""Files of an elastic robot with one fault at a time: each is named in one sentence."""

import numpy as np
import pytest

from identification.elastic.estimate import estimate_joints
from identification.elastic.experiment import simulate_excited
from identification.excitation.fourier import FourierTrajectory
from identification.measurement.columns import Reading
from identification.measurement.files import read_record, write_record
from identification.measurement.imperfections import Imperfections
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError


@pytest.fixture(scope="module")
def arm():
    return load_subject("comau_racer_1_4_elastic", tool=True)


@pytest.fixture(scope="module")
def file(arm, tmp_path_factory):
    """Names and samples of a record."""
    a, b = np.random.default_rng(0).uniform(0.2, 0.5, (2, 6, 2))
    excitation = FourierTrajectory([0.0, 1.0, 0.1, 0.0, 0.0, 0.0], a, b, 2.0, (1, 2))
    increments = 65_536 * np.array([90.0, 90.0, 60.0, 50.0, 50.0, 35.0])
    faults = Imperfections([12.6, 11.6, 6.22, 0.71, 0.5, 0.28], increments, position_noise=2e-6)
    record = simulate_excited(arm, excitation, faults, periods=1)
    path = tmp_path_factory.mktemp("records") / "run.csv"
    write_record(path, record, arm)
    lines = path.read_text().splitlines()
    return lines[1].split(", "), np.array([line.split(", ") for line in lines[2:]], dtype=float)


class Spoilt:
    """A copy of the file that is being spoilt."""

    def __init__(self, names, rows):
        self.names, self.rows = list(names), rows.copy()

    def at(self, start):
        return [i for i, name in enumerate(self.names) if name.startswith(start)]

    def scale(self, start, factor):
        self.rows[:, self.at(start)] *= factor

    def shift(self, start, samples):
        self.rows[:, self.at(start)] = np.roll(self.rows[:, self.at(start)], samples, axis=0)

    def copy(self, target, origin):
        self.rows[:, self.at(target)] = self.rows[:, self.at(origin)]

    def drop(self, start):
        gone = self.at(start)
        self.names = [name for i, name in enumerate(self.names) if i not in gone]
        self.rows = np.delete(self.rows, gone, axis=1)

    def rename(self, old, new):
        self.names = [name.replace(old, new) for name in self.names]

    def write(self, path):
        body = [", ".join(f"{value:.12g}" for value in row) for row in self.rows]
        path.write_text("\n".join([", ".join(self.names), *body]) + "\n")


FAULTS = {
    "no motors": (lambda f: f.drop("q_motor"), "no q_motor; positions of motors beside"),
    "a motor too few": (lambda f: f.drop("q_motor_3"), r"no q_motor_3 \(motor_3\)"),
    "motor degrees": (lambda f: f.scale("q_motor", 180.0 / np.pi), r"look like \[deg\]"),
    "motor counts": (
        lambda f: f.rename("q_motor_2 [rad]", "q_motor_2 [counts]"),
        r"q_motor_2: unit \[counts\]; allowed: rad",
    ),
    "before the gear": (lambda f: f.scale("q_motor_6", 35.0), "q_motor of motor_6 reaches"),
    "a motor that turns the other way": (
        lambda f: f.scale("q_motor_4", -1.0),
        "q_motor of motor_4 moves by -.* times q; must be 1",
    ),
    "a wrong gear ratio": (
        lambda f: f.scale("q_motor_5", 1.1),
        "motor_5: not excited .* or by another gear ratio",
    ),
    "motors of two joints in turn": (
        lambda f: f.copy("q_motor_5", "q_motor_4"),
        "motor_5: not excited .* q_motor is of another joint",
    ),
    "links later than motors": (
        lambda f: f.shift("q_1", 3),
        "motor_1: viscous = -.*signals at other instants",
    ),
    "a link encoder that copies the motor's": (
        lambda f: f.copy("q_2", "q_motor_2"),
        "motor_2: not excited as an elastic joint: torsion",
    ),
    "torque of the other sign": (
        lambda f: f.scale("tau_3", -1.0),
        "motor_3: (stiffness|inertia) = -",
    ),
    "a gap": (
        lambda f: setattr(f, "rows", np.delete(f.rows, slice(900, 930), axis=0)),
        r"gap of 0\.031 s",
    ),
}


def test_the_file_without_fault(arm, file, tmp_path):
    whole = Spoilt(*file)
    whole.write(tmp_path / "run.csv")
    found = estimate_joints(read_record(tmp_path / "run.csv", arm), arm)
    whole.scale("q_motor_2", 90.0 * 65_536 / (2.0 * np.pi))
    whole.rename("q_motor_2 [rad]", "q_motor_2 [counts]")
    whole.write(tmp_path / "counts.csv")
    reading = Reading(scale={"q_motor_2": 2.0 * np.pi / (90.0 * 65_536)})
    again = estimate_joints(read_record(tmp_path / "counts.csv", arm, reading=reading), arm)
    assert again[1].stiffness == pytest.approx(found[1].stiffness, rel=1e-3)
    assert found[1].stiffness == pytest.approx(arm.chain.K_s[1], rel=0.02)


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named(arm, file, tmp_path, fault):
    spoil, message = FAULTS[fault]
    spoilt = Spoilt(*file)
    spoil(spoilt)
    spoilt.write(tmp_path / "run.csv")
    with pytest.raises(InputError, match=message) as caught:
        estimate_joints(read_record(tmp_path / "run.csv", arm), arm)
    assert str(caught.value).startswith(str(tmp_path / "run.csv"))
    assert "\n" not in str(caught.value)
