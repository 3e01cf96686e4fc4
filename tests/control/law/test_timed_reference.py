"""The reference over time, as planned and with a speed scaling."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.reference import rest_to_rest, together
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.errors import InputError

PERIOD = 1e-3


@pytest.fixture(name="motion")
def fixture_motion():
    return rest_to_rest([0.3, 1.3], velocity=0.5, acceleration=2.0, dwell=0.2)


def at(motion, time, r, m, **changes):
    """Return the reference at a time, by rows."""
    stepper = Stepper(TimedReference(motion, r, m, PERIOD, **changes))
    stepper.tick = round(time / PERIOD)
    return stepper.step()["reference"].reshape(r + 1, m)


@pytest.mark.parametrize("r", [1, 2, 4])
@pytest.mark.parametrize("m", [3, 6])
def test_rows_hold_the_derivatives_of_eta_alone(motion, r, m):
    for time in (0.0, 0.35, 0.9, 2.0):
        rows = at(motion, time, r, m)
        assert np.allclose(rows[:, 0], motion.derivatives(time, r)[:, 0], rtol=1e-12, atol=1e-12)
        assert not np.any(rows[:, 1:])


def test_several_coordinates_move_each_on_its_own():
    motion = together(([0.0, 1.0], 0.5, 2.0, 0.1), ([2.0, 1.0], 0.3, 1.0, 0.2))
    rows = at(motion, 1.2, 3, 6)
    np.testing.assert_allclose(rows[:, :2], motion.derivatives(1.2, 3), rtol=1e-11, atol=1e-11)


def test_it_rests_before_and_after(motion):
    for time, eta in ((-1.0, 0.3), (motion.domain[1] + 5.0, 1.3)):
        rows = at(motion, time, 4, 3)
        assert rows[0] == pytest.approx([eta, 0.0, 0.0], abs=1e-13)
        assert not np.any(rows[1:])


def test_a_motion_that_does_not_end_at_rest_stops():
    """Beyond its end the velocity is not carried on."""
    ramp = rest_to_rest([0.0, 1.0], velocity=0.5, acceleration=2.0)
    cut = type(ramp)(ramp.breakpoints[:2], ramp.coefficients[:1])
    end = PERIOD * np.floor(cut.domain[1] / PERIOD)
    assert at(cut, end, 2, 3)[1, 0] == pytest.approx(0.5, rel=1e-3)
    assert not np.any(at(cut, end + PERIOD, 2, 3)[1:])


def paced(motion, r, override, seconds):
    """Return times and rows of the reference under an override, a function of time."""
    stepper = Stepper(TimedReference(motion, r, 3, PERIOD), ("override",))
    times = PERIOD * np.arange(round(seconds / PERIOD))
    rows = [stepper.step(override=override(time))["reference"].reshape(r + 1, 3) for time in times]
    return times, np.array(rows)


def test_an_override_of_one_is_the_plan(motion):
    times, rows = paced(motion, 4, lambda t: 1.0, 2.0)
    expected = motion.derivatives(times, 4)[..., 0]
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(rows[:, :, 0] / scale, expected / scale, rtol=0, atol=1e-9)


def test_pace_follows_the_filter_integrated_by_another_method(motion):
    """``(d/dt / b + 1)^3 z = w`` with w = 0.5 from an initial scaling of 1.4 on."""
    times, rows = paced(motion, 3, lambda t: 1.4 if t < PERIOD / 2.0 else 0.5, 1.5)
    b = 20.0

    def rate(t, x):
        w = 1.4 if t < PERIOD else 0.5
        return [x[1], x[2], x[3], b**3 * (w - x[1]) - 3 * b**2 * x[2] - 3 * b * x[3]]

    way = solve_ivp(rate, (0, 1.5), [0, 1.4, 0, 0], t_eval=times, rtol=1e-11, atol=1e-12)
    expected = motion.derivatives(way.y[0], 0)[:, 0, 0]
    np.testing.assert_allclose(rows[:, 0, 0], expected, rtol=0, atol=1e-9)


def test_all_derivatives_are_continuous_however_the_override_jumps(motion):
    """Each row's difference quotient is the row below, at every tick."""
    rng = np.random.default_rng(3)
    values = rng.uniform(-3.0, 3.0, 40)
    values[0] = 1.0
    _, rows = paced(motion, 4, lambda t: values[int(t / 0.1)], 3.9)
    eta = rows[:, :, 0]
    for k in range(4):
        quotient = (eta[2:, k] - eta[:-2, k]) / (2.0 * PERIOD)
        scale = np.abs(eta[:, k + 1]).max()
        np.testing.assert_allclose(quotient, eta[1:-1, k + 1], rtol=0, atol=2e-2 * scale)
    assert eta[:, 0].min() >= 0.3 - 1e-12
    assert eta[:, 0].max() <= 1.3 + 1e-12


def test_zero_stops_and_less_goes_back(motion):
    way = lambda t: 1.0 if t < 1.0 else (0.0 if t < 2.0 else -1.5)  # noqa: E731
    times, rows = paced(motion, 2, way, 5.0)
    rest = rows[(times > 1.8) & (times < 2.0), :, 0]
    assert np.abs(rest[:, 1]).max() < 1e-4
    assert np.ptp(rest[:, 0]) < 1e-6
    # back at the start, where it rests
    np.testing.assert_allclose(rows[-1, :, 0], [0.3, 0.0, 0.0], atol=1e-12)


def test_too_much_is_limited_and_no_number_stops(motion):
    _, fast = paced(motion, 2, lambda t: 7.0, 0.5)
    _, most = paced(motion, 2, lambda t: 1.5, 0.5)
    np.testing.assert_array_equal(fast, most)
    _, lost = paced(motion, 2, lambda t: 1.0 if t < 1.0 else np.nan, 3.0)
    assert np.isfinite(lost).all()
    assert abs(lost[-1, 1, 0]) < 1e-9


def test_a_bandwidth_that_is_none_is_refused(motion):
    for bandwidth in (0.0, -3.0, np.inf):
        with pytest.raises(InputError, match="bandwidth of the override = "):
            TimedReference(motion, 2, 3, PERIOD, bandwidth=bandwidth)


def test_slow_samples_are_filtered_exactly(motion):
    """At 50 ms the filter's samples are those at 1 ms, every fiftieth."""
    fine = Stepper(TimedReference(motion, 3, 3, PERIOD), ("override",))
    coarse = Stepper(TimedReference(motion, 3, 3, 50 * PERIOD), ("override",))
    for k in range(20):
        override = 1.5 if k < 10 else 0.25
        rows = [fine.step(override=override)["reference"] for _ in range(50)]
        np.testing.assert_allclose(
            coarse.step(override=override)["reference"], rows[0], rtol=1e-8, atol=1e-8
        )


def test_own_time_waits_at_the_end(motion):
    """A second beyond the end the override turns from 1 to -1, and z_1 by the filter of order 2.

    ``z_1 = -1 + 2 (1 + b t) exp(-b t)`` is zero at ``b t = x``; from there on own time goes back,
    which is later than an immediate change by ``(x + 2 (2 + x) exp(-x)) / b`` in the end.
    """
    end, b = motion.domain[1], 20.0
    times, rows = paced(motion, 2, lambda t: 1.0 if t < end + 1.0 else -1.0, end + 2.5)
    x = brentq(lambda x: (1.0 + x) * np.exp(-x) - 0.5, 1.0, 3.0)
    own = 2.0 * end + 1.0 + (x + 2.0 * (2.0 + x) * np.exp(-x)) / b - times
    settled = times > end + 1.8
    expected = motion.derivatives(own[settled], 0)[:, 0, 0]
    assert expected.max() > 1.2 and expected.min() < 0.9
    np.testing.assert_allclose(rows[settled][:, 0, 0], expected, rtol=0, atol=2 * PERIOD * 0.5)
