"""Drives that stick, on one elastic joint with friction that is integrated here."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.block import Values
from pfsc_drake.control.law.rest_hold import RestHold, reference_rests

M, D, K, F_C = 0.0157, 0.06, 5000.0, 3.7
POLES, RATE, TICK = [-60.0, -60.0, -250.0, -350.0], 300.0, 1e-3
A = np.poly(POLES)[1:]
SETTLING = 30


def hold(**changes):
    values = {"drift": 2e-3, "shaking": 0.02, "window": 2e-4, "settling": SETTLING}
    return RestHold(np.array([F_C]), **values | {"largest_error": np.inf} | changes)


class Held:
    """A hold from tick to tick, of one joint and one output."""

    def __init__(self, rest_hold=None):
        self.sizes = (rest_hold or hold()).states(1, 1)
        states = {name: ca.SX.sym(name, size) for name, size in self.sizes.items()}
        told = {k: ca.SX.sym(k) for k in ("q_M", "motion", "error", "drive", "friction")}
        inputs = told | {"motion": reference_rests(told["motion"], None, None)}
        holds, drive, later = (rest_hold or hold()).step(Values(**states), *inputs.values())
        results = [holds, drive, *(later[name] for name in states)]
        self.function = ca.Function("hold", [*states.values(), *told.values()], results)
        self.state = [0.0] * len(states)

    def __call__(self, q_M, drive, friction=0.0, motion=0.0, error=0.0):
        results = self.function(*self.state, q_M, motion, error, drive, friction)
        self.state = results[2:]
        return bool(results[0]), float(results[1])


@pytest.mark.parametrize("stiffness", [1e7, 1e8])
def test_a_stuck_motor_makes_the_exact_law_unstable(stiffness):
    """The real part in the module docstring equals that of the polynomial's roots."""
    w = np.sqrt(K / M)
    polynomial = np.poly(POLES) + stiffness / D * np.array([0.0, 0.0, 1.0, 0.0, w**2])
    roots = np.roots(polynomial)
    swinging = roots[np.argmin(np.abs(roots - 1j * w))]
    expected = D * (A[0] * w**2 - A[2]) / (2.0 * stiffness)
    assert 0.0 < swinging.real == pytest.approx(expected, rel=0.05)
    assert w > np.sqrt(A[2] / A[0]) > 130.0


def simulate(presliding, rest_hold, duration=0.6, push=0.0):
    """Return torques and states of ticks: the joint moves at 0.1 rad/s when its reference stops."""
    held = Held(rest_hold)
    step = TICK / 40
    relaxation = 2.0 * np.sqrt(presliding * D / F_C)
    x = np.array([0.0, 0.02, 0.0, 0.02, 1.0])  # q_J, v_J, q_M, v_M, deflection of the bristles
    estimate, momentum, u = F_C, D * 0.02, 0.0
    torques, states = [], []

    def rate(x, u, t):
        q_J, v_J, q_M, v_M, s = x
        bent = min(max(s + relaxation * v_M / presliding, -1.0), 1.0)
        spring = K * (q_M - q_J)
        force = push if t > 0.4 else 0.0
        dry = (bent - s) / relaxation
        return np.array([v_J, (spring + force) / M, v_M, (u - spring - F_C * bent) / D, dry])

    for k in range(round(duration / TICK)):
        q_J, v_J, q_M, v_M, _ = x
        spring = K * (q_M - q_J)
        if k:
            momentum += TICK * (u - spring - estimate)
            estimate += RATE * TICK * (momentum - D * v_M)
        y = [q_J, v_J, spring / M, K * (v_M - v_J) / M]
        v = -sum(a * value for a, value in zip(A[::-1], y, strict=True))
        drive = D * (M / K * v + spring / M) + spring + estimate
        u = drive if rest_hold is None else held(q_M, drive, estimate, error=q_J)[1]
        for i in range(40):
            t = (k + i / 40) * TICK
            a = rate(x, u, t)
            b = rate(x + 0.5 * step * a, u, t)
            c = rate(x + 0.5 * step * b, u, t)
            x = x + step / 6.0 * (a + 2 * b + 2 * c + rate(x + step * c, u, t))
        torques.append(u)
        states.append(x)
    return np.array(torques), np.array(states)


@pytest.mark.slow(but="1e-05")
@pytest.mark.parametrize("presliding", [1e-5, 6.3e-5, 3e-4])
def test_what_sticks_rests(presliding):
    torques, states = simulate(presliding, hold())
    assert np.ptp(torques[-200:]) == 0.0
    assert np.abs(states[-200:, [1, 3]]).max() < 5e-3
    # near its reference, and friction has more to give in both directions
    assert np.abs(states[-1, 0]) < 1e-3
    assert np.abs(torques[-1] - K * (states[-200:, 2] - states[-200:, 0]).mean()) < 0.9 * F_C


@pytest.mark.slow
def test_without_a_hold_it_shakes():
    torques, states = simulate(6.3e-5, None)
    assert np.ptp(torques[-200:]) > 1.0
    assert np.abs(states[-200:, 1]).max() > 0.02


def test_torques_are_means_with_half_of_the_friction_taken_back():
    held = Held()
    for k in range(SETTLING):
        assert held(0.1 + 1e-3 * (-1) ** k, 5.0 + (-1) ** k, 2.0) == (False, 5.0 + (-1) ** k)
    # after a second mean, for the first one has nothing before it but the first position
    for k in range(SETTLING):
        holds, _ = held(0.1 + 1e-3 * (-1) ** k, 5.0 + (-1) ** k, 2.0)
    while not holds:
        holds, _ = held(0.1, 5.0, 2.0)
    ramp = [held(0.1, 9.0, 9.0)[1] for _ in range(2 * SETTLING)]
    assert ramp[0] < 5.0 and ramp[-1] == pytest.approx(4.0, abs=1e-9)
    assert np.all(np.diff(ramp) <= 1e-12)


def test_no_more_is_taken_back_than_half_of_the_coulomb_friction():
    held = Held()
    drives = [held(0.1, 50.0, -40.0)[1] for _ in range(4 * SETTLING)]
    assert drives[-1] == pytest.approx(50.0 + 0.5 * F_C)


@pytest.mark.parametrize(
    "change", [{"motion": 1e-3}, {"q_M": 0.1 + 3e-4}, {"q_M": np.nan}], ids=str
)
def test_the_law_goes_on_in_the_tick_of_a_motion(change):
    held = Held()
    for _ in range(4 * SETTLING):
        holds, _ = held(0.1, 5.0)
    assert holds
    assert held(0.1 + 1e-4, 7.0) == (True, 5.0)
    assert held(**{"q_M": 0.1, "drive": 7.0} | change) == (False, 7.0)
    # and later rests again
    again = [held(0.1, 6.0)[0] for _ in range(4 * SETTLING)]
    assert not any(again[: SETTLING - 2]) and again[-1]


def test_motors_that_get_on_and_errors_are_left_to_the_law():
    held = Held()
    assert not any(held(1.0 + 0.1 * k * TICK, 5.0)[0] for k in range(300))
    far = Held(hold(largest_error=1e-3))
    assert not any(far(0.1, 5.0, error=1.1e-3)[0] for _ in range(300))
    assert far(0.1, 5.0, error=0.9e-3)[0] is False
    assert any(far(0.1, 5.0, error=0.9e-3)[0] for _ in range(100))


def test_what_gets_away_from_the_tool_is_followed():
    held = Held(hold(largest_change=3e-4))
    for _ in range(4 * SETTLING):
        holds, _ = held(0.1, 5.0, error=1e-3)
    assert holds and held(0.1, 7.0, error=1.29e-3)[0]
    assert held(0.1, 7.0, error=1.31e-3) == (False, 7.0)


@pytest.mark.parametrize("part, bound", [(0, 1e-6), (1, 1e-4), (2, 5e-3)])
def test_references_postures_and_frames_have_to_rest(part, bound):
    for factor in (0.9, 1.1):
        motions = [ca.DM([0.0, 0.0]) for _ in range(3)]
        motions[part] = ca.DM([0.0, -factor * bound])
        assert bool(reference_rests(*motions)) is (factor < 1.0)
