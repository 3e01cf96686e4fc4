"""The force with which a tool is to press, over time."""

import math

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.compliance.pressing import PressParameters
from pfsc_drake.errors import InputError

END, STIFF = 5.0, 1e6


def test_it_approaches_presses_and_retreats():
    press = PressParameters(
        force=20.0, approach=6.0, retreat=4.0, begin=0.1, touching=3.0, retreat_time=0.5, ramp=0.2
    )
    force = press.over_time(END, STIFF)
    times = [0.0, 0.1, 0.3, 1.0, 1.1, 1.2, 4.5, 4.6, 4.7, 6.0]
    expected = [0.0, 0.0, 6.0, 6.0, 13.0, 20.0, 20.0, 8.0, -4.0, -4.0]
    assert [float(force(time, 1.0, 0.0)) for time in times] == pytest.approx(expected)


def test_nothing_met_is_approached_for_ever_and_left_again():
    force = PressParameters(approach=6.0, retreat=4.0).over_time(END, STIFF)
    assert force(4.0, math.inf, 0.0) == pytest.approx(6.0)
    assert force(END, math.inf, 0.0) == pytest.approx(-4.0)


@pytest.mark.parametrize("touch_down", [0.15, 1.0, 4.52])
def test_it_is_smooth(touch_down):
    press, step = PressParameters(), 1e-4
    force = press.over_time(END, STIFF)
    time = ca.SX.sym("time")
    over_time = ca.Function("force", [time], [force(time, touch_down, 0.0)])
    forces = over_time(ca.DM(np.arange(0.0, END, step)).T).full().ravel()
    slope = np.diff(forces) / step
    # of a step that is C^4: 315 / 128; two of them at once
    assert np.abs(slope).max() < 2.0 * 2.5 * 26.0 / press.ramp
    assert np.abs(np.diff(slope)).max() < 20.0 * step * 26.0 / press.ramp**2


def test_what_is_taken_off_comes_to_rest_by_a_spring():
    """Half the clearance with all of the force, then less, and back from beyond."""
    force = PressParameters(retreat=4.0, clearance=0.01).over_time(END, STIFF)
    lifted = [-0.001, 0.0, 0.005, 0.0075, 0.01, 0.0125, 0.1]
    expected = [-4.0, -4.0, -4.0, -2.0, 0.0, 2.0, 4.0]
    assert [float(force(END, 1.0, x)) for x in lifted] == pytest.approx(expected)
    soft = PressParameters(retreat=4.0, clearance=0.01).over_time(END, 100.0)
    assert soft(END, 1.0, 0.0075) == pytest.approx(-0.25)
    assert soft(1.0, 0.5, 0.1) == pytest.approx(20.0), "before it is taken off it only presses"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"force": -1.0}, r"force = -1.0; allowed: 0 to 1e\+06 N"),
        ({"ramp": 0.0}, "ramp = 0.0; allowed: above 0"),
        ({"touching": 6.0}, "touching = 6.0; allowed: a positive number below approach = 6 N"),
        ({"retreat": float("nan")}, "retreat = nan"),
        ({"retreat": 0.0}, r"retreat = 0.0; allowed: above 0, at most 1e\+06 N"),
        ({"clearance": 0.0}, "clearance = 0.0; allowed: above 0, at most 1000 m"),
    ],
)
def test_refused(change, words):
    with pytest.raises(InputError, match=words):
        PressParameters(**change)


def test_the_force_may_differ_by_more_than_a_free_motion_makes_it():
    """Moving free it measures nothing."""
    assert PressParameters().allowed_difference == 30.0
    assert PressParameters(force=5.0, approach=8.0).allowed_difference == 12.0
    assert PressParameters(limit=21.0).allowed_difference == 21.0
    with pytest.raises(InputError, match=r"limit = 20.0; allowed: 0, or more than .* of 20 N"):
        PressParameters(limit=20.0)
