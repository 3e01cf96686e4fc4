"""The transform as a system: the function's own values, ports, no memory."""

import numpy as np
import pytest

from pfsc_drake.control.manifolds.path_force import manifold_force
from pfsc_drake.geometry import Path, PathPointLayout, interpolate_orientation, zyx_to_quaternion
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
    layout = path.evaluator(2).layout
    system = ManifoldForceTransform(layout)
    assert not system.HasInputPort("reference")
    forces = in_context(system, wrench=WRENCH, manifold_point=point)
    assert forces.shape == (3,)
    assert np.array_equal(forces, manifold_force(WRENCH, point, layout))


@pytest.mark.parametrize("with_turning", [False, True])
def test_with_orientation(oriented_path, with_turning):
    """The angles are the reference's own, not its derivatives."""
    point = oriented_path.evaluator(2)([0.9, 0.2, 1.1], 0.6)
    layout = oriented_path.evaluator(2).layout
    reference = np.random.default_rng(1).uniform(-1, 1, 18)
    system = ManifoldForceTransform(layout, with_turning=with_turning)
    forces = in_context(system, wrench=WRENCH, manifold_point=point, reference=reference)
    expected = manifold_force(WRENCH, point, layout, reference[3:6], with_turning=with_turning)
    assert np.array_equal(forces, expected)
    reference[6:] = 0.0
    forces = in_context(system, wrench=WRENCH, manifold_point=point, reference=reference)
    assert np.array_equal(forces, expected)


def test_a_failed_sensor_or_projection_raises_nothing(oriented_path):
    layout = oriented_path.evaluator(2).layout
    point = np.full(layout.size, np.nan)
    system = ManifoldForceTransform(layout, with_turning=True)
    forces = in_context(system, wrench=WRENCH, manifold_point=point, reference=np.zeros(18))
    assert np.isnan(forces).all()


def test_it_has_no_state():
    system = ManifoldForceTransform(PathPointLayout(4, True))
    assert system.CreateDefaultContext().num_total_states() == 0
    assert system.GetInputPort("reference").size() == 30
