"""States of a few ticks later, against plants that Drake moved."""

import numpy as np
import pytest
import scipy.linalg

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.state_predictor import StatePredictor
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import gravity_function
from tests.control.estimation.conftest import BEARINGS, DAMPING

PERIOD, COUNT = 1e-3, 60
NOTHING = np.zeros(3)


def drives():
    turns = np.linspace(0.0, 6.0, COUNT)[:, None]
    return np.array([120.0, -300.0, 80.0]) * np.cos(turns)


def told(predictor, states, told_torques, **more):
    """Return what a predictor makes of states, being told torques."""
    stepper = Stepper(predictor, tuple(more))
    return np.array(
        [
            stepper.step(joint_state=x, drive_torque=tau, **{k: v[i] for k, v in more.items()})[
                "joint_state"
            ]
            for i, (x, tau) in enumerate(zip(states, told_torques, strict=False))
        ]
    )


@pytest.mark.parametrize("kind", ["rigid", "elastic", "mixed"])
@pytest.mark.parametrize("ticks", [1, 2, 3])
def test_the_state_is_that_of_so_many_ticks_later(drake_arm, kind, ticks):
    """The arm acts on what it was told ``ticks`` before."""
    arm, sent = drake_arm(kind), drives()
    states = np.array(arm.move(sent, lambda _: NOTHING, lambda _: NOTHING, PERIOD))
    # what acts from tick k on was told at tick k - ticks
    found = told(StatePredictor(arm.chain, ticks, PERIOD), states, [*sent[ticks:], *sent])
    settled = slice(ticks + 1, COUNT - ticks)
    later = states[settled.start + ticks : COUNT]
    scale = np.repeat([1.0, 100.0, 1.0, 100.0], 3)
    ahead = np.abs((found[settled] - later) / scale).max()
    unpredicted = np.abs((states[settled] - later) / scale).max()
    assert unpredicted > 5e-4
    assert ahead < 0.02 * unpredicted


def test_springs_are_exact_and_inertia_is_that_of_the_middle(drake_arm):
    """Against the matrix exponential of the linear system that Drake tells there."""
    arm, ticks = drake_arm("elastic"), 3
    state, K_s, n = arm.state(), arm.chain.K_s, 3
    v, middle = state[3:6], state[:3] + 0.5 * ticks * PERIOD * state[3:6]
    tau = gravity_function(arm.chain)(state[:3]).full().ravel()

    def accelerated(bend):
        there = np.concatenate([middle, v, middle + bend, v])
        return arm.rates(there, NOTHING, NOTHING, NOTHING)[3:6]

    falling = accelerated(NOTHING)
    inverse = np.column_stack(
        [(accelerated(e) - falling) / k for e, k in zip(np.eye(n), K_s, strict=True)]
    )
    spring = np.hstack([-np.diag(K_s), -np.diag(DAMPING), np.diag(K_s), np.diag(DAMPING)])
    A = np.zeros((4 * n + 1, 4 * n + 1))
    A[:n, n : 2 * n] = A[2 * n : 3 * n, 3 * n : -1] = np.eye(n)
    A[n : 2 * n, :-1], A[n : 2 * n, -1] = inverse @ spring, falling
    A[3 * n : -1, :-1] = -spring / arm.chain.D_M[:, None]
    A[3 * n : -1, 3 * n : -1] -= np.diag(BEARINGS / arm.chain.D_M)
    A[3 * n : -1, -1] = tau / arm.chain.D_M
    expected = (scipy.linalg.expm(ticks * PERIOD * A) @ [*state, 1.0])[:-1]
    found = told(StatePredictor(arm.chain, ticks, PERIOD), [state], [tau])[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", ["rigid", "elastic"])
def test_velocities_of_difference_quotients_are_brought_up_to_positions(drake_arm, kind):
    arm, sent = drake_arm(kind), drives()
    states = np.array(arm.move(sent, lambda _: NOTHING, lambda _: NOTHING, PERIOD))
    late = states[1:].copy()
    for position, velocity in ((slice(0, 3), slice(3, 6)), (slice(6, 9), slice(9, 12))):
        late[:, velocity] = np.diff(states[:, position], axis=0) / PERIOD
    found = told(StatePredictor(arm.chain, 0, PERIOD, PERIOD / 2), late, sent[1:])
    error = np.abs(found - states[1:COUNT])[1:, [3, 4, 5, 9, 10, 11]].max()
    before = np.abs(late[:-1] - states[1:COUNT])[1:, [3, 4, 5, 9, 10, 11]].max()
    assert before > 0.01
    assert error < 0.05 * before
    np.testing.assert_allclose(found[:, 6:9], late[:-1, 6:9], rtol=0, atol=1e-15)


def test_friction_that_is_told_is_taken_off(drake_arm):
    arm, sent, f = drake_arm("elastic"), drives(), np.array([30.0, -40.0, 20.0])
    states = np.array(arm.move(sent, lambda _: f, lambda _: NOTHING, PERIOD))[:COUNT]
    rubbing = np.tile(f, (COUNT, 1))
    later = slice(5, COUNT - 2)
    with_it = told(
        StatePredictor(arm.chain, 2, PERIOD), states, [*sent[2:], *sent], friction_torque=rubbing
    )[later]
    without = told(StatePredictor(arm.chain, 2, PERIOD), states, [*sent[2:], *sent])[later]
    true = states[7:COUNT]
    assert np.abs(with_it - true)[:, 9:].max() < 0.03 * np.abs(without - true)[:, 9:].max()


def test_a_robot_at_rest_stays_at_rest(drake_arm):
    """At the start what is on its way holds the weight."""
    arm = drake_arm("elastic")
    q = np.array([0.3, 1.3, -0.5])
    weight = gravity_function(arm.chain)(q).full().ravel()
    state = np.concatenate([q, NOTHING, q + weight / arm.chain.K_s, NOTHING])
    found = told(StatePredictor(arm.chain, 3, PERIOD), [state], [weight])[0]
    np.testing.assert_allclose(found, state, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("ticks", "age", "message"), [(-1, 0.0, "-1 ticks"), (11, 0.0, "11 ticks"), (1, 2e-3, "0.002")]
)
def test_numbers_out_of_range(drake_arm, ticks, age, message):
    with pytest.raises(InputError, match=message):
        StatePredictor(drake_arm("rigid").chain, ticks, PERIOD, age)


def test_what_is_not_measured_is_not_foretold(drake_arm):
    """The rest is passed on, so that a stop still sees it; afterwards all is foretold again."""
    arm = drake_arm("elastic")
    states = np.array(arm.move(drives(), lambda _: NOTHING, lambda _: NOTHING, PERIOD))[:3]
    whole = told(StatePredictor(arm.chain, 2, PERIOD), states, drives())
    states[1, 7] = np.nan
    found = told(StatePredictor(arm.chain, 2, PERIOD), states, drives())
    np.testing.assert_array_equal(found[1], states[1])
    np.testing.assert_array_equal(found[[0, 2]], whole[[0, 2]])
