"""Surfaces that meet themselves, and others that only come near."""

import math

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    Turned,
    check_single_sheet,
    cone,
    cylinder,
    extruded_surface,
    interpolate,
    paraboloid,
    plane,
    sphere,
    surface_of_revolution,
    torus,
)
from pfsc_drake.geometry.surfaces.sheets import _path_lengths

EIGHT = FourierCurve([0, 0, 0], [[0.2, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.1, 0]])
EIGHT_BESIDE = FourierCurve([0.5, 0], [[0.2, 0], [0, 0]], [[0, 0], [0, 0.1]])


def _spiral(turns, pitch):
    angle = np.linspace(0.0, 2.0 * math.pi * turns, 60)
    radius = 0.1 + pitch * angle / (2.0 * math.pi)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=1)
    return extruded_surface(interpolate(points, smoothness=3), (0.0, 0.0, 1.0), 0.2)


def _loop():
    """A cubic that crosses itself at t = -1 and 1, its points in dense and in wide steps."""
    t = np.linspace(-2.0, 2.0, 40)
    points = 0.1 * np.stack([t**3 - t, 0.0 * t, t**2], axis=1)
    return extruded_surface(interpolate(points, smoothness=4), (0.0, 1.0, 0.0), 0.2)


@pytest.mark.slow(but=["ring of eights", "covered twice", "eight", "loop"])
@pytest.mark.parametrize(
    "surface",
    [
        _loop(),
        extruded_surface(EIGHT, (0.0, 0.0, 1.0), 0.3),
        extruded_surface(EIGHT, (0.1, 0.2, 1.0), 0.05),
        surface_of_revolution(EIGHT_BESIDE),
        _spiral(1.5, 0.0),
    ],
    ids=["loop", "eight", "slanted eight", "ring of eights", "covered twice"],
)
def test_surfaces_that_meet_themselves(surface):
    with pytest.raises(InputError, match=r"meets itself at theta = \[.*\] and \[.*\]"):
        check_single_sheet(surface)


@pytest.mark.slow(but=["spiral", "torus", "slit tube", "cone", "tube", "plane", "sphere"])
@pytest.mark.parametrize(
    "surface",
    [
        plane((1.0, 2.0)),
        cylinder(0.09, (-0.1, 0.1)),
        cylinder(0.01, (-0.1, 0.5), Turned(angles=(0.0, 6.2))),
        cone(0.5, (0.01, 0.3)),
        sphere(0.2, (-1.4, 1.4)),
        torus(0.5, 0.1),
        torus(0.101, 0.1),
        paraboloid(((-0.3, 0.3), (-0.3, 0.3)), 12.5),
        _spiral(2.5, 0.01),
    ],
    ids=["plane", "tube", "slit tube", "cone", "sphere", "torus", "fat torus", "deep", "spiral"],
)
def test_single_sheets(surface):
    check_single_sheet(surface)


def test_around_a_tube_the_path_across_the_seam_counts():
    """Around it the shorter of two, along it the only one."""
    angle, height = np.meshgrid(np.arange(12) * math.pi / 6.0, [0.0, 0.5, 1.0], indexing="ij")
    tube = np.stack([np.cos(angle), np.sin(angle), height], axis=-1)
    other = np.ravel_multi_index(([11, 5, 7], [2, 0, 0]), angle.shape)
    chord = 2.0 * math.sin(math.pi / 12.0)
    found = _path_lengths(tube, (True, False), np.zeros(3, dtype=int), other)
    np.testing.assert_allclose(found, [chord + 1.0, 5.0 * chord, 5.0 * chord])


@pytest.mark.slow
def test_neighbours_across_the_seam_do_not_crowd_out_a_crossing():
    """An eight whose parameter creeps at the seam: thousands of pairs there are near each other."""
    t = 2.0 * math.pi * np.arange(512) / 512
    angle = t - 0.97 * np.sin(t)
    series = np.fft.rfft(np.stack([0.2 * np.cos(angle), 0.1 * np.sin(2.0 * angle)], axis=1), axis=0)
    series = series[:80] / 256.0
    series = np.column_stack([series, np.zeros(80)])
    eight = FourierCurve([*series[0, :2].real / 2.0, 0.0], series[1:].real, -series[1:].imag)
    with pytest.raises(InputError, match="meets itself"):
        check_single_sheet(extruded_surface(eight, (0.0, 0.0, 1.0), 3.0))
