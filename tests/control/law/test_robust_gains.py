"""Gains and tolerated errors: against the rule of the fast pair and the chain of integrators."""

import numpy as np
import pytest

from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.robust_gains import (
    RobotError,
    SampledRobot,
    choose_fast_pole,
    rule_of_poles,
)
from pfsc_drake.control.law.stabilization import LoopGains, Stabilization, gains_from_poles
from pfsc_drake.control.margins import modes
from pfsc_drake.robot.robot_model import joint_resonances

THETA = 0.7


@pytest.fixture(name="arm", scope="module")
def fixture_arm(load_robot, position_path, make_law):
    """Return a law on the three-axis arm at rest on a path, by sampling time, with its posture."""
    robot = load_robot("comau_racer_1_4_elastic_3r")

    def make(period, law="elastic"):
        made = make_law(robot.chain, law, False, sampling_time=period)
        y_t = position_path.position.derivatives(THETA, 0)[0]
        q = robot.reach(y_t, guess=(0.2, 2.0, -0.2))
        r = made.linearization.relative_degree
        point = position_path.evaluator(r)(y_t.tolist(), THETA)
        loop = LoopAtRest(robot.chain, made.linearization, RestPosture(q, point), period)
        return SampledRobot(loop, period, is_elastic=True), joint_resonances(robot.chain, q)

    return make


def gains(*poles):
    return LoopGains(Stabilization([gains_from_poles(poles)] * 3, len(poles), ["x"] * 3))


@pytest.mark.parametrize(
    ("law", "poles"), [("elastic", (-20, -25, -60, -80)), ("visco_elastic", (-20, -25, -60))]
)
def test_sampled_fast_the_modes_are_the_poles(arm, law, poles):
    """Exact linearization: three coordinates, each with all the poles."""
    period = 2e-5
    robot, _ = arm(period, law)
    found = modes(robot.loop.closed_loop(gains(*poles)), period)
    slow = found.rate > -150.0
    assert np.sum(slow) == 3 * len(poles)
    np.testing.assert_allclose(
        np.sort(found.rate[slow]), np.repeat(np.sort(np.array(poles, dtype=float)), 3), rtol=0.02
    )


def test_integral_parts_add_a_mode_each(arm):
    period = 2e-5
    robot, _ = arm(period, "visco_elastic")
    tried = gains(-20, -25, -60)
    tried.outputs.integral = np.full(3, 20.0 * 25.0 * 60.0 * 5.0)
    expected = np.roots([1.0, *tried.outputs.proportional[::-1, 0], tried.outputs.integral[0]])
    found = modes(robot.loop.closed_loop(tried), period)
    slow = found.rate > -150.0
    np.testing.assert_allclose(
        np.sort(found.rate[slow]), np.repeat(np.sort(expected.real), 3), rtol=0.03
    )


@pytest.mark.parametrize("weight", [np.ones(6), None])
@pytest.mark.parametrize("kept", [None, lambda q: q[3] + q[0] * q[4]])
def test_joints_to_spare_have_the_modes_of_their_posture(
    weight, kept, load_robot, position_path, make_law
):
    """Three outputs with their poles, three motions that leave them alone with the posture's."""
    period, robot = 2e-5, load_robot("comau_racer_1_4_elastic")
    made = make_law(
        robot.chain, "elastic", False, sampling_time=period, weight=weight, coordinate=kept
    )
    y_t = position_path.position.derivatives(THETA, 0)[0]
    q, point = robot.reach(y_t), position_path.evaluator(4)(y_t.tolist(), THETA)
    rest = RestPosture(q, point)
    loop = LoopAtRest(robot.chain, made.linearization, rest, period, made.posture)
    own = Stabilization([gains_from_poles((-11.0, -13.0, -17.0, -70.0))] * 6, 4, ["x"] * 6)
    outputs = gains(-20, -25, -60, -80).outputs
    found = modes(loop.closed_loop(LoopGains(outputs, own)), period)
    slow = np.sort(found.rate[found.rate > -150.0])
    expected = np.repeat([-80.0, -70.0, -60.0, -25.0, -20.0, -17.0, -13.0, -11.0], 3)
    np.testing.assert_allclose(slow, expected, rtol=0.02)


@pytest.mark.parametrize("fast", [25.0, 40.0])
def test_the_borne_error_follows_the_rule(arm, fast):
    """``p_3 p_4 = delta omega^2 / 1..3`` at the edge, omega the fastest resonance."""
    robot, resonances = arm(1e-3)
    poles = rule_of_poles(8.0, fast, 4)
    borne = robot.largest_error(gains(*poles), RobotError(stiffness=1.01))
    assert 0.0 < borne < 0.3
    assert 0.8 < borne * resonances[-1] ** 2 / (poles[2] * poles[3]) < 3.5


def test_what_is_borne_separates_stable_from_unstable(arm):
    robot, _ = arm(1e-3)
    slow = gains(*rule_of_poles(8.0, 25.0, 4))
    for direction in (RobotError(mass=0.99), RobotError(stiffness=1.01)):
        borne = robot.largest_error(slow, direction)
        sign = np.sign([direction.mass - 1.0, direction.stiffness - 1.0])
        inside, outside = (RobotError(*(1.0 + factor * borne * sign)) for factor in (0.97, 1.05))
        assert robot.rate(slow, inside) <= 0.0 < robot.rate(slow, outside)
    assert (
        robot.destabilizing_error(slow, 0.9 * robot.largest_error(slow, RobotError(stiffness=1.01)))
        is None
    )
    assert robot.destabilizing_error(slow, 0.3) is not None


def test_the_fast_pole_is_the_slowest_that_suffices(arm):
    robot, _ = arm(1e-3)
    bandwidth, error = 20.0, 0.1

    def worst(fast):
        tried = gains(*rule_of_poles(bandwidth, fast, 4))
        return max(robot.rate(tried, wrong) for wrong in robot.corners(error))

    fast = choose_fast_pole(
        robot, lambda f: gains(*rule_of_poles(bandwidth, f, 4)), [bandwidth], error
    )
    assert bandwidth < fast < 450.0
    assert worst(fast) <= -0.5 * bandwidth < worst(0.8 * fast)


def test_a_slow_coordinate_asks_no_more_of_the_fast_pole_than_it_converges(arm):
    """Coordinates of 20 and 60 1/s: every mode is to keep half of 20, which the slow ones can."""
    robot, _ = arm(1e-3)
    error = 0.05

    def mixed(fast):
        each = [gains_from_poles(rule_of_poles(b, fast, 4)) for b in (20.0, 60.0, 60.0)]
        return LoopGains(Stabilization(each, 4, ["x"] * 3))

    fast = choose_fast_pole(robot, mixed, [20.0, 60.0, 60.0], error)
    both = [RobotError(1.0 + m * error, 1.0 + k * error) for m in (-1, 1) for k in (-1, 1)]
    assert set(both) < set(robot.corners(error))

    assert max(robot.rate(mixed(fast), wrong) for wrong in both) <= -10.0
    # none is slower than the slow poles; -30 1/s would never be reached
    assert fast == pytest.approx(60.0)


class SlowerWithTwoErrors(SampledRobot):
    """A robot whose modes are half as fast where mass and stiffness are wrong together."""

    def rate(self, gains, error):
        together = error.mass != 1.0 and error.stiffness != 1.0
        return -0.05 * gains if together else -0.1 * gains


def test_mass_and_stiffness_may_be_wrong_together():
    """Half of 20 1/s is retained from 200 1/s on; with one error at a time 100 1/s would do."""
    robot = SlowerWithTwoErrors(None, 1e-3, is_elastic=True)
    fast = choose_fast_pole(robot, lambda fast: fast, [20.0], 0.1)
    assert 200.0 <= fast < 250.0


def test_rule_of_poles():
    assert rule_of_poles(60.0, 250.0, 4) == [-60.0, -60.0, -250.0, -350.0]
    assert rule_of_poles(60.0, 250.0, 3) == [-60.0, -60.0, -250.0]
    assert rule_of_poles(60.0, 250.0, 2) == [-60.0, -60.0]
    assert rule_of_poles(60.0, 250.0, 1) == [-60.0]


def test_errors_in_words():
    assert str(RobotError(mass=0.95)) == "nominal masses 5 % too low"
    assert str(RobotError(stiffness=1.05)) == "nominal joint stiffnesses 5 % too high"
