"""Ways over surfaces, against closed forms."""

import numpy as np
import pytest

from pfsc_drake.control.law.reference import straight_lines
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.surfaces.length import parameters_along_motion


def test_on_a_cylinder_angles_and_heights_are_lengths():
    surface = cylinder(0.09, (-0.2, 0.2))
    motion = straight_lines([[0.0, 0.0], [0.2, 0.1], [0.3, -0.1]], 0.2, 1.0)
    times = np.linspace(*motion.domain, 101)
    way = np.array(list(parameters_along_motion(surface, motion, np.array([0.4, 0.05]), times)))
    eta = motion.derivatives(times, 0)[:, 0]
    assert np.allclose(way, [0.4, 0.05] + eta / [0.09, 1.0], atol=1e-9)


@pytest.mark.slow
def test_on_a_paraboloid_the_path_has_the_length_of_its_coordinates():
    surface = paraboloid(((-0.4, 0.4), (-0.4, 0.4)), 1.5)
    motion = straight_lines([[0.0, 0.0], [0.15, 0.2], [-0.1, 0.1]], 0.3, 2.0)
    times = np.linspace(*motion.domain, 2001)
    way = np.array(list(parameters_along_motion(surface, motion, np.array([0.1, -0.1]), times)))
    points = np.array([surface.partials(theta, 0)[0] for theta in way])
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    eta = motion.derivatives(times, 0)[:, 0]
    assert length == pytest.approx(np.linalg.norm(np.diff(eta, axis=0), axis=1).sum(), rel=1e-5)
