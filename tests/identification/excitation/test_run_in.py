"""From rest, some periods, to rest."""

import numpy as np
import pytest

from identification.excitation.fourier import FourierTrajectory, shipped_excitation
from identification.excitation.limits import chosen_limits
from identification.excitation.run_in import rest_to_rest
from identification.model.dynamic_parameters import true_parameters
from pfsc_drake.errors import InputError


@pytest.fixture(scope="module", params=["excitation", "excitation_optimal"])
def run(comau, request):
    limits = chosen_limits(comau)
    motion = FourierTrajectory.load(shipped_excitation(name=request.param))
    return rest_to_rest(motion, limits.velocity, limits.acceleration, periods=2)


def test_begins_and_ends_at_rest(run):
    _, v, a = run.motion(np.array([0.0, run.duration]))
    assert np.abs(v).max() == 0.0
    assert np.abs(a).max() < 1e-12


def test_keeps_limits_all_along(run, comau):
    limits = chosen_limits(comau)
    q, v, a = run.motion(np.linspace(0.0, run.duration, 30_000))
    assert np.all(np.abs(v) <= limits.velocity * (1.0 + 1e-6))
    assert np.all(np.abs(a) <= limits.acceleration * (1.0 + 1e-6))
    assert np.all((q >= limits.position[:, 0]) & (q <= limits.position[:, 1]))


def test_torques_of_the_ramps_are_within_the_limits(run, comau, regressor):
    motion = run.motion(np.linspace(0.0, run.ramp, 500))
    tau = regressor.matrix(*motion) @ true_parameters(comau)
    assert np.all(np.abs(tau) <= comau.effort_limit)


def test_velocities_and_accelerations_are_derivatives(run):
    t, h = np.linspace(0.01, run.duration - 0.01, 101), 1e-5
    before, after, (_, v, a) = run.motion(t - h), run.motion(t + h), run.motion(t)
    np.testing.assert_allclose((after[0] - before[0]) / (2.0 * h), v, atol=1e-7)
    np.testing.assert_allclose((after[1] - before[1]) / (2.0 * h), a, atol=1e-6)


def test_periods_are_those_of_the_excitation(run):
    t = np.linspace(0.0, 20.0, 101)
    q, v, _ = run.motion(run.ramp + t)
    np.testing.assert_allclose(q, run.trajectory.motion(t)[0], atol=1e-9)
    np.testing.assert_allclose(v, run.trajectory.motion(t)[1], atol=1e-9)


def test_file_for_a_controller(run, tmp_path):
    file = tmp_path / "motion.csv"
    run.export_csv(file, 100.0)
    lines = file.read_text().splitlines()
    assert lines[2].startswith("t,q_1,q_2")
    table = np.array([[float(x) for x in line.split(",")] for line in lines[3:]])
    assert table.shape == (round(run.duration * 100.0) + 1, 19)
    np.testing.assert_allclose(table[:, 1:7], run.motion(table[:, 0])[0], atol=1e-7)
    assert np.abs(table[[0, -1], 7:]).max() < 1e-9


def test_refuses(printed):
    with pytest.raises(InputError, match="periods = 0"):
        rest_to_rest(printed, np.ones(6), np.ones(6), periods=0)
    with pytest.raises(InputError, match="no ramp of up to 100 s"):
        rest_to_rest(printed, np.ones(6), np.ones(6))
