"""The pace at which a motion can be stopped in the time that is left."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.optimize import linprog

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


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_pace_falls_as_the_filter_of_the_reference_lets_it(order):
    pace = WaitingPace(order, 25.0, 0.05)
    rows = _fallen(order, 25.0, np.array([0.3, 1.0, *np.zeros(order - 1)]), 1500)
    times = PERIOD * np.arange(len(rows))
    np.testing.assert_allclose(_numbers(pace.left(times)), rows[:, 1], atol=1e-11)
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
    x = np.append(0.0, rng.normal(size=order) * 25.0 ** np.arange(order))
    rest = float(ca.DM(pace.rest(x[0], list(x[1:]))))
    assert rest == pytest.approx(_fallen(order, 25.0, x, 4000)[-1, 0], abs=1e-9)
    for asked in (0.0, 0.4, 1.0):
        after = step @ np.append(x, asked)
        moved = float(ca.DM(pace.rest(after[0], list(after[1:])))) - rest
        assert moved == pytest.approx(asked * PERIOD, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_no_history_is_faster_than_rest_where_time_is_used_up(order):
    """A linear program picks the worst of all histories that the rule permits."""
    resting, omega, ticks = 0.05, 25.0, 600
    pace, step = WaitingPace(order, omega, resting), _filter_step(order, omega, PERIOD)
    respond, column = [], step[:, -1]
    for _ in range(ticks):
        respond.append(column)
        column = step[:, :-1] @ column
    # the newest tick is the last; before the first one w = 1
    history = np.array(respond[::-1])
    start = np.linalg.matrix_power(step[:, :-1], ticks) @ np.array([0.0, 1.0, *np.zeros(order - 1)])
    permitted = [float(ca.DM(pace.permitted(PERIOD * k))) for k in range(ticks)][::-1]
    worst = 0.0
    for entered in range(0, ticks, 12):
        bound = np.ones(ticks)
        bound[-entered - 1 :] = permitted[-entered - 1 :]
        # s is at the place where rest was when it entered
        s, rest = history[:, 0], np.where(np.arange(ticks) < ticks - entered, PERIOD, 0.0)
        place = order / omega - start[0]
        found = linprog(
            -history[:, 1],
            A_eq=[(s - rest)],
            b_eq=[place],
            bounds=list(zip(np.zeros(ticks), bound, strict=True)),
        )
        if found.status == 0:
            worst = max(worst, start[1] - found.fun)
    assert 0.2 * resting < worst <= resting * (1.0 + 1e-6)


def test_the_permitted_pace_grows_from_nothing_to_all():
    pace = WaitingPace(4, 25.0, 0.05)
    assert _numbers(pace.permitted(ca.DM(-1e-9))) == 0.0
    assert _numbers(pace.permitted(ca.DM(1e-9))) == pytest.approx(pace.trickle, rel=1e-6)
    assert _numbers(pace.permitted(ca.DM(pace.time_unhindered))) == pytest.approx(1.0, rel=1e-6)
    assert _numbers(pace.permitted(ca.DM(1e9))) == 1.0
    assert _numbers(pace.permitted(ca.DM.nan())) == 0.0
    values = [float(pace.permitted(ca.DM(b))) for b in np.linspace(0.01, 1.0, 50)]
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
