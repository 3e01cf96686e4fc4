"""The friction Kalman filter, against matrices and against motions of known friction."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.friction_filter import FrictionKalmanFilter, FrictionNoise
from pfsc_drake.control.estimation.momentum import MomentumModel, drive_momentum
from pfsc_drake.errors import InputError

PERIOD, COUNT = 4e-3, 400
F_C, F_V = np.array([12.0, 5.0]), np.array([6.0, 9.0])
MASS, SPEED = np.array([3.0, 0.8]), np.array([1.3, 0.9])
RATE, PHASE = np.array([9.0, 14.0]), np.array([0.4, 1.9])


def noise(size, scale=1.0):
    return FrictionNoise(
        *(scale * x * np.linspace(1.0, 2.0, size) for x in (1e-4, 1e-4, 1e-4, 1e-2)), 1e3
    )


def masses(delay=0.0, stiffness=0.0):
    """Return two masses on rails; nothing acts but drives, friction and springs [N/m]."""
    state = ca.SX.sym("state", 8)
    springs = -stiffness * state[:2] if stiffness else ca.SX(2, 1)
    model = MomentumModel(state, MASS * state[6:], springs, np.ones(2), np.zeros(2), -1.0)
    return model.with_delay(delay)


def swing(count=3 * COUNT):
    """Return states and mean drive torques of masses that swing, from closed forms."""
    t = PERIOD * np.arange(count + 1)[:, None]
    q = -SPEED / RATE * np.cos(RATE * t + PHASE)
    v = SPEED * np.sin(RATE * t + PHASE)

    def sign_time(axis, k):
        turns = (np.pi * np.arange(0, 30) - PHASE[axis]) / RATE[axis]
        inside = [x for x in turns if t[k, 0] < x < t[k + 1, 0]]
        value, _ = quad(
            lambda x: np.sign(np.sin(RATE[axis] * x + PHASE[axis])),
            t[k, 0],
            t[k + 1, 0],
            points=inside or None,
        )
        return value

    signs = np.array([[sign_time(axis, k) for axis in range(2)] for k in range(count)])
    lost = (F_C * signs + F_V * np.diff(q, axis=0)) / PERIOD
    drives = MASS * np.diff(v, axis=0) / PERIOD + lost
    return np.hstack([q, v, q, v]), drives


def estimate(kalman, states, drives, velocity=None):
    """Return the estimates at all samples, shape (samples, 3N)."""
    inputs = {} if velocity is None else {"velocity": velocity}
    stepper = Stepper(kalman, tuple(inputs))
    return np.array(
        [
            stepper.step(joint_state=state, drive_torque=drive, **inputs)["estimate"]
            for state, drive in zip(states, [*drives, drives[-1]], strict=True)
        ]
    )


def test_is_the_filter_of_the_appendix(drake_arm):
    """(A.5) with its matrices for all axes, on a motion of Drake's arm."""
    arm, n = drake_arm("rigid"), 3
    drives = np.array([150.0, -250.0, 90.0]) * np.sin(0.3 * np.arange(40)[:, None] + [0, 1, 2])
    friction = np.array([20.0, -30.0, 8.0])
    states = arm.move(drives, lambda _: friction, lambda _: np.zeros(3), PERIOD)
    model, covariance = drive_momentum(arm.chain), noise(n, 7.0)
    start = np.array([[30.0, 60.0, 15.0], [10.0, 80.0, 20.0]])
    kalman = FrictionKalmanFilter(model, start, covariance, PERIOD, intervals="begin")
    ours = estimate(kalman, states, drives)[:, n:]

    function, eye, zero = model.function, np.eye(n), np.zeros((n, n))
    Q = np.diag(np.concatenate([covariance.momentum, covariance.coulomb, covariance.viscous]))
    R, C = np.diag(covariance.measurement), np.hstack([eye, zero, zero])
    p, f = (np.array(x).ravel() for x in function(states[0]))
    x = np.concatenate([p, start.ravel()])
    P = np.diag(np.concatenate([covariance.measurement, np.full(2 * n, 1e3)]))
    for k, state in enumerate(states[1:]):
        v = states[k][3:6]
        Phi = np.block(
            [
                [eye, -PERIOD * np.diag(np.sign(v)), -PERIOD * np.diag(v)],
                [np.zeros((2 * n, n)), np.eye(2 * n)],
            ]
        )
        x = Phi @ x + np.concatenate([PERIOD * (drives[k] + f), np.zeros(2 * n)])
        P = Phi @ P @ Phi.T + Q
        p, f = (np.array(x).ravel() for x in function(state))
        K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
        x, P = x + K @ (p - C @ x), (np.eye(3 * n) - K @ C) @ P
        np.testing.assert_allclose(ours[k + 1], x[n:], rtol=1e-7, atol=1e-7)
    assert np.abs(ours[-1] - start.ravel()).min() > 1e-3


def test_means_find_what_beginnings_miss():
    """Both coefficients of both axes; held over the interval, velocities leave them off."""
    states, drives = swing()
    ends = {}
    for intervals in ("mean", "begin"):
        kalman = FrictionKalmanFilter(
            masses(), 0.7 * np.array([F_C, F_V]), noise(2), PERIOD, intervals=intervals
        )
        ends[intervals] = estimate(kalman, states, drives)[-1, 2:]
    off = {k: np.abs(x / np.concatenate([F_C, F_V]) - 1.0) for k, x in ends.items()}
    assert off["mean"].max() < 1e-3
    assert off["begin"].max() > 10.0 * off["mean"].max()


def test_forces_of_both_ends_of_an_interval_count():
    """Springs of 200 N/m, over the mean deflection of an interval from its closed form."""
    states, drives = swing()
    angle = RATE * PERIOD * np.arange(len(states))[:, None] + PHASE
    deflection = np.diff(-SPEED / RATE**2 * np.sin(angle), axis=0) / PERIOD
    kalman = FrictionKalmanFilter(
        masses(stiffness=200.0), 0.7 * np.array([F_C, F_V]), noise(2), PERIOD, intervals="mean"
    )
    found = estimate(kalman, states, drives + 200.0 * deflection)[-1, 2:]
    np.testing.assert_allclose(found, np.concatenate([F_C, F_V]), rtol=2e-3)


def test_velocities_that_are_half_an_interval_old():
    """Difference quotients, as they come; a filter that takes them for new ones is off."""
    states, drives = swing()
    q = states[:, :2]
    v = np.vstack([states[0, 2:4], np.diff(q, axis=0) / PERIOD])
    measured = np.hstack([q, v, q, v])
    truth, off = np.concatenate([F_C, F_V]), []
    for delay in (PERIOD / 2.0, 0.0):
        kalman = FrictionKalmanFilter(
            masses(delay), 0.7 * np.array([F_C, F_V]), noise(2), PERIOD, resting_velocity=0.01
        )
        found = estimate(kalman, measured, drives)[-1, 2:]
        off.append(np.abs(found / truth - 1.0).max())
    assert off[0] < 3e-3
    assert off[1] > 3.0 * off[0]


def test_the_torque_is_that_of_the_coefficients():
    states, drives = swing(50)
    kalman = FrictionKalmanFilter(masses(), np.array([F_C, F_V]), noise(2), PERIOD, smoothing=0.1)
    result = estimate(kalman, states, drives)[-1]
    f_c, f_v, v = result[2:4], result[4:], states[-1, 6:]
    np.testing.assert_allclose(result[:2], f_c * np.tanh(v / 0.1) + f_v * v, rtol=1e-12)
    velocities = np.array([0.05, -0.2])
    result = estimate(kalman, states, drives, velocities)[-1]
    np.testing.assert_allclose(
        result[:2], f_c * np.tanh(velocities / 0.1) + f_v * velocities, rtol=1e-12
    )


def test_a_drive_that_sticks_teaches_nothing():
    """For any command; the axis beside it is updated."""
    states, drives = swing()
    states[:, [0, 4]], states[:, [2, 6]] = 0.3, 1e-4
    drives[:, 0] = 8.0
    start = 0.7 * np.array([F_C, F_V])
    kalman = FrictionKalmanFilter(masses(), start, noise(2), PERIOD, resting_velocity=1e-3)
    found = estimate(kalman, states, drives)[-1, 2:].reshape(2, 2)
    assert np.array_equal(found[:, 0], start[:, 0])
    np.testing.assert_allclose(found[:, 1], [F_C[1], F_V[1]], rtol=2e-3)


def test_a_lost_sample_costs_no_more_than_its_interval():
    states, drives = swing()
    states[300, 7] = np.nan
    start = 0.7 * np.array([F_C, F_V])
    estimates = estimate(FrictionKalmanFilter(masses(), start, noise(2), PERIOD), states, drives)
    assert np.isnan(estimates[300]).any()
    assert np.array_equal(estimates[301, 2:], estimates[299, 2:])
    np.testing.assert_allclose(estimates[-1, 2:], np.concatenate([F_C, F_V]), rtol=2e-3)


def test_known_torques_are_taken_off(drake_arm):
    """Known additional torques do not change the estimate."""
    arm, push = drake_arm("rigid"), np.array([25.0, -40.0, 15.0])
    drives = np.array([150.0, -250.0, 90.0]) * np.sin(0.3 * np.arange(40)[:, None] + [0, 1, 2])
    model = drive_momentum(arm.chain)
    states = arm.move(drives, lambda _: np.zeros(3), lambda _: np.zeros(3), PERIOD)

    def ends(drives, **known):
        stepper = Stepper(FrictionKalmanFilter(model, np.ones((2, 3)), noise(3), PERIOD), known)
        for state, drive in zip(states, drives, strict=False):
            out = stepper.step(joint_state=state, drive_torque=drive, **known)
        assert np.array_equal(out["friction_torque"], out["estimate"][:3])
        return out["estimate"]

    np.testing.assert_allclose(ends(drives - push, known_torque=push), ends(drives), rtol=1e-9)


def make(start=((1.0, 1.0), (1.0, 1.0)), **options):
    return FrictionKalmanFilter(
        masses(), np.array(start), options.pop("noise", noise(2)), PERIOD, **options
    )


@pytest.mark.parametrize(
    ("wrong", "part"),
    [
        (lambda: make(start=(1.0, 1.0)), "first estimates of friction"),
        (lambda: make(noise=noise(3)), "noise: of 3 joints; the robot has 2"),
        (lambda: make(intervals="end"), "intervals = 'end'"),
        (lambda: make(resting_velocity=np.nan), "resting_velocity = nan"),
        (lambda: make(smoothing=0.0), "smoothing = 0"),
        (lambda: FrictionNoise([1.0], [1.0], [1.0], [0.0], 1.0), r"measurement = \[0.0\]"),
        (lambda: FrictionNoise([1.0], [1.0, 2.0], [1.0], [1.0], 1.0), "coulomb of shape"),
        (lambda: FrictionNoise([1.0], [1.0], [1.0], [1.0], -1.0), "initial = -1"),
    ],
)
def test_refused(wrong, part):
    with pytest.raises(InputError, match=part):
        wrong()
