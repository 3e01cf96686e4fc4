"""The force with which a tool is to press, over time."""

import numpy as np
import pytest

from pfsc_drake.control.compliance.press import PressParameters
from pfsc_drake.errors import InputError

END = 5.0


def test_it_approaches_presses_and_retreats():
    press = PressParameters(
        force=20.0, approach=6.0, retreat=4.0, begin=0.1, contact=1.0, retreat_time=0.5, ramp=0.2
    )
    times = [0.0, 0.1, 0.3, 1.0, 1.1, 1.2, 4.5, 4.7, 6.0]
    expected = [0.0, 0.0, 6.0, 6.0, 13.0, 20.0, 20.0, -4.0, -4.0]
    assert [*map(press.over_time(END), times)] == pytest.approx(expected)


def test_it_is_smooth():
    press, step = PressParameters(), 1e-4
    force = np.array([*map(press.over_time(END), np.arange(0.0, END, step))])
    slope = np.diff(force) / step
    assert np.abs(slope).max() < 2.5 * 26.0 / press.ramp  # of a step that is C^4: 315 / 128
    assert np.abs(np.diff(slope)).max() < 10.0 * step * 26.0 / press.ramp**2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"force": -1.0}, "force = -1.0: must be zero or a positive number"),
        ({"ramp": 0.0}, "ramp = 0.0: must be a positive"),
        ({"contact": 0.1}, "contact = 0.1: must be 0.2 s or later"),
        ({"retreat": float("nan")}, "retreat = nan"),
    ],
)
def test_refused(change, words):
    with pytest.raises(InputError, match=words):
        PressParameters(**change)
