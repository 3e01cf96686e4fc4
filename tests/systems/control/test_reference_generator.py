"""The reference over time as a system."""

import numpy as np
import pytest

from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.systems.control.reference_generator import ReferenceGenerator


@pytest.fixture(name="motion")
def fixture_motion():
    return rest_to_rest([0.3, 1.3], velocity=0.5, acceleration=2.0, dwell=0.2)


def at(system, time):
    context = system.CreateDefaultContext()
    context.SetTime(time)
    return system.GetOutputPort("reference").Eval(context)


@pytest.mark.parametrize("r", [1, 2, 4])
@pytest.mark.parametrize("m", [3, 6])
def test_rows_hold_the_derivatives_of_eta_alone(motion, r, m):
    system = ReferenceGenerator(motion, r, m)
    for time in (0.0, 0.35, 0.9, 2.0):
        rows = at(system, time).reshape(r + 1, m)
        assert np.allclose(rows[:, 0], motion.derivatives(time, r)[:, 0], rtol=1e-12, atol=1e-12)
        assert not np.any(rows[:, 1:])


def test_derivatives_are_those_of_the_first_row(motion):
    system, h = ReferenceGenerator(motion, 2, 3), 1e-5
    for time in (0.3, 0.5, 0.9, 2.2):
        before, now, after = (at(system, time + k * h) for k in (-1, 0, 1))
        assert now[3] == pytest.approx((after[0] - before[0]) / (2 * h), abs=1e-8)
        assert now[6] == pytest.approx((after[3] - before[3]) / (2 * h), abs=1e-6)


def test_it_rests_before_and_after(motion):
    system = ReferenceGenerator(motion, 4, 3)
    for time, eta in ((-1.0, 0.3), (motion.domain[1] + 5.0, 1.3)):
        rows = at(system, time).reshape(5, 3)
        assert rows[0] == pytest.approx([eta, 0.0, 0.0], abs=1e-13)
        assert not np.any(rows[1:])


def test_a_motion_that_does_not_end_at_rest_stops(path):
    """Beyond its end the velocity is not carried on."""
    ramp = rest_to_rest([0.0, 1.0], velocity=0.5, acceleration=2.0)
    cut = type(ramp)(ramp.breakpoints[:2], ramp.coefficients[:1])
    system = ReferenceGenerator(cut, 2, 3)
    end = cut.domain[1]
    assert at(system, end)[3] == pytest.approx(0.5, rel=1e-9)
    assert not np.any(at(system, end + 1e-6)[3:])


def test_it_has_no_state(motion):
    assert ReferenceGenerator(motion, 2, 3).CreateDefaultContext().num_total_states() == 0
