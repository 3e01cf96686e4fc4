"""The program of a robot of one link, against another solver and in closed form."""

import numpy as np
import pytest
from pydrake.solvers import CsdpSolver, MathematicalProgram

from identification.consistency.bounds import FrameBox, LinkBounds, PhysicalBounds
from identification.consistency.pseudo_inertia import pseudo_inertia
from identification.consistency.semidefinite_program import least_squares
from identification.model.dynamic_parameters import LINK_PARAMETERS
from pfsc_drake.errors import InputError

NAMES = [*(f"link_1.{name}" for name in LINK_PARAMETERS), "joint_1.I_M", "joint_1.f_c"]


@pytest.fixture
def bounds():
    box = FrameBox(np.array([-0.1, -0.2, 0.0]), np.array([0.1, 0.2, 0.3]))
    link = LinkBounds(np.array([1.0, 5.0]), box, least_extent=0.05)
    return PhysicalBounds("arm", [link], rotor_inertia=[[1e-4, 1e-2]])


def solution_of_csdp(A, b, link, rotor):
    """Return the least length of the residual, with the inequalities written in full."""
    program = MathematicalProgram()
    rho, length = program.NewContinuousVariables(12), program.NewContinuousVariables(1)
    program.AddLinearCost(length[0])
    rows = np.zeros((len(b) + 1, 13))
    rows[0, -1], rows[1:, :-1] = 1.0, A
    program.AddLorentzConeConstraint(rows, np.append(0.0, -b), np.append(rho, length))
    m, hx, hy, hz, xx, xy, xz, yy, yz, zz = rho[:10]
    half, r = 0.5 * (xx + yy + zz), link.least_extent
    P = np.array(
        [
            [half - xx - r**2 * m, -xy, -xz, hx],
            [-xy, half - yy - r**2 * m, -yz, hy],
            [-xz, -yz, half - zz - r**2 * m, hz],
            [hx, hy, hz, m],
        ]
    )
    program.AddPositiveSemidefiniteConstraint(P)
    program.AddLinearConstraint(m, *link.mass)
    for k, h in enumerate((hx, hy, hz)):
        program.AddLinearConstraint(h >= link.center_of_mass.lower[k] * m)
        program.AddLinearConstraint(h <= link.center_of_mass.upper[k] * m)
    program.AddBoundingBoxConstraint(*rotor, rho[10])
    program.AddBoundingBoxConstraint(0.0, np.inf, rho[11])
    return CsdpSolver().Solve(program).GetSolution(length)[0]


@pytest.mark.parametrize("seed", range(4))
def test_another_solver_finds_the_same(bounds, seed):
    random = np.random.default_rng(seed)
    A, b = random.normal(size=(14, 12)), random.normal(size=14)
    rho = least_squares(A, b, NAMES, bounds, prior_weight=1e-6)
    expected = solution_of_csdp(A, b, bounds.links[0], bounds.rotor_inertia[0])
    assert np.linalg.norm(A @ rho - b) == pytest.approx(expected, rel=1e-5)


def test_without_measurements_the_prior_is_left(bounds):
    prior = np.full(12, np.nan)
    prior[:11] = [2.0, 0.1, -0.1, 0.2, 0.3, 0.01, -0.02, 0.4, 0.03, 0.2, 2e-3]
    A, b = np.eye(1, 12, 11), np.array([3.0])
    rho = least_squares(A, b, NAMES, bounds, prior, prior_weight=1e-3)
    np.testing.assert_allclose(rho, np.append(prior[:11], 3.0), rtol=1e-3, atol=1e-4)


def test_certain_measurements_are_matched(bounds):
    """A prior that is far away does not move it, only what was not measured."""
    measured = np.array([2.0, 0.1, -0.1, 0.2])
    A = np.zeros((5, 12))
    A[:4, :4], A[4, 11] = 1e4 * np.eye(4), 1.0
    rho = least_squares(A, np.append(1e4 * measured, 1.0), NAMES, bounds, prior_weight=1.0)
    np.testing.assert_allclose(rho[:4], measured, atol=1e-5)
    assert np.linalg.eigvalsh(pseudo_inertia(rho[:10]))[0] > 0.0


def test_known_masses_and_rotors(bounds):
    bounds.links[0].mass[:], bounds.rotor_inertia[0] = 3.0, [2e-3, 2e-3]
    random = np.random.default_rng(0)
    rho = least_squares(random.normal(size=(14, 12)), random.normal(size=14), NAMES, bounds)
    assert rho[[0, 10]] == pytest.approx([3.0, 2e-3], rel=1e-6)


def test_a_body_that_is_too_small_for_its_extent(bounds):
    box = bounds.links[0].center_of_mass
    bounds.links[0].body, bounds.links[0].least_extent = box, 0.11
    message = r"bounds of arm: link_1: no body of .* all of it between .* and spreads by 0.11 m"
    with pytest.raises(InputError, match=message):
        least_squares(np.eye(12), np.ones(12), NAMES, bounds)
