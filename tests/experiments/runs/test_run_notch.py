"""The ball in its displaced notch, through the command line, shortened."""

import h5py
import numpy as np
import pytest

from diagrams.scenario.workpiece import BallParameters
from experiments.cli import main

# N/m, of Tab. 3.2; m, of the scenario
STIFFNESS, DISPLACEMENT = 500.0, np.array([-0.0025, 0.0055, 0.0])
CLEARANCE = 0.002
BARE = ("--no-figures", "--no-recording")
NOISE, TARING = 0.1, 20  # N; samples, whose mean noise stays in the reading for good
END = 0.9  # s, 0.4 s of which it moves


def run(tmp_path, scenario, duration=END, *changes):
    out = tmp_path / "out"
    arguments = ["run", scenario, "--out", str(out), "--duration", str(duration), *BARE]
    for change in ("encoders={}", "model_error={}", *changes):
        arguments += ["--set", change]
    assert main(arguments) == 0
    with h5py.File(out / "log.h5") as file:
        return {name: dataset[:] for name, dataset in file.items()}


@pytest.fixture(name="log", scope="module")
def fixture_log(tmp_path_factory):
    return run(tmp_path_factory.mktemp("notch"), "pfc_delta_notch")


def force(log):
    return np.linalg.norm(log["wrench_ext"][:, :3], axis=1)


@pytest.mark.slow
def test_nothing_moves_before_the_sensor_is_tared(log):
    waiting = log["tared"][:, 0] < 0.5
    assert 20 <= waiting.sum() < 40  # samples of 1 ms, of which taring takes 20
    assert force(log)[waiting].max() == 0.0
    # the drives' friction gives by micrometres
    assert np.abs(log["y_t"][waiting] - log["y_t"][0]).max() < 2e-5
    assert np.array_equal(log["xi_p"][waiting], np.tile(log["xi_p"][0], (waiting.sum(), 1)))


@pytest.mark.slow
def test_tool_follows_the_yielding_reference(log):
    assert log["eta"][-1] > 0.08
    assert np.linalg.norm(log["xi"] - log["xi_p"], axis=1).max() < 1e-3


@pytest.mark.slow
def test_sensor_measures_the_contact(log):
    """The reaction force in the plant's joint, compensated, against Drake's contact results."""
    resting = (log["t"] > 0.3) & (log["t"] < 0.5)
    assert force(log)[resting].min() > 1.0
    measured, real = (log[name][resting, :3] for name in ("wrench_measured", "wrench_ext"))
    assert np.abs(measured.mean(axis=0) - real.mean(axis=0)).max() < 3 * NOISE / np.sqrt(TARING)
    late = log["t"] > 0.05
    error = (log["wrench_measured"] - log["wrench_ext"])[late, :3]
    assert np.sqrt(np.mean(error**2)) < 0.3


@pytest.mark.slow
def test_forces_are_those_of_a_spring_to_the_taught_path(log):
    """At rest (3.42) is k (xi_p - xi_d) = tau_perp, and the notch leaves 2 mm of its 6 mm."""
    resting = (log["t"] > 0.4) & (log["t"] < 0.5)
    xi_p, tau = log["xi_p"][resting].mean(axis=0), log["manifold_force"][resting, 1:3].mean(axis=0)
    np.testing.assert_allclose(tau, STIFFNESS * xi_p, atol=0.05)
    yielded = np.linalg.norm(xi_p)
    assert 0.5 * CLEARANCE < yielded < np.linalg.norm(DISPLACEMENT)
    assert force(log).max() < 5.0


@pytest.mark.slow
def test_ball_stays_in_the_notch(log):
    """Beyond the clearance the soft shell gives by less than a millimetre."""
    distance = np.linalg.norm(log["notch_position"], axis=1)
    assert distance[0] < 1e-5  # bristles of the drives' friction bend as the ball is let go
    assert distance.max() < CLEARANCE + 1e-3


@pytest.mark.slow
def test_the_notch_drags_at_the_ball_that_slides_in_it(log):
    """Coulomb's friction of both surfaces, against the motion."""
    velocity = np.gradient(log["y_t"], log["t"], axis=0)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    sliding = (speed[:, 0] > 0.05) & (force(log) > 1.0)
    assert sliding.sum() > 50
    direction = (velocity / np.maximum(speed, 1e-9))[sliding]
    pressed = log["wrench_ext"][sliding, :3]
    along = np.sum(direction * pressed, axis=1)
    across = np.linalg.norm(pressed - along[:, None] * direction, axis=1)
    friction = BallParameters().friction
    assert friction > 0.0
    assert np.median(-along / across) == pytest.approx(friction, rel=0.2)


@pytest.mark.slow
def test_a_push_is_measured_with_the_contact(tmp_path):
    push = "forces=[{begin: 0.1, end: 1.0, ramp: 0.05, force: [0, 0, 4]}]"
    pushed = run(tmp_path, "pfc_delta_notch", 0.4, push)
    late = pushed["t"] > 0.3
    real, measured = (pushed[name][late, :3] for name in ("wrench_ext", "wrench_measured"))
    assert np.abs(measured.mean(axis=0) - real.mean(axis=0)).max() < 3 * NOISE / np.sqrt(TARING)
    # downwards into the notch, which bears it but for what bends the spring
    assert 0.0 < real.mean(axis=0)[2] < 4.0


@pytest.mark.slow
def test_position_control_presses_with_ten_times_the_force(tmp_path, log):
    stiff = run(tmp_path, "pfc_delta_notch_stiff", 0.4)
    assert "wrench_measured" not in stiff
    assert force(stiff)[-1] > 10.0 * force(log).max()
    # it gets its way against the soft shell
    assert np.linalg.norm(stiff["xi"][-1]) < 0.3e-3
    assert np.linalg.norm(stiff["notch_position"][-1]) > 2.0 * CLEARANCE
