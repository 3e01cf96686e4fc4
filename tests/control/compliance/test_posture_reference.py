"""The posture reference: where it starts and goes, and what moves it beside the outputs."""

import dataclasses

import numpy as np
import pytest

from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.posture_impedance import (
    CompliantPosture,
    NullSpaceImpedance,
    NullSpaceImpedanceParameters,
)
from pfsc_drake.control.law.linearization import decoupling_function
from pfsc_drake.control.law.posture import Posture, free_motion_function
from pfsc_drake.control.law.stabilization import Stabilization, gains_from_poles
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import FourierCurve, Path
from tests.control.conftest import BENT_7, Robot

PERIOD = 1e-3


@pytest.fixture(name="arm")
def fixture_arm(load_robot, small_path):
    """Return the seven-axis arm, its manifold, a posture and the manifold's point there."""
    robot = load_robot("franka_emika_panda")
    q = np.array(BENT_7)
    y_t, _ = robot.tool_pose(np.concatenate([q, 0 * q]))
    point = small_path.evaluator(2)(y_t.tolist(), small_path.nearest(y_t))
    return robot.chain, PathManifold(2, oriented=True), q, point


def posture(weight):
    gains = Stabilization([gains_from_poles([-10.0, -12.0])] * 7, 2, ["posture"] * 7)
    return Posture(gains, weight)


def yielding(arm, weight=None, **pull):
    impedance = NullSpaceImpedance(NullSpaceImpedanceParameters(1.0, 20.0, 0.0), 2, PERIOD)
    return CompliantPosture(arm[0], arm[1], posture(weight), impedance, **pull)


def at_rest(q):
    return np.concatenate([q, 0 * q, q, 0 * q])


def started(law, q, point, torque=None):
    """Return a stepper of a law, and what it is given."""
    inputs = {"joint_state": at_rest(q), "manifold_point": point}
    stepper = Stepper(law, () if torque is None else ("tau_ext",))
    return stepper, inputs | ({} if torque is None else {"tau_ext": torque})


def drift(law, arm, torque, steps=5):
    """Return in which direction the posture starts to move, shape (7,)."""
    stepper, inputs = started(law, *arm[2:], torque)
    for _ in range(steps):
        stepper.step(**inputs)
    return stepper.states["motion"][14:21]


@pytest.mark.parametrize("weight", [np.ones(7), np.arange(1.0, 8.0), None])
def test_what_presses_on_the_outputs_does_not_move_it(weight, arm):
    chain, manifold, q, point = arm
    A = np.array(decoupling_function(chain, manifold)(q, point))
    law = yielding(arm, weight)
    along = A.T @ np.array([30.0, -20.0, 10.0, 1.0, 2.0, -3.0])
    across = np.linalg.svd(A)[2][-1]
    assert np.abs(drift(law, arm, along)).max() < 1e-9 * np.abs(drift(law, arm, across)).max()


def test_the_free_part_alone_moves_it(arm):
    """With a weight of one it moves along the null vector, by the torque's share along it."""
    chain, manifold, q, point = arm
    free = np.linalg.svd(np.array(decoupling_function(chain, manifold)(q, point)))[2][-1]
    law, torque = yielding(arm, np.ones(7)), np.arange(1.0, 8.0)
    direction = drift(law, arm, torque)
    assert np.allclose(direction / np.linalg.norm(direction), free * np.sign(torque @ free))
    assert np.allclose(drift(law, arm, (torque @ free) * free), direction)


def test_the_inertia_decides_the_projection(arm):
    """``N' = I - A' (A M^-1 A')^-1 A M^-1`` with Drake's mass matrix."""
    chain, manifold, q, point = arm
    A = np.array(decoupling_function(chain, manifold)(q, point))
    torque = np.arange(1.0, 8.0)
    M = np.array(free_motion_function(chain, manifold, inertial=True)(q, point)[2])
    M_inv = np.linalg.inv(M)
    N = np.eye(7) - M_inv @ A.T @ np.linalg.solve(A @ M_inv @ A.T, A)
    expected = drift(yielding(arm, np.ones(7)), arm, torque)  # scale of the response
    actual = drift(yielding(arm, None), arm, torque)
    free = np.linalg.svd(A)[2][-1]
    scale = np.linalg.norm(expected) / abs(torque @ free)
    assert np.allclose(actual, scale * (N.T @ torque), rtol=1e-9)


def test_the_mass_matrix_has_the_rotors(arm, load_robot):
    chain, manifold, q, point = arm
    M = np.array(free_motion_function(chain, manifold, inertial=True)(q, point)[2])
    D_E, _ = load_robot("franka_emika_panda").link_dynamics(q, 0 * q)
    assert np.allclose(M, D_E + np.diag(chain.D_M), atol=1e-10)


def potential(name, chain, manifold, q, point):
    """Return V of the documentation."""
    if name == "conditioning":
        A = np.array(decoupling_function(chain, manifold)(q, point))
        return -0.5 * np.log(np.linalg.det(A @ A.T))
    lower, upper = chain.gather("position_limits").T
    half = (upper - lower) / 2.0
    x = (q - (upper + lower) / 2.0) / half
    return np.sum(half**2 * (x**2 + x**4 / 2.0)) / 2.0


@pytest.mark.parametrize("name", ["limits", "conditioning"])
def test_pulls_are_gradients(name, arm):
    chain, manifold, q, point = arm
    pull = np.array(free_motion_function(chain, manifold, name)(q, point)[1]).ravel()
    steps = 1e-5 * np.eye(7)
    gradient = np.array(
        [
            potential(name, chain, manifold, q + step, point)
            - potential(name, chain, manifold, q - step, point)
            for step in steps
        ]
    )
    gradient /= 2e-5
    if name == "conditioning":
        gradient /= np.sqrt(1.0 + gradient @ gradient)
    assert np.allclose(pull, -gradient, atol=1e-7)


def test_a_pull_without_torques_moves_it_downhill(arm):
    chain, manifold, q, point = arm
    for name in ("limits", "conditioning"):
        law = yielding(arm, np.ones(7), potential=name, pull_stiffness=50.0)
        direction = drift(law, arm, None)
        step = 1e-4 * direction / np.linalg.norm(direction)
        before, after = (potential(name, chain, manifold, x, point) for x in (q, q + step))
        assert after < before


def test_joints_without_limits_are_not_pulled(arm):
    chain, manifold, q, point = arm
    endless = dataclasses.replace(chain.links[2], position_limits=(-np.inf, np.inf))
    links = (*chain.links[:2], endless, *chain.links[3:])
    chain = dataclasses.replace(chain, links=links)
    pull = np.array(free_motion_function(chain, manifold, "limits")(q, point)[1]).ravel()
    assert pull[2] == 0.0
    assert np.all(pull[[0, 1, 3, 4, 5, 6]] != 0.0)


def test_without_torque_and_pull_it_rests(arm):
    assert np.array_equal(drift(yielding(arm, np.ones(7)), arm, None), np.zeros(7))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_moves_nothing(bad, arm):
    torque = np.ones(7)
    torque[3] = bad
    assert np.array_equal(drift(yielding(arm, np.ones(7)), arm, torque), np.zeros(7))


def test_wrong_pulls_are_refused(arm):
    with pytest.raises(InputError, match="potential: 'gravity'; must be one of limits"):
        yielding(arm, np.ones(7), potential="gravity")
    with pytest.raises(InputError, match="pull_stiffness: -1"):
        yielding(arm, np.ones(7), potential="limits", pull_stiffness=-1.0)


ELASTIC = 4


@pytest.fixture(name="run", scope="module")
def fixture_run():
    """Return a function that runs a posture of elastic joints, and returns it: (samples, 5, 7)."""
    chain, q = Robot("franka_emika_panda_elastic").chain, np.array(BENT_7)
    path = Path(FourierCurve.circle([0.45, 0.0, 0.4], 0.1, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    poles = gains_from_poles([-10.0, -12.0, -15.0, -20.0])
    gains = Stabilization([poles] * 7, ELASTIC, ["q"] * 7)
    impedance = NullSpaceImpedance(NullSpaceImpedanceParameters(1.0, 20.0, 50.0), ELASTIC, PERIOD)
    manifold = PathManifold(ELASTIC, oriented=False)
    point = path.evaluator(ELASTIC).evaluate_at(0.3)

    def run(duration, goal=None, torque=None):
        law = CompliantPosture(chain, manifold, Posture(gains, None), impedance, goal=goal)
        stepper, inputs = started(law, q, point, torque)
        ticks = range(round(duration / PERIOD) + 1)
        rows = [stepper.step(**inputs)["posture_reference"] for _ in ticks]
        return np.reshape(rows, (-1, ELASTIC + 1, 7))

    return run


def test_it_starts_at_rest_where_the_joints_are_and_stays(run):
    rows = run(0.2)
    assert np.array_equal(rows[0, 0], BENT_7)
    assert np.allclose(rows[:, 0], BENT_7, rtol=0, atol=1e-12)
    assert np.abs(rows[:, 1]).max() < 1e-10


def test_it_goes_smoothly_to_its_goal(run):
    goal = np.array(BENT_7) + 0.3
    rows = run(3.0, goal)
    assert np.array_equal(rows[0, 1:], np.zeros((ELASTIC, 7)))
    assert np.allclose(rows[-1, 0], goal, atol=2e-3)
    # no derivative that the law follows jumps; the highest rises within some hundredths of a second
    steps = np.abs(np.diff(rows, axis=0)).max(axis=(0, 2)) / np.abs(rows).max(axis=(0, 2))
    assert np.all(steps[:ELASTIC] < 0.05)
    assert steps[ELASTIC] < 0.2


def test_no_joint_is_pulled_faster_than_half_its_speed(run):
    """The first is let as fast as may be, but for the three lags of 1 / 30 s behind its spring."""
    goal = np.array(BENT_7) + np.array([3.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    half = Robot("franka_emika_panda_elastic").chain.gather("velocity_limit") / 2.0
    velocity = run(1.0, goal)[:, 1]
    assert velocity[-1, 0] == pytest.approx(half[0] * 20.0 / (20.0 + 50.0 * 3.0 / 30.0), rel=2e-3)
    assert np.all(np.abs(velocity) < half)
    spoiled = run(1.0, goal, np.full(7, np.nan))[:, 1]
    assert np.allclose(spoiled, velocity, rtol=0, atol=1e-12)


def test_it_yields_to_torques(run):
    torque = np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0])
    assert run(1.0, None, torque)[-1, 0, 2] - BENT_7[2] > 0.01
    assert np.array_equal(run(0.1, None, np.full(7, np.nan)), run(0.1))


def test_its_output_depends_on_its_state_alone(arm):
    program = Program(Network.of(yielding(arm, np.ones(7))))
    stage, _ = program.output("posture_reference")
    assert not any(source.kind == "input" for source in program.stages[stage].needs)
