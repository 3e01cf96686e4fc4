"""Speed scaling that can be stopped within the time that is left."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from pfsc_drake.control.law.timed_reference import _filter_step
from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
from pfsc_drake.errors import InputError

PERIOD = 1e-3


def _numbers(expression):
    return np.array(ca.DM(expression)).ravel()


def _decay(order, bandwidth, start, ticks):
    """Motion time and scaling with a request of 0, by the filter of the reference."""
    step = _filter_step(order, bandwidth, PERIOD)
    rows = [start]
    for _ in range(ticks):
        rows.append(step @ np.append(rows[-1], 0.0))
    return np.array(rows)


def _rates(lags, omega):
    """Derivatives of ``z_1`` by the lags' own equations: z_k' = omega (z_{k+1} - z_k)."""
    rows = [np.array(lags)]
    while rows[-1].size > 1:
        rows.append(omega * np.diff(rows[-1]))
    return [row[0] for row in rows]


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_stop_equals_the_response_of_the_reference_filter(order):
    scaling = StoppableScaling(order, 25.0, 0.05)
    rows = _decay(order, 25.0, np.array([0.3, 1.0, *np.zeros(order - 1)]), 1500)
    times = PERIOD * np.arange(len(rows))
    travel, rates = scaling.stop(25.0 * times)
    np.testing.assert_allclose(0.3 + travel, rows[:, 0], atol=1e-11)
    np.testing.assert_allclose(rates[:, 0], rows[:, 1], atol=1e-11)
    for k in range(1, order):
        np.testing.assert_allclose(rates[:, k], rows[:, 1 + k], atol=1e-7)
    resting = np.flatnonzero(rows[:, 1] > 0.05)[-1] * PERIOD
    assert scaling.time_to_stop == pytest.approx(resting, abs=2 * PERIOD)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_rest_is_the_stopping_point_and_moves_at_the_requested_scaling(order):
    rng = np.random.default_rng(order)
    scaling, step = StoppableScaling(order, 25.0, 0.05), _filter_step(order, 25.0, PERIOD)
    lags = rng.normal(size=order)
    x = np.append(0.0, _rates(lags, 25.0))
    np.testing.assert_allclose(_numbers(ca.vertcat(*scaling.lags(list(x[1:])))), lags, atol=1e-12)
    rest = float(ca.DM(scaling.rest(x[0], list(lags))))
    assert rest == pytest.approx(_decay(order, 25.0, x, 4000)[-1, 0], abs=1e-9)
    for requested in (0.0, 0.4, 1.0):
        after = step @ np.append(x, requested)
        moved = float(ca.DM(scaling.rest(after[0], scaling.lags(list(after[1:]))))) - rest
        assert moved == pytest.approx(requested * PERIOD, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_permitted_scaling_is_the_largest_level_of_the_lags(order):
    """Lags filled up to this level decay to rest exactly in time."""
    rng, omega, resting = np.random.default_rng(order), 25.0, 0.05
    scaling, values = StoppableScaling(order, omega, resting), []
    for _ in range(60):
        lags, ticks = rng.uniform(0.0, rng.choice([0.05, 0.3]), size=order), rng.integers(1, 400)
        fill = np.maximum.accumulate(lags[::-1])[::-1]
        permitted = float(ca.DM(scaling.largest_request(PERIOD * ticks, list(lags))))
        values.append(permitted)

        def left(level, fill=fill, ticks=ticks):
            start = np.append(0.0, _rates(np.maximum(fill, level), omega))
            return _decay(order, omega, start, ticks)[-1, 1]

        if permitted == 0.0:
            assert left(0.0) >= resting * (1.0 - 1e-9)
        elif permitted == 1.0:
            assert left(1.0) <= resting * (1.0 + 1e-9)
        else:
            assert left(permitted) == pytest.approx(resting, rel=1e-9)
    assert {0.0, 1.0} < set(values)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_point_is_passed_faster_than_rest_after_its_time(order, sign):
    """Points whose times decrease as fast as allowed, or err to the safe side, at random."""
    rng, omega, resting = np.random.default_rng(order), 25.0, 0.05
    scaling, step = StoppableScaling(order, omega, resting), _filter_step(order, omega, PERIOD)
    b, z = ca.SX.sym("b"), ca.SX.sym("z", order)
    permitted = ca.Function("permitted", [b, z], [scaling.largest_request(b, ca.vertsplit(z))])
    x, worst = np.zeros(order + 1), 0.0
    points = np.arange(0.0, 4.0, 0.01)
    times = np.repeat(rng.uniform(0.0, 1.2, size=20), 20)
    for _ in range(4000):
        lags = _numbers(ca.vertcat(*scaling.lags(list(x[1:]))))
        rest = sign * x[0] + sign * lags.sum() / omega
        between = (points >= sign * x[0] - 0.01) & (points <= rest + 0.01)
        reported = times[between] - PERIOD - rng.choice([0.0, 0.05], p=[0.9, 0.1])
        w = float(permitted(reported.min(initial=9.0), lags))
        x = step @ np.append(x, sign * w * (rng.random() < 0.98))
        times -= PERIOD
        at = np.abs(points - sign * x[0]) <= 0.01
        if np.any(times[at] <= 0.0):
            worst = max(worst, abs(x[1]))
        # the obstacle leaves
        times[times < -0.1] = rng.uniform(0.02, 1.2)
    assert 0.2 * resting < worst <= resting * (1.0 + 1e-6)
    assert abs(x[0]) > 0.1


def test_permitted_scaling_increases_from_zero_to_one():
    scaling, still = StoppableScaling(4, 25.0, 0.05), [0.0] * 4
    assert _numbers(scaling.largest_request(ca.DM(-1e-9), still)) == 0.0
    assert _numbers(scaling.largest_request(ca.DM(1e-9), still)) == pytest.approx(0.05, rel=1e-6)
    assert _numbers(scaling.largest_request(ca.DM(scaling.time_to_stop), still)) == pytest.approx(
        1.0
    )
    assert _numbers(scaling.largest_request(ca.DM(1e9), [1.0] * 4)) == 1.0
    assert _numbers(scaling.largest_request(ca.DM.nan(), still)) == 0.0
    values = [float(scaling.largest_request(ca.DM(b), still)) for b in np.linspace(0.01, 1.0, 50)]
    assert np.all(np.diff(values) >= 0.0)


def test_the_rates_of_a_stop_are_derivatives_of_its_travel():
    x = np.linspace(0.0, 12.0, 6001)
    travel, rates = StoppableScaling(4, 25.0, 0.05).stop(x)
    for lower, upper in zip([travel, *rates.T[:3]], rates.T, strict=True):
        integral = cumulative_simpson(upper, x=x / 25.0, initial=0.0)
        np.testing.assert_allclose(
            lower - lower[0], integral, atol=1e-8 * np.abs(lower).max() + 1e-9
        )


@pytest.mark.parametrize(("bandwidth", "resting"), [(0.0, 0.05), (25.0, 0.0), (25.0, 1.0)])
def test_wrong_parameters_are_rejected(bandwidth, resting):
    with pytest.raises(InputError, match=r"bandwidth|resting"):
        StoppableScaling(4, bandwidth, resting)
