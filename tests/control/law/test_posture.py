"""Demands of a posture: against its potential and its error dynamics."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.law.posture import Posture, free_motion_function, posture_expressions
from pfsc_drake.control.law.stabilization import Stabilization, gains_from_poles

N = 3


@pytest.fixture
def chain(load_robot):
    return load_robot("comau_racer_1_4_3r").chain


@pytest.mark.parametrize("turns", [-1, 0, 2])
def test_a_coordinate_takes_the_shorter_way_round(chain, turns):
    """An angle that is whole turns beside its reference is where it should be."""
    own = Stabilization([gains_from_poles((-4.0, -5.0))] * N, 2, ["x"] * N)
    posture = Posture(own, np.ones(N), coordinate=lambda q: q[0])
    q, v, zero = np.array([0.3, 1.0, -0.2]), np.array([0.1, 0.0, 0.0]), np.zeros(N)
    wanted = q + np.array([0.2 + 2.0 * np.pi * turns, 0.0, 0.0])
    asked = posture_expressions(
        posture, chain, [ca.SX(q), ca.SX(v)], [ca.SX(wanted), ca.SX(zero), ca.SX(zero)]
    )
    # c'' = -(p_1 + p_2) c' - p_1 p_2 c of the error
    assert float(asked.rate) == pytest.approx(-9.0 * 0.1 + 20.0 * 0.2, abs=1e-9)


def test_how_fast_joints_may_go_to_their_ends():
    own = Stabilization([gains_from_poles((-4.0, -5.0))] * N, 2, ["x"] * N)
    ends = np.array([[-1.0, -2.0, -np.inf], [1.0, 0.5, np.inf]])
    posture = Posture(own, np.ones(N), ends=ends)
    q = ca.SX.sym("q", N)
    found = np.array(ca.Function("f", [q], [posture.to_ends(q)])([0.5, 0.6, 7.0]))
    # a tenth of a second from them, and back where they are passed
    np.testing.assert_allclose(found, [[5.0, 15.0], [-1.0, 26.0], [np.inf, np.inf]], rtol=1e-12)
    assert Posture(own, np.ones(N)).to_ends(q) is None


def test_the_pull_from_the_limits_is_the_slope_of_the_potential(chain, position_path, make_law):
    """``V = sum h^2 (x^2 + x^4 / 2) / 2``, by differences; four times as stiff at a limit."""
    manifold = make_law(chain, "rigid", False).linearization.manifold
    function = free_motion_function(chain, manifold, "limits")
    lower, upper = chain.gather("position_limits").T
    half, middle = (upper - lower) / 2.0, (upper + lower) / 2.0

    def potential(q):
        x = (q - middle) / half
        return np.sum(half**2 * (x**2 + x**4 / 2.0)) / 2.0

    def pull(q):
        return np.array(function(q, np.zeros(manifold.layout.size))[1]).ravel()

    step = 1e-5 * np.eye(N)
    for share in (0.1, 0.6, 1.0):
        q = middle + share * half * [1.0, -1.0, 1.0]
        slope = [(potential(q + dq) - potential(q - dq)) / 2e-5 for dq in step]
        np.testing.assert_allclose(pull(q), -np.array(slope), rtol=1e-6)
    stiffness = [(pull(upper - dq) - pull(upper))[i] / 1e-5 for i, dq in enumerate(step)]
    np.testing.assert_allclose(stiffness, 4.0, rtol=1e-3)
