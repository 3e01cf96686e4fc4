"""Points that move beside a surface."""

import numpy as np
import pytest

from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.surfaces.curvature import SurfaceTarget


@pytest.mark.parametrize(
    "surface",
    [cylinder(0.2, (-0.3, 0.3)), paraboloid(((-0.4, 0.4), (-0.4, 0.4)), 1.5)],
    ids=["cylinder", "paraboloid"],
)
def test_its_velocity_is_the_derivative_of_its_position(surface):
    target = SurfaceTarget(surface)
    at, rate = np.array([0.2, -0.1, 0.03]), np.array([0.7, -0.4, 0.2])
    h = 1e-6
    ahead, back = (target(at + s * h * rate, rate)[0] for s in (1.0, -1.0))
    assert np.allclose(target(at, rate)[1], (ahead - back) / (2.0 * h), atol=1e-8)


def test_on_a_cylinder_it_is_in_cylindrical_coordinates():
    p, _ = SurfaceTarget(cylinder(0.2, (-0.3, 0.3)))(np.array([0.5, 0.1, 0.05]), np.zeros(3))
    assert np.allclose(p, [0.25 * np.cos(0.5), 0.25 * np.sin(0.5), 0.1])


def test_open_directions_end():
    target = SurfaceTarget(cylinder(0.2, (-0.3, 0.3)))
    p, _ = target(np.array([7.0, 5.0, 0.0]), np.zeros(3))
    assert np.allclose(p, [0.2 * np.cos(7.0), 0.2 * np.sin(7.0), 0.3])
