"""The transform as a block: the function's own values, ports, no memory."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.impedance_filter import ManifoldForceTransform
from pfsc_drake.control.manifolds.manifold import manifold_force_function
from pfsc_drake.control.manifolds.path import PathManifold

WRENCH = np.array([5.0, -3.0, 8.0, 0.4, 0.2, -0.7])


def forces_of(block, **inputs):
    return Stepper(block).step(**inputs)["manifold_force"]


def test_position_only(position_path):
    point = position_path.evaluator(2)([0.9, 0.2, 1.1], 0.6)
    manifold = PathManifold(2, oriented=False)
    block = ManifoldForceTransform(manifold)
    assert "reference" not in block.inputs
    forces = forces_of(block, wrench=WRENCH, manifold_point=point)
    assert forces.shape == (3,)
    expected = np.array(manifold_force_function(manifold)(WRENCH, point, np.zeros(3))).ravel()
    assert np.array_equal(forces, expected)


@pytest.mark.parametrize("with_turning", [False, True])
def test_with_orientation(oriented_path, with_turning):
    """The angles are the reference's own, not its derivatives."""
    point = oriented_path.evaluator(2)([0.9, 0.2, 1.1], 0.6)
    manifold = PathManifold(2, oriented=True)
    reference = np.random.default_rng(1).uniform(-1, 1, 18)
    block = ManifoldForceTransform(manifold, with_turning=with_turning)
    forces = forces_of(block, wrench=WRENCH, manifold_point=point, reference=reference)
    function = manifold_force_function(manifold, with_turning=with_turning)
    expected = np.array(function(WRENCH, point, reference[:6])).ravel()
    assert np.array_equal(forces, expected)
    reference[6:] = 0.0
    forces = forces_of(block, wrench=WRENCH, manifold_point=point, reference=reference)
    assert np.array_equal(forces, expected)


def test_a_failed_sensor_or_projection_raises_nothing():
    manifold = PathManifold(2, oriented=True)
    point = np.full(manifold.layout.size, np.nan)
    block = ManifoldForceTransform(manifold, with_turning=True)
    forces = forces_of(block, wrench=WRENCH, manifold_point=point, reference=np.zeros(18))
    assert np.isnan(forces).all()


def test_it_has_no_state():
    block = ManifoldForceTransform(PathManifold(4, oriented=True))
    assert not block.states
    assert block.inputs["reference"].size == 30
