"""Tab. C.3, and sets that are consistent from the start."""

from dataclasses import replace

import numpy as np
import pytest

from identification.consistency.nearest import Prediction, nearest_consistent, refuse_far
from identification.consistency.pseudo_inertia import pseudo_inertia, spread
from identification.excitation.fourier import FourierTrajectory
from identification.model.dynamic_parameters import true_parameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory
from tests.identification.model.closed_form_base import load_printed_identification

# of the model that is shipped, on the motion of Tab. C.2 [Nm]
SHIPPED_RMS = [1.20945, 0.9617923, 1.206075, 0.6125733, 0.3546599, 0.3286333]


@pytest.fixture(scope="module")
def printed():
    return load_printed_identification().base_parameters


def links(parameters, count=6):
    return parameters[: 10 * count].reshape(count, 10)


def test_table_c3(set_of_table, comau_base, printed):
    parameters = set_of_table.parameters
    deviation = (comau_base.values(parameters) - printed.mean) / printed.standard_deviation
    assert set_of_table.chi_squared == pytest.approx(deviation @ deviation, rel=1e-9)
    assert set_of_table.chi_squared == pytest.approx(1290.0, abs=0.5)
    np.testing.assert_allclose(set_of_table.deviations, deviation, atol=1e-9)
    np.testing.assert_allclose(deviation[40:], 0.0, atol=1.0)
    assert all(np.linalg.eigvalsh(pseudo_inertia(link))[0] > 0.0 for link in links(parameters))


def test_torques_of_the_table(set_of_table, comau_regressor, comau_base, printed):
    folder = models_directory() / "comau_racer_1_4"
    motion = FourierTrajectory.load(folder / "excitation.yaml").motion(np.arange(0.0, 10.0, 0.013))
    Y = comau_regressor.matrix(*motion)
    error = Y @ set_of_table.parameters - comau_base.reduce(Y) @ printed.mean
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) < SHIPPED_RMS)


def test_infimum_of_the_table(comau_base, comau_bounds, printed):
    """Without a prior and with hardly any bounds, chi squared comes down to 1228.4."""
    for link in comau_bounds.links:
        link.mass[:], link.least_extent = [0.01, 1e3], 1e-4
        link.center_of_mass.lower[:], link.center_of_mass.upper[:] = -1.0, 1.0
    comau_bounds.rotor_inertia.clear()
    found = nearest_consistent(
        comau_base, printed.mean, np.diag(printed.standard_deviation**2), comau_bounds, None, 1e-6
    )
    assert found.chi_squared == pytest.approx(1228.4, abs=0.5)


def test_bounds_are_satisfied(set_of_table, comau_bounds):
    for link, known in zip(links(set_of_table.parameters), comau_bounds.links, strict=True):
        center, box = link[1:4] / link[0], known.center_of_mass
        assert known.mass[0] - 1e-6 <= link[0] <= known.mass[1] + 1e-6
        assert np.all((box.lower - 1e-6 <= center) & (center <= box.upper + 1e-6))
        assert spread(link)[0] > known.least_extent * (1.0 - 1e-4)
    rotors = set_of_table.parameters[60:66]
    assert np.all(rotors >= np.array(comau_bounds.rotor_inertia)[:, 0] * (1.0 - 1e-6))


def test_a_consistent_set_stays(comau, comau_base, comau_bounds):
    true = true_parameters(comau)
    for link in comau_bounds.links:
        link.least_extent *= 0.5
    values = comau_base.values(true)
    covariance = np.diag((1e-3 * np.abs(values)) ** 2)
    found = nearest_consistent(comau_base, values, covariance, comau_bounds, prior=true)
    np.testing.assert_allclose(found.parameters, true, rtol=1e-3, atol=1e-6)
    assert found.chi_squared < 1e-6


def test_body_boxes_bound_the_second_moments(comau_base, comau_bounds, printed):
    box = comau_bounds.links[3].center_of_mass
    comau_bounds.links[3].body = type(box)(box.lower - 0.1, box.upper + 0.1)
    covariance = np.diag(printed.standard_deviation**2)
    found = nearest_consistent(comau_base, printed.mean, covariance, comau_bounds)
    P = pseudo_inertia(links(found.parameters)[3])
    body = comau_bounds.links[3].body
    inside = (
        (body.lower + body.upper) * P[:3, 3] - np.diag(P)[:3] - body.lower * body.upper * P[3, 3]
    )
    assert np.all(inside > -1e-6)


def refused(message, base, values, covariance, *bounds, **options):
    with pytest.raises(InputError, match=message):
        nearest_consistent(base, values, covariance, *bounds, **options)


def test_bad_input(comau_base, comau_bounds, printed, delta):
    C, mean = np.diag(printed.standard_deviation**2), printed.mean
    bad = C.copy()
    bad[0, 1] = bad[1, 0] = 1.01 * np.sqrt(C[0, 0] * C[1, 1])
    refused("least eigenvalue -0.01 of the correlation matrix", comau_base, mean, bad, comau_bounds)
    bad = C.copy()
    bad[2, 2] = 0.0
    refused("variance of link_2.mx is 0; must be positive", comau_base, mean, bad, comau_bounds)
    bad = C.copy()
    bad[0, 1] = 0.1 * C[0, 0]
    refused("covariance: not symmetric", comau_base, mean, bad, comau_bounds)
    refused("covariance: shape .*must be .52, 52", comau_base, mean, C[:5], comau_bounds)
    refused("base parameters: shape .51,.; must be .52,", comau_base, mean[:-1], C, comau_bounds)
    lost = np.where(np.arange(52) == 29, np.nan, mean)
    refused("base parameters: link_6.Izz is nan", comau_base, lost, C, comau_bounds)
    bounds = (comau_base, mean, C, comau_bounds)
    refused("prior_weight = 0.0; must be", *bounds, prior_weight=0.0)
    refused("prior: link_1 of 1 kg has no positive definite", *bounds, prior=np.ones(78))
    few = Prediction(np.ones((3, 6, 5)), np.ones(6), 1.0)
    refused("prediction: matrices .3, 6, 5.; must have 52 columns", *bounds, prediction=few)
    with pytest.raises(InputError, match=r"prediction: matrices .3, 6, 52., deviations .5,"):
        Prediction(np.ones((3, 6, 52)), np.ones(5), 1.0)


def test_bounds_that_contradict_each_other(comau_base, comau_bounds, printed):
    C, mean = np.diag(printed.standard_deviation**2), printed.mean
    box = comau_bounds.links[4].center_of_mass
    comau_bounds.links[4].body = type(box)(box.lower + 1.0, box.upper + 1.0)
    refused("comau_racer_1_4: link_5: no body of", comau_base, mean, C, comau_bounds)
    comau_bounds.links[4].body = None
    comau_bounds.total_mass = [300.0, 400.0]
    refused("total_mass = .300.0, 400.0.; the links have", comau_base, mean, C, comau_bounds)
    comau_bounds.links.pop()
    refused("5 links; must be 6 links", comau_base, mean, C, comau_bounds)


@pytest.mark.parametrize("relative", [1e-8, 1e-5, 1e-2])
def test_measurements_of_any_certainty(relative, comau, comau_base, comau_bounds):
    values = comau_base.values(true_parameters(comau))
    deviation = relative * np.abs(values)
    noisy = values + deviation * np.random.default_rng(0).normal(size=values.size)
    found = nearest_consistent(comau_base, noisy, np.diag(deviation**2), comau_bounds)
    np.testing.assert_allclose(found.base_values, values, rtol=0.2, atol=1e-5 + relative)
    assert all(
        np.linalg.eigvalsh(pseudo_inertia(link))[0] > 0.0 for link in links(found.parameters)
    )


def test_a_set_that_is_far_from_what_was_measured_is_refused(set_of_table):
    """Tab. C.3 has 26 for each parameter, and passes."""
    refuse_far(set_of_table, "found")
    count = len(set_of_table.base_values)
    worst = int(np.argmax(np.abs(set_of_table.deviations)))
    name = set_of_table.base_names[worst].split()[0]
    far = replace(set_of_table, chi_squared=100.1 * count)
    with pytest.raises(InputError, match=rf"found: .* chi squared 5.*; furthest off: {name} \("):
        refuse_far(far, "found")
