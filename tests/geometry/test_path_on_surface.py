"""Paths on a surface against closed forms, differences, and a frame of parallel transport."""

import math

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    ParallelTransportFrame,
    PiecewisePolynomialCurve,
    ProjectionStatus,
)
from pfsc_drake.geometry.path_on_surface import CurveOnSurface, path_on_surface
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.shapes.torus import torus
from pfsc_drake.geometry.surfaces.curvature import fundamental_forms

RADIUS = 0.25


def line(start, slope):
    return PiecewisePolynomialCurve([0.0, 1.0], np.array([[start, slope]]))


def helix(slope=0.1):
    """Return a helix and its angle against the circles of the cylinder."""
    path = path_on_surface(cylinder(RADIUS, (-0.5, 0.5)), line([0.3, -0.1], [2.0, slope]))
    return path, math.atan2(slope, 2.0 * RADIUS)


CURVES = {
    "closed": (torus(0.5, 0.2), FourierCurve([0.7, 0.4], [[0.5, 0.05]], [[0.1, 0.6]])),
    "open": (paraboloid(((-1, 1), (-1, 1)), -0.9), line([-0.3, 0.2], [0.7, -0.9])),
    "around": (cylinder(RADIUS, (-0.5, 0.5)), line([-4.0, -0.4], [11.0, 0.7])),
}


@pytest.mark.slow(but="open")
@pytest.mark.parametrize("name", CURVES)
def test_derivatives_and_turning_against_interpolation(name):
    """The angle psi against parallel transport, whose frame knows nothing of the surface."""
    surface, parameters = CURVES[name]
    curve = CurveOnSurface(surface, parameters)
    transported = ParallelTransportFrame(curve)
    middle, window, degree = 0.4, 0.15, 16
    nodes = middle + window * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    places = surface.partials(parameters.derivatives(nodes, 0)[:, 0], 0)[:, 0]
    e_perp, e_cross = transported.normals(nodes)
    normal = fundamental_forms(surface, parameters.derivatives(nodes, 0)[:, 0]).normal
    assert np.allclose(curve.normals(nodes)[0], normal, atol=1e-13)
    components = np.sum(normal * e_cross, axis=1), np.sum(normal * e_perp, axis=1)
    assert np.allclose(np.hypot(*components), 1.0, atol=1e-12)
    angle = np.unwrap(np.arctan2(*components))
    turning, derivatives = curve.turning(middle, 4), curve.derivatives(middle, 5)
    signals = np.column_stack([places, angle])
    domain = [middle - window, middle + window]
    fits = [Chebyshev.fit(nodes, column, degree, domain=domain) for column in signals.T]
    for k in range(5):
        expected = [fit.deriv(k)(middle) if k else fit(middle) for fit in fits]
        assert derivatives[k] == pytest.approx(expected[:3], rel=1e-5, abs=1e-5), k
        if k:
            assert turning[k - 1] == pytest.approx(expected[3], rel=1e-5, abs=1e-5), k


def test_torsion_of_a_helix():
    """Geodesic torsion sin a cos a / R on a cylinder whose normal points outwards."""
    path, angle = helix()
    layout = path.evaluator(3).layout
    point = path.evaluator(3).evaluate_at(0.5)
    speed = np.linalg.norm(point[layout.position][3:6])
    torsion = math.sin(angle) * math.cos(angle) / RADIUS
    assert point[layout.turn] == pytest.approx([speed * torsion, 0.0, 0.0], abs=1e-9)
    theta = 0.3 + 2.0 * 0.5
    outwards = [math.cos(theta), math.sin(theta), 0.0]
    assert point[layout.normal] == pytest.approx(outwards, abs=1e-12)


@pytest.mark.slow(but=["2-closed", "2-open"])
@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("order", [2, 4])
def test_the_law_receives_the_frame_of_the_surface(name, order):
    path = path_on_surface(*CURVES[name])
    evaluator = path.evaluator(order)
    layout = evaluator.layout
    assert layout.size == evaluator.evaluate_at(0.4).size
    for theta in (0.1, 0.55, 0.93):
        sigma = path.position.derivatives(theta, 0)[0]
        e_perp, e_cross = path.frame.normals(theta)
        point = evaluator((sigma + 0.01 * e_perp - 0.02 * e_cross).tolist(), theta + 0.01)
        assert point[layout.theta] == pytest.approx([theta], abs=1e-10)
        assert np.allclose(point[layout.normal], e_perp, atol=1e-11)
        turning = path.frame.turning(theta, order)
        assert np.allclose(point[layout.turn], turning, rtol=1e-9, atol=1e-8)
        derivatives = path.position.derivatives(theta, order + 1)
        assert np.allclose(point[layout.position].reshape(-1, 3), derivatives, rtol=1e-9, atol=1e-8)


def test_a_revolution_leads_back_to_the_same_frame():
    path = path_on_surface(*CURVES["closed"])
    evaluator = path.evaluator(2)
    layout = evaluator.layout
    first, second = (
        evaluator.evaluate_at(0.4 + revolution * path.position.period) for revolution in (0, 3)
    )
    assert np.allclose(first[layout.normal], second[layout.normal], atol=1e-12)
    assert second[layout.eta] - first[layout.eta] == pytest.approx([3 * path.length], abs=1e-9)


def test_beyond_its_end_the_frame_comes_to_rest_smoothly():
    path, _ = helix()
    evaluator, end = path.evaluator(3), path.position.domain[1]
    layout = evaluator.layout
    sigma, slope = path.position.derivatives(end, 1)
    turns = []
    for step in np.linspace(-2e-3, 0.3, 200):
        point = evaluator((sigma + step * slope).tolist(), end)
        tangent = point[layout.position][3:6] / np.linalg.norm(point[layout.position][3:6])
        assert point[layout.normal] @ tangent == pytest.approx(0.0, abs=1e-11)
        turns.append(point[layout.turn])
    turns = np.array(turns)
    assert turns[0, 0] == pytest.approx(path.frame.turning(end, 1)[0], rel=1e-6)
    assert point[layout.status] == [ProjectionStatus.BEYOND_END]
    assert not turns[-1].any()
    assert np.abs(np.diff(turns[:, 0])).max() < 0.1 * turns[0, 0]


def test_a_curve_that_leaves_the_surface_is_refused():
    with pytest.raises(InputError, match=r"theta_2: .* the surface is defined on \[-0.5, 0.5\]"):
        path_on_surface(cylinder(RADIUS, (-0.5, 0.5)), line([0.0, 0.0], [1.0, 0.6]))
    with pytest.raises(InputError, match="curve of dimension 3; 2 is required"):
        path_on_surface(cylinder(RADIUS, (-0.5, 0.5)), FourierCurve.circle([0, 0, 0], 0.1))
