"""A tool that is pressed on a workpiece, through the command line, until it presses."""

import json

import h5py
import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from experiments.cli import main
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.reading import read_model

FORCE, APPROACH, DAMPING = 20.0, 10.0, 500.0  # N, N, N s/m, of the scenario


@pytest.fixture(name="out", scope="module")
def fixture_out(tmp_path_factory):
    out = tmp_path_factory.mktemp("polish")
    bare = ("--no-figures", "--no-recording", "--duration", "1.5")
    assert main(["run", "sfc_polish", "--out", str(out), *bare]) == 0
    return out


@pytest.fixture(name="log", scope="module")
def fixture_log(out):
    with h5py.File(out / "log.h5") as file:
        return {name: dataset[:] for name, dataset in file.items()}


@pytest.mark.slow
def test_it_approaches_as_fast_as_force_and_damping_say(log):
    free = (log["t"] > 0.25) & (log["t"] < 0.45)
    assert not log["wrench_ext"][free].any()
    slope = np.polyfit(log["t"][free], log["xi"][free, 0], 1)[0]
    assert slope == pytest.approx(-APPROACH / DAMPING, rel=0.02)


@pytest.mark.slow
def test_it_touches_down_and_presses(log, out):
    """Contact results of Drake against the reference of the controller."""
    late = log["t"] > 1.3
    assert np.abs(log["normal_force"][late] - FORCE).max() < 0.5
    assert log["manifold_force"][late, 2].mean() == pytest.approx(FORCE, abs=0.1)  # with noise
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["touch_down_overshoot"]["value"] < 0.3
    assert metrics["contact_losses"]["value"] == 0.0
    assert metrics["max_force_error"]["value"] < 2.0


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "end"), [(0.2, 0.45), (0.51, 0.7), (0.9, 1.4)])
def test_what_is_logged_as_torque_is_what_moves_the_robot(log, begin, end):
    """Drake's inverse dynamics of the logged motion, approaching, touching down and pressing."""
    plant = MultibodyPlant(0.0)
    read_model(plant, resolve_model("comau_racer_1_4"))
    context, weight = plant.CreateDefaultContext(), MultibodyForces(plant)
    during = np.flatnonzero((log["t"] > begin) & (log["t"] < end))
    v_dot = np.gradient(log["v_J"], log["t"], axis=0)
    needed = []
    for k in during:
        plant.SetPositions(context, log["q_J"][k])
        plant.SetVelocities(context, log["v_J"][k])
        plant.CalcForceElementsContribution(context, weight)
        needed.append(plant.CalcInverseDynamics(context, v_dot[k], weight))
    acting = log["tau_d"] - log["tau_f"] + log["tau_ext"]
    difference = acting[during].mean(axis=0) - np.mean(needed, axis=0)
    # half a step of the plant lies between what is logged of friction and what acts
    np.testing.assert_allclose(difference, 0.0, atol=1.0)


@pytest.mark.slow
def test_it_stands_as_far_off_the_taught_surface_as_the_workpiece(log):
    """2 mm up, 1 deg of a place 80 mm from the middle, and the ball's depth under 20 N."""
    theta = np.array([-0.08, -0.06])
    up = 0.002 + np.deg2rad(1.0) * 0.08 / np.cos(np.arctan(2.0 * np.linalg.norm(theta)))
    depth = np.sqrt(FORCE / (np.pi * 4e6))  # of a ball in a plane, pressure over depth
    assert log["xi"][-1, 0] == pytest.approx(up - depth, abs=4e-4)


@pytest.mark.slow
def test_position_control_presses_harder_and_takes_no_notice(tmp_path):
    bare = ("--no-figures", "--no-recording", "--duration", "0.8")
    assert main(["run", "sfc_polish_stiff", "--out", str(tmp_path), *bare]) == 0
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["peak_force"]["value"] > 4.0 * FORCE
    assert "max_force_error" not in metrics
    with h5py.File(tmp_path / "log.h5") as file:
        assert abs(file["xi"][-1, 0]) < 1e-4


@pytest.mark.slow
def test_a_sensor_whose_bias_jumps_ends_the_run(tmp_path, capsys):
    """It would be pressed on the workpiece by as much more as the sensor reads less."""
    failure = "simulation.force_sensor_failure={time: 0.3, component: 2, kind: jump, size: -127}"
    bare = ("--no-figures", "--no-recording", "--duration", "0.4", "--set", failure)
    assert main(["run", "sfc_polish", "--out", str(tmp_path), *bare]) == 3
    said = capsys.readouterr().err
    assert "the force on the workpiece is far from its reference" in said
    assert "t = 0.300 s" in said
