"""A hand that turns the tool: its target, its torque, and a body in it."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandModel, HandParameters, HandWaypoint, Wander
from pfsc_drake.physics.hand_path import OrientationTarget
from pfsc_drake.yaml.typed import load_typed

TIMES = np.array([1.0, 3.0, 4.0])
ANGLES = np.array([[170.0, 0.0, 0.0], [190.0, -20.0, 10.0], [190.0, -20.0, 30.0]])
STILL = np.zeros(6)


def rotation(zyx_deg):
    return Rotation.from_euler("ZYX", zyx_deg, degrees=True)


def numbers(expression):
    """Return what an expression without symbols is, a vector or a matrix."""
    return ca.evalf(ca.MX(expression)).full().squeeze()


def turning_hand(*zyx_deg, **changes):
    waypoints = [HandWaypoint(1.0 + i, np.zeros(3), angles) for i, angles in enumerate(zyx_deg)]
    options = {"waypoints": waypoints, "rotational_stiffness": 5.0, "torque_limit": 100.0}
    return HandModel(HandParameters(**options | changes))


def test_the_target_rests_in_every_orientation():
    target = OrientationTarget(TIMES, ANGLES)
    for time, angles in zip([0.0, *TIMES, 99.0], ANGLES[[0, 0, 1, 2, 2]], strict=True):
        R_d, w_d = map(numbers, target.at(time))
        assert R_d == pytest.approx(rotation(angles).as_matrix(), abs=1e-12)
        assert not np.any(w_d)


def test_the_target_turns_about_one_axis_by_the_smaller_angle():
    target = OrientationTarget(TIMES, ANGLES)
    whole = (rotation(ANGLES[1]) * rotation(ANGLES[0]).inv()).as_rotvec()
    assert np.linalg.norm(whole) < np.deg2rad(40.0)  # not 340 deg back through zero
    h = 1e-6
    for time in (1.3, 2.0, 2.9, 3.5):
        (R_0, _), (R_d, w_d), (R_1, _) = (map(numbers, target.at(time + dt)) for dt in (-h, 0.0, h))
        turned = (Rotation.from_matrix(R_1) * Rotation.from_matrix(R_0).inv()).as_rotvec()
        assert turned / (2.0 * h) == pytest.approx(w_d, abs=1e-7)
        if time < 3.0:
            assert np.cross(w_d, whole) == pytest.approx(np.zeros(3), abs=1e-12)
    # minimum jerk: half of the way in half of the time, at 1.875 of the mean rate
    R_d, w_d = map(numbers, target.at(2.0))
    half = (Rotation.from_matrix(R_d) * rotation(ANGLES[0]).inv()).as_rotvec()
    assert half == pytest.approx(whole / 2.0)
    assert w_d == pytest.approx(1.875 * whole / 2.0)


def test_it_turns_like_a_spring_and_a_damper():
    hand = turning_hand([10.0, 20.0, 30.0], rotational_damping=0.5)
    axis, angle = np.array([0.6, 0.0, -0.8]), 0.4
    R_e = (Rotation.from_rotvec(-angle * axis) * rotation([10, 20, 30])).as_matrix()
    twist = np.array([0.0, 0.0, 0.0, 0.1, -0.2, 0.3])
    desired_wrench = numbers(hand.desired_wrench(5.0, ca.DM.zeros(3), twist, R_e))
    assert desired_wrench[3:] == pytest.approx(5.0 * angle * axis - 0.5 * twist[3:])
    assert not np.any(desired_wrench[:3])


def test_it_damps_what_is_not_its_own_turning():
    hand = turning_hand([0.0, 0.0, 0.0], [40.0, 0.0, 0.0], rotational_damping=0.5)
    target = OrientationTarget(np.array([1.0, 2.0]), np.array([[0, 0, 0], [40, 0, 0]]))
    w_d = numbers(target.at(1.5)[1])
    R_e = rotation([20.0, 0.0, 0.0]).as_matrix()
    along = np.concatenate([np.zeros(3), w_d])
    desired_wrench = [
        numbers(hand.desired_wrench(1.5, ca.DM.zeros(3), twist, R_e)) for twist in (along, STILL)
    ]
    assert desired_wrench[0] == pytest.approx(STILL, abs=1e-12)
    assert desired_wrench[1][3:] == pytest.approx(0.5 * w_d)


def test_a_body_in_the_hand_turns_as_a_damped_oscillator():
    """By independent integration of the one angle there is about the common axis."""
    inertia, K_r, D_r, step = 0.05, 5.0, 0.6, 5e-4
    hand = turning_hand([0.0, 0.0, 35.0], rotational_damping=D_r, rotational_stiffness=K_r)
    R_e, w, angles = Rotation.identity(), np.zeros(3), []
    times = 2.0 + step * np.arange(2000)  # the grip is firm
    time, rate, R = ca.MX.sym("time"), ca.MX.sym("twist", 6), ca.MX.sym("R_e", 3, 3)
    wrench = hand.output_wrench(time, hand.desired_wrench(time, ca.DM.zeros(3), rate, R))
    torque = ca.Function("torque", [time, rate, R], [wrench[3:]])
    for time in times:
        angles.append(R_e.as_rotvec()[0])
        twist = np.append(np.zeros(3), w)
        w = w + step * torque(time, twist, R_e.as_matrix()).full().ravel() / inertia
        R_e = Rotation.from_rotvec(step * w) * R_e
    goal = np.deg2rad(35.0)
    solution = solve_ivp(
        lambda t, x: [x[1], (K_r * (goal - x[0]) - D_r * x[1]) / inertia],
        (0.0, times[-1] - 2.0),
        [0.0, 0.0],
        t_eval=times - 2.0,
        rtol=1e-9,
    )
    assert np.abs(solution.y[0] - angles).max() < 4e-3
    assert angles[-1] == pytest.approx(goal, abs=0.01)


def test_an_orientation_that_is_left_out_stays():
    waypoints = [HandWaypoint(0.0, np.zeros(3), [0.0, 0.0, 20.0]), HandWaypoint(1.0, np.ones(3))]
    target = HandParameters(waypoints=waypoints, rotational_stiffness=1.0).orientation()
    R_d = numbers(target.at(2.0)[0])
    assert R_d == pytest.approx(rotation([0.0, 0.0, 20.0]).as_matrix())


def test_a_hand_without_stiffness_does_not_turn():
    assert HandParameters().orientation() is None
    hand, turned = HandModel(HandParameters()), np.diag([-1.0, -1, 1])
    assert not np.any(numbers(hand.desired_wrench(0.0, ca.DM.zeros(3), STILL, turned)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rotational_stiffness": 2.0}, "allowed: 0, or zyx_deg in the first waypoint"),
        ({"rotational_stiffness": 2.0, "wander": Wander()}, "allowed: 0, or zyx_deg in the first"),
        ({"rotational_stiffness": -1.0}, "allowed: 0 to 1e"),
        (
            {"waypoints": [HandWaypoint(0.0, np.zeros(3), np.zeros(3))]},
            "allowed: positive where waypoints have zyx_deg",
        ),
    ],
)
def test_turning_that_makes_no_sense(changes, message):
    with pytest.raises(InputError, match=f"^rotational_stiffness = .*; {message}"):
        HandParameters(**changes)


@pytest.mark.parametrize("angles", [[1.0, 2.0], [0.0, 0.0, np.nan], [0.0, 0.0, 4000.0]])
def test_what_is_no_orientation(angles):
    with pytest.raises(InputError, match=r"^zyx_deg = .*; allowed: empty, or 3 finite numbers"):
        HandWaypoint(0.0, np.zeros(3), angles)


def test_orientations_come_from_a_file():
    data = {
        "waypoints": [{"time": 0.5, "position": [0, 0, 0], "zyx_deg": [10.0, 0, 0]}, {"time": 1.0}],
        "rotational_stiffness": 4.0,
    }
    parameters = load_typed(HandParameters, data, "hand.yaml")
    assert parameters.waypoints[0].zyx_deg == pytest.approx([10.0, 0.0, 0.0])
    assert parameters.waypoints[1].zyx_deg.size == 0
