"""Figures of information matrices, and their gradients."""

import numpy as np
import pytest

from identification.excitation.criterion import ExcitationCost, information
from identification.excitation.fourier import FourierTrajectory
from pfsc_drake.errors import InputError


def test_tab_c_2(regressor, base, printed):
    figures = information(regressor, base, printed)
    assert figures.base_parameters == 52
    assert figures.log_determinant == pytest.approx(599.33, abs=0.01)


@pytest.mark.parametrize("criterion", ["D", "condition"])
def test_gradient(arm_problem, random_motion, criterion):
    cost = ExcitationCost(arm_problem.kernels, 5.0, (1, 2), 60, criterion)
    _, gradient = cost(random_motion)
    for index in np.ndindex(random_motion.shape):
        step = np.zeros_like(random_motion)
        step[index] = 1e-6
        difference = cost(random_motion + step)[0] - cost(random_motion - step)[0]
        assert gradient[index] == pytest.approx(difference / 2e-6, rel=1e-4, abs=1e-4)


def test_values_are_those_of_the_matrix(arm_problem, random_motion):
    motion = FourierTrajectory.from_coefficients(random_motion, 5.0, (1, 2))
    q, v, a = motion.motion(np.arange(60) * 5.0 / 60)
    X = np.vstack([np.array(arm_problem.kernels[0](*row)) for row in zip(q, v, a, strict=True)])
    sign, value = np.linalg.slogdet(X.T @ X)
    value += X.shape[1] * np.log(1000.0 / 60.0)  # as of 1000 samples
    by_determinant = ExcitationCost(arm_problem.kernels, 5.0, (1, 2), 60)
    by_condition = ExcitationCost(arm_problem.kernels, 5.0, (1, 2), 60, "condition")
    assert sign == 1.0
    assert by_determinant(random_motion)[0] == pytest.approx(-value, rel=1e-9)
    assert np.exp(by_condition(random_motion)[0]) == pytest.approx(np.linalg.cond(X), rel=1e-6)


def test_robot_at_rest_shows_nothing(arm_problem):
    cost = ExcitationCost(arm_problem.kernels, 5.0, (1, 2), 60)
    assert cost(np.zeros((3, 5)))[0] == np.inf


def test_refuses(arm_problem):
    with pytest.raises(InputError, match="criterion = 'A'; must be one of D, condition"):
        ExcitationCost(arm_problem.kernels, 5.0, (1, 2), 60, "A")
    with pytest.raises(InputError, match="samples = 3; must be at least"):
        ExcitationCost(arm_problem.kernels, 5.0, (1, 2), 3)
