"""The transform as a system: the function's own values, ports, no memory."""

import numpy as np
import pytest

from pfsc_drake.control.manifolds.manifold import manifold_force_function
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import Path, interpolate_orientation, zyx_to_quaternion
from pfsc_drake.systems.control.manifold_force_transform import ManifoldForceTransform

WRENCH = np.array([5.0, -3.0, 8.0, 0.4, 0.2, -0.7])


@pytest.fixture(name="oriented_path", scope="module")
def fixture_oriented_path(path):
    theta = np.linspace(0.0, 2.0 * np.pi, 9)
    angles = np.stack([0.3 * np.sin(theta), 0.2 * np.cos(theta), 0.1 * np.sin(2 * theta)], axis=1)
    quaternions = zyx_to_quaternion(angles)
    return Path(
        path.position, interpolate_orientation(quaternions, theta, smoothness=3, closed=True)
    )


def in_context(system, **inputs):
    context = system.CreateDefaultContext()
    for name, value in inputs.items():
        system.GetInputPort(name).FixValue(context, value)
    return system.GetOutputPort("manifold_force").Eval(context)


def test_position_only(path):
    point = path.evaluator(2)([0.9, 0.2, 1.1], 0.6)
    manifold = PathManifold(2, oriented=False)
    system = ManifoldForceTransform(manifold)
    assert not system.HasInputPort("reference")
    forces = in_context(system, wrench=WRENCH, manifold_point=point)
    assert forces.shape == (3,)
    expected = np.array(manifold_force_function(manifold)(WRENCH, point, np.zeros(3))).ravel()
    assert np.array_equal(forces, expected)


@pytest.mark.parametrize("with_turning", [False, True])
def test_with_orientation(oriented_path, with_turning):
    """The angles are the reference's own, not its derivatives."""
    point = oriented_path.evaluator(2)([0.9, 0.2, 1.1], 0.6)
    manifold = PathManifold(2, oriented=True)
    reference = np.random.default_rng(1).uniform(-1, 1, 18)
    system = ManifoldForceTransform(manifold, with_turning=with_turning)
    forces = in_context(system, wrench=WRENCH, manifold_point=point, reference=reference)
    function = manifold_force_function(manifold, with_turning=with_turning)
    expected = np.array(function(WRENCH, point, reference[:6])).ravel()
    assert np.array_equal(forces, expected)
    reference[6:] = 0.0
    forces = in_context(system, wrench=WRENCH, manifold_point=point, reference=reference)
    assert np.array_equal(forces, expected)


def test_a_failed_sensor_or_projection_raises_nothing():
    manifold = PathManifold(2, oriented=True)
    point = np.full(manifold.layout.size, np.nan)
    system = ManifoldForceTransform(manifold, with_turning=True)
    forces = in_context(system, wrench=WRENCH, manifold_point=point, reference=np.zeros(18))
    assert np.isnan(forces).all()


def test_it_has_no_state():
    system = ManifoldForceTransform(PathManifold(4, oriented=True))
    assert system.CreateDefaultContext().num_total_states() == 0
    assert system.GetInputPort("reference").size() == 30
