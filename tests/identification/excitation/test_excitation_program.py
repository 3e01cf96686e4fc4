"""The optimization problem (2.79) of a robot, for other processes and for Drake's solvers."""

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

from identification.excitation.excitation_program import (
    ExcitationProgram,
    excitation_problem,
    tighten,
)
from identification.excitation.fourier import fourier_basis
from identification.excitation.limits import chosen_limits
from identification.excitation.local_search import LocalSearch
from identification.excitation.scene import Cell, Obstacle

TIMES = np.linspace(0.1, 4.6, 7)


@pytest.fixture(scope="module")
def problem(arm):
    ball = Obstacle(name="ball", kind="sphere", center=np.array([1.5, 0.3, 1.0]), radius=0.2)
    cell = Cell([ball], tool_above=0.2, self_collision=False)
    return excitation_problem(arm, chosen_limits(arm), period=5.0, harmonics=(1, 2), cell=cell)


@pytest.fixture(scope="module")
def program(problem):
    return ExcitationProgram(problem, 60)


def test_derivatives_of_torques_and_postures(problem, program, random_motion):
    scale = np.linspace(0.5, 1.5, random_motion.size).reshape(random_motion.shape)
    x = (random_motion / scale).ravel()
    for constraint in program.constraints:
        evaluate = constraint.at(problem, TIMES, scale)

        def values(x, evaluate=evaluate):
            return ExtractValue(evaluate(InitializeAutoDiff(x).ravel())).ravel()

        jacobian = ExtractGradient(evaluate(InitializeAutoDiff(x).ravel()))
        steps = 1e-6 * np.eye(x.size)
        differences = [(values(x + step) - values(x - step)) / 2e-6 for step in steps]
        np.testing.assert_allclose(jacobian, np.transpose(differences), rtol=1e-4, atol=1e-6)


def test_torques_are_those_of_the_robot(problem, program, random_motion, arm):
    evaluate = program.constraints[0].at(problem, TIMES, np.ones(random_motion.shape))
    shares = ExtractValue(evaluate(InitializeAutoDiff(random_motion.ravel()).ravel()))
    motion = [b @ random_motion.T for b in fourier_basis(TIMES, 5.0, (1, 2))]
    tau = [np.array(problem.torque(*row)).ravel() for row in zip(*motion, strict=True)]
    np.testing.assert_allclose(shares.reshape(7, 3), tau / arm.effort_limit)


def test_limits_hold_at_specified_instants(problem, program, random_motion):
    times = np.arange(20) * 0.25
    coefficients, value = program.solve(random_motion, times, times, 30)
    assert value < program.cost(random_motion)[0] - 5.0
    q, v, a = (b @ coefficients.T for b in fourier_basis(times, 5.0, (1, 2)))
    limits = problem.limits
    for values, most in (
        (q - limits.middle, limits.reach),
        (v, limits.velocity),
        (a, limits.acceleration),
    ):
        assert np.all(np.abs(values) <= most * (1.0 + 1e-3))
    assert problem.posture.values(q).min() > -1e-3


def test_limits_hold_in_between_after_a_local_search(problem):
    optimum = LocalSearch(problem).run(3, 40)
    assert optimum.excess <= 1e-3
    assert optimum.rounds > 1  # there was something to add


def test_narrower_limits(problem):
    narrower = tighten(problem, 0.5, {"height of the flange": 0.1}, 0.02)
    q = np.array([[0.1, 0.7, 0.2]])
    lost = (problem.posture.values(q) - narrower.posture.values(q))[0]
    expected = {"height of the flange": 0.1}
    assert lost == pytest.approx([expected.get(n, 0.02) for n in problem.posture.names])
    np.testing.assert_allclose(narrower.limits.velocity, 0.5 * problem.limits.velocity)
