"""Pulses over time: values, smoothness, frames."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.paths.frame import manifold_axes
from pfsc_drake.physics.scripted_force import (
    ForceProfile,
    ForcePulse,
    smooth_pulse,
    smooth_step,
    smooth_step_slope,
)

# against the motion from 1.5 s to 2.0 s, with ramps of 50 ms
PUSH = {"begin": 1.5, "end": 2.0, "force": [-100.0, 0.0, 0.0], "ramp": 0.05}


def numbers(vector):
    return ca.DM(vector).full().ravel()


def test_a_push_has_its_values():
    pulse = ForcePulse(**PUSH)
    for time, value in [
        (0.0, 0.0),
        (1.5, 0.0),
        (1.525, -50.0),
        (1.55, -100.0),
        (1.8, -100.0),
        (1.95, -100.0),
        (1.975, -50.0),
        (2.0, 0.0),
        (9.0, 0.0),
    ]:
        assert numbers(pulse.at(time)) == pytest.approx([value, 0, 0, 0, 0, 0], abs=1e-10)


def test_a_push_is_twice_continuously_differentiable():
    pulse, h = ForcePulse(**PUSH), 1e-6
    time = np.arange(1.49, 2.01, h)
    force = smooth_pulse(ca.DM(time), pulse.begin, pulse.end, pulse.ramp).full().ravel()
    velocity = np.diff(force) / h
    assert np.max(np.abs(np.diff(force))) < 2.0 * h / 0.05
    assert np.max(np.abs(np.diff(velocity))) < 6.0 * h / 0.05**2
    # second derivative by coarse differences, away from rounding
    coarse = np.diff(force[::100], 2) / (100 * h) ** 2
    assert np.max(np.abs(np.diff(coarse))) < 70.0 * 100 * h / 0.05**3


def test_smooth_step_and_its_slope():
    x, h = np.linspace(-0.2, 1.2, 57), 1e-6
    slope = [(smooth_step(a + h) - smooth_step(a - h)) / (2 * h) for a in x]
    assert [smooth_step_slope(a) for a in x] == pytest.approx(slope, abs=1e-8)
    assert [smooth_step(a) for a in (-1.0, 0.0, 0.5, 1.0, 2.0)] == [0.0, 0.0, 0.5, 1.0, 1.0]


def test_a_pulse_may_be_all_ramp():
    pulse = ForcePulse(0.0, 1.0, [0, 2.0, 0], ramp=0.5)
    assert pulse.at(0.5)[1] == 2.0
    assert pulse.at(0.25)[1] == pytest.approx(1.0)


def test_manifold_axes_are_the_path_frame():
    axes = manifold_axes(np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    assert np.allclose(axes, np.column_stack([[0, 1, 0], [0, 0, 1], [1, 0, 0]]), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_pulses_add_up_over_frames():
    profile = ForceProfile(
        [
            ForcePulse(0.0, 10.0, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]),
            ForcePulse(0.0, 10.0, [10.0, 20.0, 30.0], [40.0, 50.0, 60.0], frame="manifold"),
            ForcePulse(20.0, 21.0, [7.0, 0.0, 0.0]),
        ]
    )
    axes = np.column_stack([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    # e_par = y, e_perp = z, e_cross = x
    expected = [1 + 30, 2 + 10, 3 + 20, 4 + 60, 5 + 40, 6 + 50]
    assert numbers(profile.at(5.0, axes)) == pytest.approx(expected)
    assert numbers(profile.at(20.5, axes)) == pytest.approx([7, 0, 0, 0, 0, 0])
    assert profile.needs_manifold
    assert not ForceProfile([ForcePulse()]).needs_manifold
    assert not np.any(numbers(ForceProfile([]).at(0.0, axes)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"force": [1.0, 2.0]}, r"^force = \[1.0, 2.0\]: must be 3 finite numbers$"),
        ({"torque": [0, 0, np.nan]}, "^torque = .*: must be 3 finite"),
        ({"end": 1.5}, r"^begin, end = 1.5, 1.5; allowed: finite numbers \[s\], begin before end$"),
        ({"ramp": 0.3}, r"^ramp = 0.3: must be positive and at most 0.25, half the pulse$"),
        ({"ramp": 0.0}, "^ramp = 0.0: must be positive"),
        ({"frame": "tool"}, "^frame = tool; allowed: world, manifold$"),
    ],
)
def test_pulses_out_of_range(changes, message):
    with pytest.raises(InputError, match=message):
        ForcePulse(**{**PUSH, **changes})


def test_a_point_needs_a_link():
    assert ForcePulse(**PUSH, link="link_3", point=[0.0, 0.1, 0.0]).point.tolist() == [0, 0.1, 0]
    with pytest.raises(InputError, match=r"point = \[0.0, 0.1, 0.0\]: must be \[0, 0, 0\] without"):
        ForcePulse(**PUSH, point=[0.0, 0.1, 0.0])
