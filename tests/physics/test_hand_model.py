"""The hand's target, force, limits, tremor and view of the tool."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import (
    HandModel,
    HandParameters,
    HandWaypoint,
    observed_twist,
)
from pfsc_drake.yaml.typed import load_typed

WAY = [
    HandWaypoint(1.0, [0.0, 0.0, 0.0]),
    HandWaypoint(3.0, [0.4, 0.0, 0.0]),
    HandWaypoint(4.0, [0.4, -0.2, 0.1]),
]


def numbers(expression):
    """Return what an expression without symbols is, a vector or a matrix."""
    return ca.evalf(ca.MX(expression)).full().squeeze()


def hand(**changes):
    return HandModel(HandParameters(**{"waypoints": WAY, **changes}))


def over_time(method, times):
    """Return results of a method of time, each (samples, size)."""
    time = ca.MX.sym("time")
    found = method(time)
    results = found if isinstance(found, tuple) else (found,)
    values = ca.Function("f", [time], list(results)).call([np.reshape(times, (1, -1))])
    return [value.full().T for value in values]


def test_the_target_rests_at_every_waypoint():
    model = hand()
    for time, position in ((0.0, [0, 0, 0]), (1.0, [0, 0, 0]), (3.0, [0.4, 0, 0])):
        p_d, v_d = map(numbers, model.target(time))
        assert p_d == pytest.approx(position)
        assert v_d == pytest.approx(np.zeros(3))
    p_d, v_d = map(numbers, model.target(99.0))
    assert p_d == pytest.approx([0.4, -0.2, 0.1])
    assert not np.any(v_d)


def test_the_target_has_the_profile_of_minimum_jerk():
    """Peak velocity 1.875 distance / time and peak acceleration 5.774 distance / time^2."""
    model = hand()
    time = np.linspace(1.0, 3.0, 20001)
    p, v = (values[:, 0] for values in over_time(model.target, time))
    h = time[1] - time[0]
    assert np.allclose((p[2:] - p[:-2]) / (2 * h), v[1:-1], rtol=0, atol=1e-6)
    assert v.max() == pytest.approx(1.875 * 0.4 / 2.0, rel=1e-9)
    assert np.gradient(v, h).max() == pytest.approx(5.7735 * 0.4 / 4.0, rel=1e-3)
    # the sixth derivative of a motion of minimum jerk vanishes: a polynomial of degree 5
    fit = np.polynomial.Polynomial.fit(time, p, 5)
    assert np.max(np.abs(fit(time) - p)) < 1e-12


def test_it_pulls_like_a_spring_and_a_damper():
    model = hand(stiffness=200.0, damping=20.0, rotational_damping=0.5)
    twist = np.array([0.1, 0.0, -0.2, 1.0, 2.0, -3.0])
    desired_wrench = numbers(model.desired_wrench(0.0, np.array([0.05, -0.02, 0.0]), twist))
    assert desired_wrench == pytest.approx([-10 - 2, 4, 4, -0.5, -1.0, 1.5])
    # at full grip, within the limits
    assert numbers(model.output_wrench(2.0, desired_wrench)) == pytest.approx(desired_wrench)


def test_force_and_torque_have_limits():
    model = hand(force_limit=30.0, torque_limit=2.0, tremor=5.0)
    random = np.random.default_rng(0)
    for time in np.linspace(0.0, 6.0, 200):
        desired_wrench = random.normal(scale=50.0, size=6)
        delivered = numbers(model.output_wrench(time, desired_wrench))
        assert np.linalg.norm(delivered[:3]) <= 30.0 * (1.0 + 1e-12)
        assert np.linalg.norm(delivered[3:]) <= 2.0 * (1.0 + 1e-12)
    large = np.array([300.0, 400.0, 0.0, 0.0, 0.0, -9.0])
    delivered = numbers(hand(force_limit=30.0, torque_limit=2.0).output_wrench(2.0, large))
    assert delivered == pytest.approx([18.0, 24.0, 0.0, 0.0, 0.0, -2.0])


def test_it_takes_hold_and_lets_go():
    model = hand(grip_ramp=0.2, release=5.0)
    (grip,) = over_time(model.grip, [0.9, 1.0, 1.1, 1.2, 5.0, 5.1, 5.2, 9.0])
    assert grip.ravel() == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0])
    assert not np.any(numbers(model.output_wrench(9.0, np.full(6, 3.0))))


def test_tremor_lies_in_its_band_with_its_strength():
    model, rate, duration = hand(tremor=0.7, seed=2), 1000.0, 64.0
    time = np.arange(0.0, duration, 1.0 / rate)
    (force,) = over_time(model.tremor, time)
    assert force.std(axis=0) == pytest.approx(np.full(3, 0.7), rel=0.1)
    power = np.abs(np.fft.rfft(force * np.hanning(len(time))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(time), 1.0 / rate)
    inside = (frequency > 7.9) & (frequency < 12.1)
    assert np.all(power[inside].sum(axis=0) > 0.9999 * power.sum(axis=0))
    # spread over the band, not one line
    for low in (8.0, 9.0, 10.0, 11.0):
        part = (frequency >= low) & (frequency < low + 1.0)
        assert np.all(power[part].sum(axis=0) > 0.1 * power.sum(axis=0))
    assert np.max(np.abs(np.corrcoef(force.T) - np.eye(3))) < 0.15


def test_tremor_is_the_seeds():
    times = np.linspace(0.0, 1.0, 7)
    first, again, other = (
        over_time(hand(tremor=1.0, seed=seed).tremor, times)[0] for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert np.max(np.abs(first - other)) > 0.1


def test_observed_twist_is_that_of_a_screw():
    w, v, period = np.array([0.5, -1.0, 2.0]), np.array([0.1, 0.2, -0.3]), 1e-3
    R_0 = Rotation.from_euler("ZYX", [0.3, 0.4, 0.5])
    R_1 = Rotation.from_rotvec(w * period) * R_0
    before = np.concatenate([[1.0, 2.0, 3.0], R_0.as_matrix().ravel()])
    now = np.concatenate([[1.0, 2.0, 3.0] + v * period, R_1.as_matrix().ravel()])
    twist = numbers(observed_twist(before, now, period))
    assert twist == pytest.approx(np.append(v, w), abs=1e-5)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("stiffness", 0.0),
        ("damping", -1.0),
        ("force_limit", np.inf),
        ("torque_limit", 0.0),
        ("reaction_delay", -0.1),
        ("tremor", np.nan),
        ("tremor_band", np.array([12.0, 8.0])),
        ("tremor_band", np.array([8.0])),
        ("grip_ramp", 0.0),
        ("release", 0.5),
        ("waypoints", []),
        ("waypoints", [WAY[1], WAY[0]]),
    ],
)
def test_parameters_out_of_range(key, value):
    with pytest.raises(InputError, match=f"^{key} = .*; allowed: "):
        HandParameters(**{"waypoints": WAY, key: value})


def test_parameters_come_from_a_file():
    data = {
        "waypoints": [{"time": 0.5, "position": [0.1, 0.2, 0.3]}],
        "release": float("inf"),
        "tremor_band": [9.0, 11.0],
    }
    parameters = load_typed(HandParameters, data, "hand.yaml")
    assert parameters.waypoints[0].position == pytest.approx([0.1, 0.2, 0.3])
    assert parameters.stiffness == HandParameters().stiffness


def test_a_waypoint_has_three_coordinates():
    with pytest.raises(InputError, match=r"^position = \[1.0, 2.0\]; allowed: 3 finite numbers"):
        HandWaypoint(0.0, [1.0, 2.0])
