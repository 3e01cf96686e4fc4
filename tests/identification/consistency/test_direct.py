"""Motions with known parameters and noise."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from identification.consistency.bounds import bounds_from_geometry, load_bounds
from identification.consistency.nearest import estimate_consistent, nearest_consistent
from identification.consistency.parameter_files import inconsistencies
from identification.estimation.friction_terms import FrictionTerm, FrictionTerms
from identification.estimation.least_squares import estimate
from identification.excitation.fourier import FourierTrajectory
from identification.model.base import base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError

PERIOD, SAMPLES = 10.0, 400
NOISE = np.array([12.6, 11.6, 6.22, 0.71, 0.5, 0.28])  # Nm, Tab. C.4


def measured(regressor, sigma, seed=0):
    """Return a random periodic motion with torques that have white noise."""
    subject, random = regressor.subject, np.random.default_rng(seed)
    n, harmonics = subject.dimension, (1, 2, 3, 5)
    reach = np.where(np.array(subject.joint_units) == "rad", 1.0, 0.1)
    a, b = reach[:, None] * random.normal(size=(2, n, len(harmonics)))
    middle = subject.position_limits.mean(axis=1)
    trajectory = FourierTrajectory(middle, a, b, PERIOD, harmonics)
    q, v, acceleration = trajectory.motion(np.arange(SAMPLES) * PERIOD / SAMPLES)
    tau = regressor.matrix(q, v, acceleration) @ true_parameters(subject)
    variance = np.asarray(sigma) ** 2 * np.ones(n)
    return SimpleNamespace(
        q=q,
        v=v,
        a=acceleration,
        tau=tau + sigma * random.normal(size=q.shape),
        torque_variance=variance,
        mean_torque_variance=variance,
    )


@pytest.fixture(scope="module")
def comau_estimate(comau_regressor, comau_base):
    motion = measured(comau_regressor, 0.5 * NOISE)
    return estimate(comau_regressor, comau_base, motion, white=True)


def test_is_the_nearest_to_the_free_estimate(comau_estimate, comau_base, comau_bounds):
    free = comau_estimate
    one = estimate_consistent(free, comau_bounds)
    two = nearest_consistent(comau_base, free.base_parameters, free.covariance, comau_bounds)
    np.testing.assert_allclose(one.base_values, two.base_values, rtol=1e-5, atol=1e-6)
    assert one.chi_squared == pytest.approx(two.chi_squared, rel=1e-5)
    system = free.system
    residuals = system.torques - system.matrix @ one.base_values
    squares = [np.sum((values * system.weights) ** 2) for values in (residuals, free.residuals)]
    assert squares[0] - squares[1] == pytest.approx(one.chi_squared, rel=1e-6)


def test_is_the_better_estimate_of_a_consistent_robot(
    comau_regressor, comau_base, comau_bounds, comau
):
    """Chi squared of 52 degrees of freedom; the constraints of a robot reduce it."""
    for link in comau_bounds.links:
        link.least_extent *= 0.5
    motion = measured(comau_regressor, 10.0 * NOISE)
    free = estimate(comau_regressor, comau_base, motion, white=True)
    found = estimate_consistent(free, comau_bounds, prior_weight=1e-6)
    assert inconsistencies(comau, found.parameters) == []
    truth = comau_base.values(true_parameters(comau))
    errors = found.base_values - truth, free.base_parameters - truth
    distance, free_distance = (e @ np.linalg.solve(free.covariance, e) for e in errors)
    assert 20.0 < free_distance < 95.0
    assert distance < 0.95 * free_distance


def test_the_nearest_on_a_line(comau_estimate, comau_bounds, comau):
    """Along a line from the set to another consistent one the cost only grows."""
    found = estimate_consistent(comau_estimate, comau_bounds, prior_weight=1e-6)
    for link in comau_bounds.links:
        link.least_extent *= 2.0
    other = estimate_consistent(comau_estimate, comau_bounds, prior_weight=1e-6)
    system = comau_estimate.system

    def cost(share):
        rho = (1.0 - share) * found.parameters + share * other.parameters
        residuals = system.torques - system.matrix @ comau_estimate.base.values(rho)
        return np.sum((residuals * system.weights) ** 2)

    assert cost(1.0) > cost(0.0)
    best = minimize_scalar(cost, bounds=(-0.5, 1.0), method="bounded").x
    assert best < 1e-3


def test_panda_from_what_geometry_tells(panda):
    regressor = Regressor(panda)
    free = estimate(regressor, base_parameters(regressor), measured(regressor, 0.1), white=True)
    for bounds in (
        bounds_from_geometry(panda, (14.0, 18.0), margin=0.1),
        load_bounds("franka_emika_panda"),
    ):
        found = estimate_consistent(free, bounds)
        assert inconsistencies(panda, found.parameters) == []
        assert 14.0 <= found.parameters[:70:10].sum() <= 18.0 + 1e-6
        assert found.chi_squared < 40.0


def test_delta_robot(delta):
    regressor = Regressor(delta)
    free = estimate(regressor, base_parameters(regressor), measured(regressor, 2.0), white=True)
    found = estimate_consistent(free, load_bounds("festo_expt_45"))
    np.testing.assert_allclose(found.parameters[:3], found.parameters[0], rtol=1e-6)
    error = found.parameters - true_parameters(delta)
    assert np.all(np.abs(error) < 4.0 * free.standard_deviation)


def test_friction_beyond_coulomb_is_free(comau_regressor, comau_base, comau_estimate, comau_bounds):
    model = FrictionTerms((FrictionTerm(1, "offset"),))
    free = estimate(comau_regressor, comau_base, comau_estimate.motion, model, white=True)
    found = estimate_consistent(free, comau_bounds)
    assert found.names[-1].startswith("joint_2.") and found.parameters.shape == (79,)
    assert found.deviations[-1] == pytest.approx(0.0, abs=1.0)


def test_bounds_of_another_robot(comau_estimate):
    with pytest.raises(InputError, match="bounds of franka_emika_panda: 7 links; must be 6 links"):
        estimate_consistent(comau_estimate, load_bounds("franka_emika_panda"))
    with pytest.raises(InputError, match="bounds of festo_expt_45: a DELTA robot; must be 6 links"):
        estimate_consistent(comau_estimate, load_bounds("festo_expt_45"))
