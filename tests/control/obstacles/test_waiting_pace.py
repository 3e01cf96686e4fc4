"""The pace at which a motion can be stopped in the time that is left."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from pfsc_drake.control.law.timed_reference import _filter_step
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.errors import InputError

PERIOD = 1e-3


def _numbers(expression):
    return np.array(ca.DM(expression)).ravel()


def _fallen(order, bandwidth, start, ticks):
    """Own time and pace without being asked for, by the reference's own filter."""
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
def test_a_stop_is_what_the_filter_of_the_reference_makes_of_it(order):
    pace = WaitingPace(order, 25.0, 0.05)
    rows = _fallen(order, 25.0, np.array([0.3, 1.0, *np.zeros(order - 1)]), 1500)
    times = PERIOD * np.arange(len(rows))
    way, rates = pace.stop(25.0 * times)
    np.testing.assert_allclose(0.3 + way, rows[:, 0], atol=1e-11)
    np.testing.assert_allclose(rates[:, 0], rows[:, 1], atol=1e-11)
    for k in range(1, order):
        np.testing.assert_allclose(rates[:, k], rows[:, 1 + k], atol=1e-7)
    resting = np.flatnonzero(rows[:, 1] > 0.05)[-1] * PERIOD
    assert pace.time_to_stop == pytest.approx(resting, abs=2 * PERIOD)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_rest_is_where_the_motion_stops_and_moves_as_is_asked_for(order):
    rng = np.random.default_rng(order)
    pace, step = WaitingPace(order, 25.0, 0.05), _filter_step(order, 25.0, PERIOD)
    lags = rng.normal(size=order)
    x = np.append(0.0, _rates(lags, 25.0))
    np.testing.assert_allclose(_numbers(ca.vertcat(*pace.lags(list(x[1:])))), lags, atol=1e-12)
    rest = float(ca.DM(pace.rest(x[0], list(lags))))
    assert rest == pytest.approx(_fallen(order, 25.0, x, 4000)[-1, 0], abs=1e-9)
    for asked in (0.0, 0.4, 1.0):
        after = step @ np.append(x, asked)
        moved = float(ca.DM(pace.rest(after[0], pace.lags(list(after[1:]))))) - rest
        assert moved == pytest.approx(asked * PERIOD, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_permitted_pace_is_the_largest_that_lags_may_be_filled_to(order):
    """Lags at least as full as these, filled up to it, empty to rest just in time."""
    rng, omega, resting = np.random.default_rng(order), 25.0, 0.05
    pace, seen = WaitingPace(order, omega, resting), []
    for _ in range(60):
        lags, ticks = rng.uniform(0.0, rng.choice([0.05, 0.3]), size=order), rng.integers(1, 400)
        fill = np.maximum.accumulate(lags[::-1])[::-1]
        permitted = float(ca.DM(pace.permitted(PERIOD * ticks, list(lags))))
        seen.append(permitted)

        def left(level, fill=fill, ticks=ticks):
            start = np.append(0.0, _rates(np.maximum(fill, level), omega))
            return _fallen(order, omega, start, ticks)[-1, 1]

        if permitted == 0.0:
            assert left(0.0) >= resting * (1.0 - 1e-9)
        elif permitted == 1.0:
            assert left(1.0) <= resting * (1.0 + 1e-9)
        else:
            assert left(permitted) == pytest.approx(resting, rel=1e-9)
    assert {0.0, 1.0} < set(seen)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_place_is_passed_faster_than_rest_when_its_time_is_used_up(order, sign):
    """Places with times that fall as fast as they may, or are wrong to the safe side, at random."""
    rng, omega, resting = np.random.default_rng(order), 25.0, 0.05
    pace, step = WaitingPace(order, omega, resting), _filter_step(order, omega, PERIOD)
    b, z = ca.SX.sym("b"), ca.SX.sym("z", order)
    permitted = ca.Function("permitted", [b, z], [pace.permitted(b, ca.vertsplit(z))])
    x, worst = np.zeros(order + 1), 0.0
    places = np.arange(0.0, 4.0, 0.01)
    times = np.repeat(rng.uniform(0.0, 1.2, size=20), 20)
    for _ in range(4000):
        lags = _numbers(ca.vertcat(*pace.lags(list(x[1:]))))
        rest = sign * x[0] + sign * lags.sum() / omega
        between = (places >= sign * x[0] - 0.01) & (places <= rest + 0.01)
        told = times[between] - PERIOD - rng.choice([0.0, 0.05], p=[0.9, 0.1])
        w = float(permitted(told.min(initial=9.0), lags))
        x = step @ np.append(x, sign * w * (rng.random() < 0.98))
        times -= PERIOD
        at = np.abs(places - sign * x[0]) <= 0.01
        if np.any(times[at] <= 0.0):
            worst = max(worst, abs(x[1]))
        # who was in the way leaves
        times[times < -0.1] = rng.uniform(0.02, 1.2)
    assert 0.2 * resting < worst <= resting * (1.0 + 1e-6)
    assert abs(x[0]) > 0.1


def test_the_permitted_pace_grows_from_nothing_to_all():
    pace, still = WaitingPace(4, 25.0, 0.05), [0.0] * 4
    assert _numbers(pace.permitted(ca.DM(-1e-9), still)) == 0.0
    assert _numbers(pace.permitted(ca.DM(1e-9), still)) == pytest.approx(0.05, rel=1e-6)
    assert _numbers(pace.permitted(ca.DM(pace.time_to_stop), still)) == pytest.approx(1.0)
    assert _numbers(pace.permitted(ca.DM(1e9), [1.0] * 4)) == 1.0
    assert _numbers(pace.permitted(ca.DM.nan(), still)) == 0.0
    values = [float(pace.permitted(ca.DM(b), still)) for b in np.linspace(0.01, 1.0, 50)]
    assert np.all(np.diff(values) >= 0.0)


def test_the_rates_of_a_stop_are_derivatives_of_its_way():
    x = np.linspace(0.0, 12.0, 6001)
    way, rates = WaitingPace(4, 25.0, 0.05).stop(x)
    for lower, upper in zip([way, *rates.T[:3]], rates.T, strict=True):
        integral = cumulative_simpson(upper, x=x / 25.0, initial=0.0)
        np.testing.assert_allclose(
            lower - lower[0], integral, atol=1e-8 * np.abs(lower).max() + 1e-9
        )


@pytest.mark.parametrize(("bandwidth", "resting"), [(0.0, 0.05), (25.0, 0.0), (25.0, 1.0)])
def test_what_is_no_pace_is_refused(bandwidth, resting):
    with pytest.raises(InputError, match=r"bandwidth|resting"):
        WaitingPace(4, bandwidth, resting)
