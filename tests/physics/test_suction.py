"""Suction cups against hand-made springs, and when they take hold and let go."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.errors import InputError
from pfsc_drake.physics.suction import (
    FREE,
    SuctionParameters,
    cups_function,
    free_cups,
    holding_cups,
)

CUPS = SuctionParameters()
HALF_SIZE = np.array([0.12, 0.08])
FUNCTION = {count: cups_function(CUPS, HALF_SIZE, count) for count in (1, 2)}
DOWN = Rotation.from_euler("ZYX", [25.0, 10.0, 180.0], degrees=True)
ON, OFF = 1.0, 0.0


def tool(R=DOWN, p=(0.5, 0.1, 0.6), v=(0, 0, 0), w=(0, 0, 0)):
    return np.concatenate([p, R.as_matrix().ravel(), v, w])


def plates(*poses, rates=None):
    """Return their state; poses are of pairs R and p."""
    q = [np.concatenate([R.as_quat()[[3, 0, 1, 2]], p]) for R, p in poses]
    v = rates if rates is not None else [np.zeros(6) for _ in poses]
    return np.concatenate([*q, *v])


def evaluate(state, tool_motion, plate_state, vacuum=ON):
    results = FUNCTION[len(plate_state) // 13](state, tool_motion, plate_state, vacuum)
    wrench, pushes, after = (np.array(result).ravel() for result in results)
    return wrench, pushes.reshape(-1, 6), after.reshape(-1, 4)


def pressed(depth, beside=(0.0, 0.0)):
    """Return the state of one plate into which the tool of ``tool()`` is pressed."""
    away = DOWN.apply([*beside, -depth])
    return plates((DOWN, np.array([0.5, 0.1, 0.6]) + away))


def test_cups_above_a_plate_do_nothing():
    wrench, pushes, after = evaluate(free_cups(4), tool(), pressed(-1e-4))
    assert not wrench.any()
    assert not pushes.any()
    assert (after[:, 0] == FREE).all()


def test_cups_beside_a_plate_do_nothing():
    wrench, _, _ = evaluate(free_cups(4), tool(), pressed(5e-4, beside=(0.3, 0.0)))
    assert not wrench.any()


def test_a_plate_pushes_back_along_its_normal():
    depth = 3e-4
    wrench, pushes, _ = evaluate(free_cups(4), tool(), pressed(depth), OFF)
    expected = -4.0 * CUPS.stiffness * depth * DOWN.as_matrix()[:, 2]
    np.testing.assert_allclose(wrench[:3], expected, atol=1e-9)
    np.testing.assert_allclose(wrench[3:], 0.0, atol=1e-12)
    np.testing.assert_allclose(pushes[0, :3], -expected, atol=1e-9)


def test_it_never_pulls_what_leaves_fast():
    leaving = tool(v=-DOWN.as_matrix()[:, 2] * 1.0)
    wrench, _, _ = evaluate(free_cups(4), leaving, pressed(3e-4), OFF)
    assert not wrench.any()


def test_they_take_hold_when_pressed_with_a_vacuum():
    for depth, vacuum, holds in (
        (0.9 * CUPS.press, ON, False),
        (1.1 * CUPS.press, ON, True),
        (1.1 * CUPS.press, OFF, False),
    ):
        _, _, after = evaluate(free_cups(4), tool(), pressed(depth), vacuum)
        assert ((after[:, 0] == 0.0) == holds).all()


def test_taking_hold_changes_no_force():
    state = pressed(1.1 * CUPS.press)
    before, _, after = evaluate(free_cups(4), tool(), state)
    np.testing.assert_allclose(evaluate(after.ravel(), tool(), state)[0], before, atol=1e-9)


def moving_gripper():
    """Return cups that hold a plate which is then moved and moves, with its true displacement."""
    R, p = DOWN, np.array([0.5, 0.1, 0.6])
    state = holding_cups(CUPS, 0, np.eye(3), np.zeros(3), np.zeros(3))
    turn, shift = Rotation.from_rotvec([2e-3, -1e-3, 1.5e-3]), np.array([1e-4, 2e-4, -3e-4])
    rate = np.array([0.02, -0.03, 0.01, 0.003, 0.002, -0.001])
    moved = (turn * R, p + shift)
    return state, plates(moved, rates=[rate]), moved, rate


def test_grasped_plates_hang_on_springs_and_dampers():
    """Against a sum over the cups in world axes."""
    state, plate_state, (R, p), rate = moving_gripper()
    motion = tool(v=(0.001, 0.0, 0.002), w=(0.01, 0.0, -0.02))
    wrench, pushes, _ = evaluate(state, motion, plate_state)
    force, torque, on_plate = np.zeros(3), np.zeros(3), np.zeros(3)
    for x, y in CUPS.cups:
        arm = DOWN.apply([x, y, 0.0])
        rim, anchor = motion[:3] + arm, p + R.apply([x, y, 0.0])
        u = motion[12:15] + np.cross(motion[15:], arm)
        u = u - rate[3:] - np.cross(rate[:3], rim - p)
        f = -CUPS.stiffness * (rim - anchor) - CUPS.damping * u
        force, torque, on_plate = (
            force + f,
            torque + np.cross(arm, f),
            on_plate + np.cross(rim - p, -f),
        )
    np.testing.assert_allclose(wrench, [*force, *torque], rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(pushes[0], [*-force, *on_plate], rtol=1e-9, atol=1e-10)


def test_they_may_bear_a_load_from_the_start():
    load = np.array([1.0, -2.0, 8.0])
    state = holding_cups(CUPS, 0, np.eye(3), np.zeros(3), load)
    wrench, _, _ = evaluate(state, tool(), pressed(0.0))
    np.testing.assert_allclose(DOWN.inv().apply(wrench[:3]), load, atol=1e-9)
    np.testing.assert_allclose(wrench[3:], 0.0, atol=1e-9)


def test_action_is_reaction_about_any_point():
    state, plate_state, (_, p), _ = moving_gripper()
    wrench, pushes, _ = evaluate(state, tool(), plate_state)
    about_origin = wrench[3:] + np.cross([0.5, 0.1, 0.6], wrench[:3])
    np.testing.assert_allclose(wrench[:3] + pushes[0, :3], 0.0, atol=1e-10)
    np.testing.assert_allclose(
        about_origin + pushes[0, 3:] + np.cross(p, pushes[0, :3]), 0.0, atol=1e-10
    )


def test_they_let_go_without_vacuum():
    state, plate_state, _, _ = moving_gripper()
    assert (evaluate(state, tool(), plate_state)[2][:, 0] == 0.0).all()
    assert (evaluate(state, tool(), plate_state, OFF)[2][:, 0] == FREE).all()


@pytest.mark.parametrize(("share", "holds"), [(0.99, True), (1.01, False)])
def test_they_are_torn_off_by_too_much_tension(share, holds):
    state = holding_cups(CUPS, 0, np.eye(3), np.zeros(3), np.zeros(3))
    gap = share * CUPS.pull_off / CUPS.stiffness
    assert ((evaluate(state, tool(), pressed(-gap))[2][:, 0] == 0.0) == holds).all()


def test_they_slip_where_too_much_pulls_along_the_plate():
    state = holding_cups(CUPS, 0, np.eye(3), np.zeros(3), np.zeros(3))
    moved = pressed(0.0, beside=(3.0 * CUPS.shear / CUPS.stiffness, 0.0))
    _, _, after = evaluate(state, tool(), moved)
    wrench, _, again = evaluate(after.ravel(), tool(), moved)
    assert np.linalg.norm(wrench[:3]) == pytest.approx(4.0 * CUPS.shear, rel=1e-9)
    np.testing.assert_allclose(again, after, atol=1e-12)  # it slips no farther


def test_of_two_plates_the_one_that_is_pressed_is_taken():
    far = (DOWN, np.array([0.5, 0.6, 0.6]))
    near = (DOWN, np.array([0.5, 0.1, 0.6]) - DOWN.apply([0.0, 0.0, 3e-4]))
    _, pushes, after = evaluate(free_cups(4), tool(), plates(far, near))
    assert (after[:, 0] == 1.0).all()
    assert not pushes[0].any()
    assert pushes[1].any()


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"stiffness": 0.0}, "stiffness = 0"),
        ({"press": -1e-4}, "press = -0.0001"),
        ({"damping": -1.0}, "damping = -1"),
        ({"pull_off": np.inf}, "pull_off = inf"),
        ({"cups": [[0.1, 0.1], [0.1, -0.1]]}, "three or more"),
        ({"cups": [[0.1, 0.1, 0.0]] * 4}, "2 finite numbers"),
    ],
)
def test_wrong_numbers_are_refused(changes, part):
    with pytest.raises(InputError, match=part):
        SuctionParameters(**changes)


def test_a_quaternion_of_any_length_is_an_orientation():
    """An integrator does not keep its length."""
    state, plate_state, _, _ = moving_gripper()
    longer = plate_state.copy()
    longer[:4] *= 1.3
    for one, other in zip(
        evaluate(state, tool(), plate_state), evaluate(state, tool(), longer), strict=True
    ):
        np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("beside", [[0.06, 0.0], [0.0, 0.06]])
def test_only_cups_over_the_plate_touch_it(beside):
    """The plate is longer than wide: two cups of four are beyond its end, or beyond its side."""
    depth, state = 3e-4, pressed(3e-4, beside)
    wrench, _, _ = evaluate(free_cups(4), tool(), state, OFF)
    expected = -2.0 * CUPS.stiffness * depth * DOWN.as_matrix()[:, 2]
    np.testing.assert_allclose(wrench[:3], expected, atol=1e-9)
