"""A plan keeps to its path and to the joints' limits, and is slowed down as it was."""

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces

from pfsc_drake.robot.robot_model import pose_function

PERIOD = 1e-3
SHARE = 0.7  # of every limit
MARGIN = 1.03  # limits hold at Toppra's grid points, a little more comes between


@pytest.fixture(scope="module")
def plan(lap):
    return lap.fastest


@pytest.fixture(scope="module")
def samples(plan):
    return plan.sampled(round((plan.begin + plan.duration) / PERIOD) + 2, PERIOD)


def test_the_tool_stays_on_the_path(lap, station, plan):
    pose = pose_function(station.part.robot)
    for eta in np.linspace(*lap.ends, 57).tolist():
        position, R_d = lap.task.path.pose(eta)
        found = pose(plan.path.value(eta)[:, 0]).full()[:, 0]
        np.testing.assert_allclose(found[:3], position, atol=2e-6)
        np.testing.assert_allclose(found[3:].reshape(3, 3), R_d, atol=1e-5)


def test_limits_are_kept_and_one_is_always_used(station, samples):
    """Accelerations by differences of the rates, torques by Drake's inverse dynamics."""
    model = station.part.model
    q, v = (samples[:-1] + samples[1:]).transpose(1, 0, 2) / 2.0
    a = np.diff(samples[:, 1], axis=0) / PERIOD
    moves = np.abs(v).max(axis=1) > 0.0
    context, torque = model.CreateDefaultContext(), np.zeros_like(a)
    for k in range(len(a)):
        model.SetPositionsAndVelocities(context, np.concatenate([q[k], v[k]]))
        gravity = MultibodyForces(model)
        model.CalcForceElementsContribution(context, gravity)
        torque[k] = model.CalcInverseDynamics(context, a[k], gravity)
    used = np.stack(
        [
            np.abs(v) / model.GetVelocityUpperLimits(),
            np.abs(a) / model.GetAccelerationUpperLimits(),
            np.abs(torque) / model.GetEffortUpperLimits(),
        ]
    ).max(axis=(0, 2))
    assert used.max() < MARGIN * SHARE
    assert np.mean(used[moves] > 0.9 * SHARE) > 0.9


def test_it_comes_to_rest_at_both_ends(plan, samples):
    np.testing.assert_allclose(samples[[0, -1], 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(samples[-1, 0], plan.path.value(1.0)[:, 0], atol=1e-6)


def test_slowed_down_it_makes_the_same_motion(plan):
    slow = plan.lasting(3.0)
    assert slow.duration == pytest.approx(3.0)
    ratio = 3.0 / plan.duration
    for share in (0.2, 0.5, 0.8):
        quick, slowed = (x.sampled(2, x.begin + share * x.duration)[1] for x in (plan, slow))
        np.testing.assert_allclose(quick[0], slowed[0], atol=1e-9)
        np.testing.assert_allclose(quick[1], ratio * slowed[1], atol=1e-9)


def test_it_is_shorter_than_the_motion_of_the_others(lap, plan):
    assert plan.duration < 0.6 * lap.moving
