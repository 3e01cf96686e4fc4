"""The last moments before a plate is mounted, through the command line."""

import json

import h5py
import numpy as np
import pytest

from experiments.cli import main
from pfsc_drake.control.compliance.impedance_parameters import SlowEnds

# held above the bores, which are half as far beside the path, and looked at but shortly
SHORTENED = (
    "plate.start=held",
    "plate.frame.shift=[4.5e-4, -3.0e-4, 0]",
    "plate.frame.turn=[3.5e-3, -2.5e-3, 4.9e-3]",
    "plate.operator={seed: 1, look_time: 0.7, insert: 15}",
    "reference.points=[1.0615, 1.0615]",
    "hand.waypoints=[{time: 0.2, position: [1.0615, 0, 0]}, {time: 0.3, position: [1.063, 0, 0]}]",
    "start={posture_deg: [24, 81, -15, 0, -76, -1]}",
)
DURATION, WEIGHT = 3.6, 0.83 * 9.81  # s, N


@pytest.fixture(name="out", scope="module")
def fixture_out(tmp_path_factory):
    out = tmp_path_factory.mktemp("mounting")
    arguments = ["--no-figures", "--duration", str(DURATION)]
    for change in SHORTENED:
        arguments += ["--set", change]
    assert main(["run", "plate_mounting", "--out", str(out), *arguments]) == 0
    return out


@pytest.fixture(name="log", scope="module")
def fixture_log(out):
    with h5py.File(out / "log.h5") as file:
        return {name: dataset[:] for name, dataset in file.items()}


@pytest.mark.slow
def test_the_plate_is_seated_and_let_go(out):
    text = (out / "metrics.json").read_text(encoding="utf-8")
    metrics = {name: metric["value"] for name, metric in json.loads(text).items()}
    assert metrics["mounted"] == 1.0
    assert metrics["final_seat_gap"] < 2e-5
    assert metrics["peak_operator_force"] < 45.0
    assert metrics["peak_frame_force"] < 45.0
    assert metrics["time_to_contact"] < metrics["time_to_seat"] < metrics["release_time"]


@pytest.mark.slow
def test_the_tool_yields_to_where_the_frame_is(log):
    """Half of 1.1 mm and 13 mrad, less the play of the bores and what the cups give way."""
    last = np.flatnonzero(log["held"][:, 0] == 1.0)[-1]
    assert 0.2e-3 < np.linalg.norm(log["xi"][last]) < 0.8e-3
    assert 2e-3 < np.linalg.norm(log["phi"][last]) < 11e-3


@pytest.mark.slow
def test_the_sensor_feels_contact_and_operator_but_not_the_plate(log):
    """Newton for the plate: what the cups bear is what hand and frame do not, at rest."""
    still = (log["t"] > 0.15) & (log["t"] < 0.2)  # tared, nobody pushes yet
    assert np.abs(log["wrench_measured"][still].mean(axis=0)[:3]).max() < 0.1
    assert log["gripper_wrench"][still][:, 2].mean() == pytest.approx(-WEIGHT, abs=0.1)
    mounted = log["t"] > DURATION - 0.1
    assert log["frame_force"][mounted][:, 2].mean() == pytest.approx(WEIGHT, abs=0.1)


@pytest.mark.slow
def test_the_damping_is_that_of_5_4(log):
    started = log["t"] > 0.1
    with_length = SlowEnds(length=1.0810319).interpolant()
    expected = np.array([with_length(eta) for eta in log["eta"][started, 0]])
    # that of the last tick, by what encoders say
    np.testing.assert_allclose(log["damping"][started, 0], expected, rtol=0.02)


@pytest.mark.slow
def test_the_operator_does_one_thing_after_the_other(log):
    phase = log["phase"][:, 0]
    assert np.all(np.diff(phase) >= 0)
    assert set(phase) >= {1, 2, 3, 4}  # lead, align, insert, release
