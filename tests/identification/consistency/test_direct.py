"""Motions with known parameters and noise."""

from dataclasses import replace

import numpy as np
import pytest

from identification.consistency.bounds import PhysicalBounds, bounds_from_geometry, load_bounds
from identification.consistency.check import inconsistencies
from identification.consistency.direct import estimate_consistent
from identification.consistency.nearest import nearest_consistent
from identification.excitation.fourier import FourierTrajectory
from identification.measurement.periods import AveragedMotion
from identification.model.base import base_parameters
from identification.model.parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError

PERIODS = 4


def measured(regressor, sigma, seed=0, samples=400):
    """Return the average over four periods of a random motion."""
    subject, random = regressor.subject, np.random.default_rng(seed)
    n, harmonics = subject.dimension, (1, 2, 3, 5)
    reach = np.where(np.array(subject.joint_units) == "rad", 1.0, 0.1)
    middle = subject.position_limits.mean(axis=1)
    a, b = reach[:, None] * random.normal(size=(2, n, len(harmonics)))
    trajectory = FourierTrajectory(middle, a, b, 10.0, harmonics)
    t = np.arange(samples) * 10.0 / samples
    q, v, acceleration = trajectory.motion(t)
    tau = regressor.matrix(q, v, acceleration) @ true_parameters(subject)
    tau_periods = tau + sigma * random.normal(size=(PERIODS, samples, n))
    return AveragedMotion(
        t=t,
        q=q,
        v=v,
        a=acceleration,
        tau=tau_periods.mean(axis=0),
        torque_variance=np.asarray(sigma) ** 2 * np.ones(n),
        position_variance=np.full(n, 1e-12),
        tau_periods=tau_periods,
        period=10.0,
        bandwidth_hz=2.0,
        joint_names=tuple(subject.joint_names),
    )


@pytest.fixture(scope="module")
def comau_motion(comau_regressor):
    return measured(comau_regressor, [12.6, 11.6, 6.22, 0.71, 0.5, 0.28])


def test_is_the_nearest_to_the_free_estimate(
    comau_regressor, comau_base, comau_motion, comau_bounds
):
    one = estimate_consistent(comau_regressor, comau_base, comau_motion, comau_bounds)
    two = nearest_consistent(comau_base, one.free_values, one.covariance, comau_bounds)
    np.testing.assert_allclose(one.base_values, two.base_values, rtol=1e-5, atol=1e-6)
    assert one.chi_squared == pytest.approx(two.chi_squared, rel=1e-5)


def test_finds_the_robot_from_noisy_torques(
    comau_regressor, comau_base, comau_motion, comau_bounds, comau
):
    for link in comau_bounds.links:
        link.least_extent *= 0.5
    found = estimate_consistent(comau_regressor, comau_base, comau_motion, comau_bounds)
    assert inconsistencies(comau, found.parameters) == []
    error = found.base_values - comau_base.values(true_parameters(comau))
    free = found.free_values - comau_base.values(true_parameters(comau))
    distance, free_distance = (x @ np.linalg.solve(found.covariance, x) for x in (error, free))
    assert 20.0 < free_distance < 95.0  # chi squared with 52 degrees of freedom
    assert distance < free_distance  # a consistent set is the better estimate of one
    squares = np.sum(found.residuals**2 / comau_motion.mean_torque_variance)
    assert found.weighted_squares == pytest.approx(squares, rel=1e-9)
    assert squares / found.residuals.size == pytest.approx(1.0, abs=0.1)


def test_panda_from_what_geometry_tells():
    subject = load_subject("franka_emika_panda")
    regressor = Regressor(subject)
    motion = measured(regressor, 0.1)
    bounds = bounds_from_geometry(subject, (14.0, 18.0), margin=0.1)
    found = estimate_consistent(regressor, base_parameters(regressor), motion, bounds)
    assert inconsistencies(subject, found.parameters) == []
    masses = found.parameters[: 10 * 7 : 10]
    assert 14.0 <= masses.sum() <= 18.0
    assert found.chi_squared < 40.0


def test_delta_robot(delta):
    regressor = Regressor(delta)
    motion, base = measured(regressor, 2.0), base_parameters(regressor)
    found = estimate_consistent(regressor, base, motion, load_bounds("festo_expt_45"))
    slides = found.parameters[:3]
    np.testing.assert_allclose(slides, slides[0], rtol=1e-6)
    error = found.parameters - true_parameters(delta)
    assert np.all(np.abs(error) < 4.0 * np.sqrt(np.diag(found.covariance)))


def test_bad_input(comau_regressor, comau_base, comau_motion, comau_bounds, panda):
    def refused(message, motion, regressor=comau_regressor, bounds=comau_bounds, **options):
        with pytest.raises(InputError, match=message):
            estimate_consistent(regressor, comau_base, motion, bounds, **options)

    still = replace(
        comau_motion,
        q=comau_motion.q * [1, 1, 1, 1, 1, 0],
        v=comau_motion.v * [1, 1, 1, 1, 1, 0],
        a=comau_motion.a * [1, 1, 1, 1, 1, 0],
    )
    refused("motion: does not excite", still)
    lost = np.where(np.arange(6) == 2, np.nan, comau_motion.tau)
    refused("tau: shape .400, 6.; must be finite", replace(comau_motion, tau=lost))
    refused("variance = .1.0, 0.0.; must be 6 positive", comau_motion, variance=[1.0, 0.0])
    refused("base parameters: of 78 parameters; must be .*91", comau_motion, Regressor(panda))
    with pytest.raises(InputError, match="links = 0: must be one entry per link"):
        PhysicalBounds("comau_racer_1_4", links=[])
