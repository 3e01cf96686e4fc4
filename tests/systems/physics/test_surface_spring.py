"""A surface as a spring, against Hooke's law on a plane."""

import numpy as np
import pytest

from pfsc_drake.systems.physics.surface_spring import SurfaceSpring

NORMAL = np.array([0.0, 0.6, 0.8])
STIFFNESS = 3e4


def touch(y_t, near):
    """Return height over a plane through the origin, its normal and where on it one is."""
    closest = y_t - (NORMAL @ y_t) * NORMAL
    assert near is None or near.shape == (2,)
    return float(NORMAL @ y_t), NORMAL, closest[:2]


@pytest.fixture(name="spring")
def fixture_spring():
    spring = SurfaceSpring(touch, STIFFNESS, 1e-3)
    return spring, spring.CreateDefaultContext()


def wrench_at(spring, context, height):
    pose = np.concatenate([height * NORMAL + [0.1, 0.0, 0.0], np.eye(3).ravel()])
    spring.GetInputPort("tool_pose").FixValue(context, pose)
    return spring.GetOutputPort("wrench").Eval(context)


def test_it_pushes_only_in_contact(spring):
    np.testing.assert_array_equal(wrench_at(*spring, 1e-3), 0.0)
    wrench = wrench_at(*spring, -1e-3)
    np.testing.assert_allclose(wrench[:3], 30.0 * NORMAL)
    np.testing.assert_array_equal(wrench[3:], 0.0)


@pytest.mark.parametrize("height", [-1e-3, 2e-3])
def test_another_stiffness_has_the_same_force_at_the_same_position(spring, height):
    system, context = spring
    wrench_at(system, context, height)
    system.set_stiffness(context, 1e5, 12.0)
    assert system.force(context) == pytest.approx(12.0)
    higher = wrench_at(system, context, height + 1e-5)[:3] @ NORMAL
    lower = wrench_at(system, context, height - 1e-5)[:3] @ NORMAL
    assert (lower - higher) / 2e-5 == pytest.approx(1e5)
