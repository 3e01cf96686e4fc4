"""A turntable's kinematics against Drake's, and frames that are led on in time."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE
from pfsc_drake.control.manifolds.turntable import (
    AdvancedFrame,
    TurntableAxes,
    TurntableFrame,
    turntable_motion_function,
)
from tests.control.manifolds.tool_motion import NODES, ORDER, assert_derivatives

BASE = RigidTransform(RotationMatrix.MakeZRotation(0.4), [0.9, -0.2, 0.3])
DIRECTIONS = np.array([[0.0, 1.0, 0.0], [0.36, 0.48, 0.8]])
POINTS = np.array([[0.1, 0.0, 0.2], [-0.05, 0.1, 0.3]])
CARRIED = RigidTransform(RotationMatrix.MakeXRotation(-0.3), [0.1, 0.05, 0.5])


def vector(X):
    """Return ``[p, R by rows]``."""
    return np.append(X.translation(), X.rotation().matrix())


AXES = TurntableAxes(vector(BASE), DIRECTIONS, POINTS, vector(CARRIED))


@pytest.fixture(scope="module")
def table():
    """Return the pose of the workpiece as a function of the angles, by Drake."""
    plant = MultibodyPlant(0.0)
    before, X_BJ = plant.world_frame(), BASE
    for k, (direction, point) in enumerate(zip(DIRECTIONS, POINTS, strict=True)):
        body = plant.AddRigidBody(f"body_{k}", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        # axes of the base, origin at the axis' point
        X_PF = X_BJ @ RigidTransform(point) if k == 0 else RigidTransform(point - POINTS[k - 1])
        frame = plant.AddFrame(FixedOffsetFrame(f"frame_{k}", before, X_PF))
        joint = RevoluteJoint(f"joint_{k}", frame, body.body_frame(), direction)
        plant.AddJoint(joint)
        before = body.body_frame()
    plant.Finalize()
    context = plant.CreateDefaultContext()
    X_LC = RigidTransform(CARRIED.rotation(), CARRIED.translation() - POINTS[-1])

    def pose(angles):
        plant.SetPositions(context, angles)
        return vector(before.CalcPoseInWorld(context) @ X_LC)

    return pose


@pytest.fixture(scope="module")
def rows():
    """Return derivatives 0..r of the angles at zero, one row each."""
    return np.random.default_rng(4).uniform(-1.0, 1.0, (ORDER + 1, 2))


def moved(rows, t):
    return np.array([t**k / math.factorial(k) for k in range(len(rows))]) @ rows


def test_a_workpiece_moves_as_drake_says(table, rows):
    motion = turntable_motion_function(AXES, ORDER)
    known = np.array(motion(rows.ravel())).reshape(ORDER + 1, POSE_SIZE)
    assert_derivatives(known, np.array([table(moved(rows, t)) for t in NODES]))


def test_the_derivatives_are_those_of_the_command(rows):
    """At the angles that are measured; those above the highest are zero."""
    measured = np.array([0.3, -0.2])
    block = Stepper(TurntableFrame(AXES, ORDER, 2))
    known = block.step(measured=measured, planned=rows.ravel())["frame_jet"].reshape(ORDER + 1, -1)
    both = np.vstack([measured, rows[1:3]])
    expected = np.array(turntable_motion_function(AXES, 2)(both.ravel())).reshape(3, -1)
    assert np.allclose(known[:3], expected, rtol=0, atol=1e-14)
    assert not known[3:].any()


def test_the_pose_alone_needs_no_command():
    block = Stepper(TurntableFrame(AXES, ORDER, 0))
    known = block.step(measured=np.array([0.3, -0.2]))["frame_jet"]
    assert known[:POSE_SIZE].any() and not known[POSE_SIZE:].any()


@pytest.mark.parametrize(("delay", "bound"), [(4e-3, 1e-11), (8e-3, 3e-10)])
def test_a_frame_is_extrapolated_to_the_present(table, rows, delay, bound):
    """The pose up to the derivative of order five, times ``d^5 / 120``."""
    motion = turntable_motion_function(AXES, ORDER)
    ago = [moved(rows[k:], -delay) for k in range(ORDER + 1)]
    known = np.array(motion(np.concatenate(ago))).ravel()
    advanced = Stepper(AdvancedFrame(ORDER, delay)).step(frame_jet=known)["advanced"]
    now = np.array(motion(rows.ravel())).ravel()
    assert np.abs(advanced[:POSE_SIZE] - table(moved(rows, 0.0))).max() < bound
    assert np.abs(known[:POSE_SIZE] - now[:POSE_SIZE]).max() > 1e-3
    for k in range(1, ORDER):
        rows_k = slice(POSE_SIZE * k, POSE_SIZE * (k + 1))
        off, left = ORDER + 1 - k, np.abs(now).max()
        assert np.abs(advanced - now)[rows_k].max() < 30 * left * delay**off / math.factorial(off)
