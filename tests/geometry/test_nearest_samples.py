"""Starts of a search against numpy."""

import math

import casadi as ca
import numpy as np

from pfsc_drake.geometry.nearest_samples import nearest_samples

RNG = np.random.default_rng(4)
PARAMETERS = RNG.uniform(size=(300, 2))
POINTS = RNG.normal(size=(300, 3)) + 1000.0
APART = np.array([0.2, 0.4])


def _starts() -> ca.Function:
    y = ca.MX.sym("y", 3)
    return ca.Function("starts", [y], nearest_samples(y, PARAMETERS, POINTS, APART))


def test_the_nearest_of_all_and_those_apart_from_it() -> None:
    starts = _starts()
    for _ in range(50):
        y = RNG.normal(size=3) + 1000.0
        distance = np.linalg.norm(POINTS - y, axis=1)
        for found in starts(y):
            best = int(np.argmin(distance))
            np.testing.assert_array_equal(np.array(found).ravel(), PARAMETERS[best])
            distance[np.all(np.abs(PARAMETERS - PARAMETERS[best]) < APART, axis=1)] = np.inf


def test_of_what_is_not_finite_it_is_any() -> None:
    starts = _starts()
    for value in (math.nan, math.inf):
        for found in starts([value, 0.0, 0.0]):
            assert np.any(np.all(np.array(found).ravel() == PARAMETERS, axis=1))
