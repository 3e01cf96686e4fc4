"""Deviation by an unmodelled force: closed forms with Drake's masses."""

import numpy as np
import pytest

from diagrams.warnings.unmodelled_forces import largest_deflection
from pfsc_drake.control.law.linearization import decoupling_function
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.stabilization import (
    CoordinateGains,
    LoopGains,
    Stabilization,
    gains_from_poles,
)

THETA = 0.7


@pytest.fixture(name="arm", scope="module")
def fixture_arm(load_robot, position_path, make_law):
    """Return an arm on a path, by model and law: what the deviation needs, and across J' too."""

    def make(model, law, gains, period):
        robot = load_robot(model)
        made = make_law(robot.chain, law, False, sampling_time=period).linearization
        y_t = position_path.position.derivatives(THETA, 0)[0]
        q = robot.reach(y_t, guess=(0.2, 2.0, -0.2))
        rest = RestPosture(q, position_path.evaluator(made.relative_degree)(y_t.tolist(), THETA))
        loop = LoopAtRest(robot.chain, made, rest, period)
        outputs = LoopGains(Stabilization([gains] * 3, made.relative_degree, ["x"] * 3))
        found = largest_deflection(robot.chain, made, outputs, loop, rest, period)
        rigid = load_robot("comau_racer_1_4_3r")
        J = rigid.jacobian(q)[3:]
        across = np.array(decoupling_function(robot.chain, made.manifold)(q, rest.point))[1:]
        return found, rigid, q, J, across

    make.soft = load_robot("comau_racer_1_4_elastic_3r").chain
    return make


@pytest.mark.slow(but="visco_elastic-poles0")
@pytest.mark.parametrize(
    ("law", "poles"),
    [("visco_elastic", (-20, -30, -40)), ("elastic", (-20, -30, -40, -50))],
)
def test_laws_for_elastic_joints_take_a_force_for_motion_of_the_links(arm, law, poles):
    """At rest y'' = 0 is estimated as -d, d = J D_E^-1 J' f, and the motors do not move.

    Law and motors disagree about y^(r) by J D_E^-1 K D_E^-1 J' f, K the damping of the joints
    (r = 3) or their stiffness (r = 4): a_1 e = a_3 d less that.
    """
    gains = gains_from_poles(poles)
    a_1, _, a_3 = gains.proportional[:3]
    found, rigid, q, J, across = arm("comau_racer_1_4_elastic_3r", law, gains, 1e-4)
    D_E, _ = rigid.link_dynamics(q, 0.0 * q)
    chain = arm.soft
    K = chain.K_d if law == "visco_elastic" else chain.K_s
    links = np.linalg.solve(D_E, J.T)
    way = (a_3 * links - np.linalg.solve(D_E, K[:, None] * links)) / a_1
    assert found == pytest.approx(np.linalg.norm(across @ way, 2), rel=0.02)


def test_a_rigid_robot_is_a_spring(arm):
    """1 / (m p^2), m the least effective mass of links and rotors across the path."""
    found, rigid, q, J, across = arm(
        "comau_racer_1_4_3r", "rigid", gains_from_poles((-30, -30)), 1e-4
    )
    D_E, _ = rigid.link_dynamics(q, 0.0 * q)
    D = D_E + np.diag(rigid.chain.D_M)
    expected = np.linalg.norm(across @ np.linalg.solve(D, J.T), 2) / 30.0**2
    assert found == pytest.approx(expected, rel=0.01)


def test_an_integral_part_takes_it_away_again(arm):
    """Three poles at -30: t^2 / 2 exp(-30 t) / m, the largest at t = 2 / 30."""
    triple = CoordinateGains((2700.0, 90.0), 27e3)
    found, rigid, q, J, across = arm("comau_racer_1_4_3r", "rigid", triple, 1e-4)
    D_E, _ = rigid.link_dynamics(q, 0.0 * q)
    D = D_E + np.diag(rigid.chain.D_M)
    peak = 0.5 * (2.0 / 30.0) ** 2 * np.exp(-2.0)
    expected = peak * np.linalg.norm(across @ np.linalg.solve(D, J.T), 2)
    assert found == pytest.approx(expected, rel=0.01)
