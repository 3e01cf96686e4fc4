"""Curvatures against closed forms, Weingarten's equations against differences."""

import math

import numpy as np
import pytest

from pfsc_drake.geometry import (
    Turned,
    cone,
    cylinder,
    fundamental_forms,
    paraboloid,
    plane,
    sphere,
    surface_report,
    torus,
    zyx_to_matrix,
)

TURNED = Turned((0.3, -0.2, 0.7), zyx_to_matrix([0.4, -0.7, 1.1]))
C, TUBE, RING = 1.667, 0.1, 0.5


def _principal(c, radius):
    root = math.sqrt(1.0 + 4.0 * c**2 * radius**2)
    return 2.0 * c / root, 2.0 * c / root**3


CASES = {
    "plane": (plane(((-0.3, 0.4), (-0.2, 0.5))), lambda u, v: (0.0, 0.0)),
    "paraboloid": (
        paraboloid(((-0.3, 0.4), (-0.2, 0.5)), C),
        lambda u, v: _principal(C, math.hypot(u, v)),
    ),
    "cylinder": (cylinder(0.09, (-0.2, 0.5), TURNED), lambda u, v: (0.0, -1.0 / 0.09)),
    "cylinder from inside": (
        cylinder(0.09, (-0.2, 0.5), TURNED._replace(inward=True)),
        lambda u, v: (1.0 / 0.09, 0.0),
    ),
    "cone": (cone(0.5, (0.01, 0.5), TURNED), lambda u, v: (0.0, -1.0 / (v * math.tan(0.5)))),
    "sphere": (sphere(0.2, (-1.4, 1.4), TURNED), lambda u, v: (-5.0, -5.0)),
    "torus": (
        torus(RING, TUBE, TURNED),
        lambda u, v: (-math.cos(v) / (RING + TUBE * math.cos(v)), -1.0 / TUBE),
    ),
}


def _places(surface, count=20):
    ends = np.array(surface.domain)
    return np.random.default_rng(3).uniform(ends[:, 0], ends[:, 1], size=(count, 2))


@pytest.mark.parametrize("name", CASES)
def test_principal_curvatures(name):
    surface, expected = CASES[name]
    theta = _places(surface)
    forms = fundamental_forms(surface, theta)
    curvatures = np.array([expected(u, v) for u, v in theta])
    np.testing.assert_allclose(np.transpose(forms.principal_curvatures), curvatures, atol=1e-11)


@pytest.mark.parametrize("name", CASES)
def test_weingarten_equations(name):
    """(4.6): the derivatives of the normal by central differences."""
    surface, _ = CASES[name]
    ends = np.array(surface.domain)
    middle, half = ends.mean(axis=1), 0.49 * np.diff(ends, axis=1)[:, 0]
    theta = middle + half * np.random.default_rng(4).uniform(-1.0, 1.0, size=(20, 2))
    forms, tangents = fundamental_forms(surface, theta), surface.partials(theta, 1)[:, 1:]
    for axis in (0, 1):
        h = 1e-4 * np.eye(2)[axis]

        def normal(k, h=h):
            return fundamental_forms(surface, theta + k * h).normal

        near, far = normal(1) - normal(-1), normal(2) - normal(-2)
        expected = (8.0 * near - far) / 12e-4
        found = np.einsum("ni,nix->nx", forms.weingarten[:, axis], tangents)
        np.testing.assert_allclose(found, expected, atol=1e-8 * (1.0 + np.abs(expected).max()))


def test_normal_has_length_one():
    """(4.3) with the square root of E G - F^2."""
    forms = fundamental_forms(CASES["paraboloid"][0], np.array([0.2, 0.3]))
    assert np.linalg.norm(forms.normal) == pytest.approx(1.0, abs=1e-15)
    assert forms.determinant == pytest.approx(1.0 + 4 * C**2 * (0.2**2 + 0.3**2), rel=1e-14)


def test_report_of_a_torus():
    report = surface_report(torus(RING, TUBE))
    assert report.area == pytest.approx(4.0 * math.pi**2 * RING * TUBE, rel=1e-12)
    lengths = (2.0 * math.pi * (RING + TUBE), 2.0 * math.pi * TUBE)
    assert report.lengths == pytest.approx(lengths, rel=1e-2)
    assert report.radius_inside == pytest.approx(TUBE, rel=1e-12)
    # In the hole the lines about the axis bend to the side that the normal points to.
    assert report.radius_outside == pytest.approx(RING - TUBE, rel=1e-9)
    assert report.radius_outside_at[1] == pytest.approx(math.pi, abs=1e-3)
    np.testing.assert_allclose(report.upper_corner, [0.6, 0.6, 0.1], atol=1e-12)
    np.testing.assert_allclose(report.lower_corner, [-0.6, -0.6, -0.1], atol=1e-12)
    assert report.smallest_angle == pytest.approx(math.pi / 2.0)


def test_report_of_a_paraboloid_that_is_bent_most_between_samples():
    report = surface_report(paraboloid(((-0.31, 0.4), (-0.2, 0.47)), C))
    assert report.radius_outside == pytest.approx(1.0 / (2.0 * C), rel=1e-9)
    assert np.allclose(report.radius_outside_at, 0.0, atol=1e-4)
    assert report.radius_inside == math.inf
    assert report.radius_inside_at is None


def test_report_of_a_plane_and_a_cone():
    report = surface_report(plane((1.0, 2.0)))
    assert (report.radius_outside, report.radius_inside) == (math.inf, math.inf)
    assert report.area == pytest.approx(2.0)
    assert report.lengths == pytest.approx((1.0, 2.0))
    report = surface_report(cone(0.5, (0.01, 0.3)))
    assert report.area == pytest.approx(math.pi * math.sin(0.5) * (0.3**2 - 0.01**2), rel=1e-12)
    assert report.radius_inside == pytest.approx(0.01 * math.tan(0.5), rel=1e-12)
    assert report.radius_outside == math.inf
