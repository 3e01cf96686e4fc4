"""A path on a turntable, followed in a user's own diagram."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from pfsc_drake import (
    FollowerOptions,
    WaypointTable,
    add_path_following,
    path_from_waypoints,
    rest_to_rest,
)
from pfsc_drake.controller.moving_start import target_in_world
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_quaternion
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.robot.models.files import models_directory

CENTER = np.array([0.9, 0.0, 0.7])
SPEED = 0.8  # rad/s
K = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
END = 0.8


def turntable(t, order):
    """Return the frame jet of a table that turns at a constant speed about a vertical axis."""
    c, s = math.cos(SPEED * t), math.sin(SPEED * t)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rows = []
    for k in range(order + 1):
        turned = np.linalg.matrix_power(SPEED * K, k) @ R
        rows.append(np.append(CENTER if k == 0 else np.zeros(3), turned))
    return np.concatenate(rows)


class Table(LeafSystem):
    """Source of the table's motion, up to an order, of another length."""

    def __init__(self, order, told):
        super().__init__()
        self._told = 12 * (told + 1)
        size = 12 * (order + 1)
        self.DeclareVectorOutputPort(
            "frame_jet",
            size,
            lambda c, y: y.SetFromVector(
                np.where(np.arange(size) < self._told, turntable(c.get_time(), order), 0.0)
            ),
        )


@pytest.fixture(scope="module", name="path")
def fixture_path():
    """A closed line around the table's centre, in its frame, the tool upright."""
    points = [[0.15, 0.0, 0.1], [0.0, 0.12, 0.12], [-0.1, 0.0, 0.1], [0.0, -0.12, 0.08]]
    upright = zyx_to_quaternion(np.tile([np.pi, -0.2, 0.0], (4, 1)))
    table = WaypointTable(np.array(points), upright)
    return path_from_waypoints(table, smoothness=5, closed=True)


def deviation(path, law, told, model="comau_racer_1_4"):
    """Return the largest distance of the tool from the path on the table, by Drake's plant."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(models_directory() / "comau_racer_1_4" / f"{model}.sdf"))
    plant.Finalize()
    motion = rest_to_rest([0.0, path.length], velocity=0.3, acceleration=1.5)
    options = FollowerOptions(bandwidth=40.0, frame=turntable(0.0, 0))
    follower = add_path_following(
        builder, plant, "tool_point", path, law, motion=motion, options=options
    )
    order = follower.law.linearization.relative_degree
    table = builder.AddSystem(Table(order, order if told is None else told))
    builder.Connect(table.get_output_port(), follower.GetInputPort("frame_jet"))
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    plant.SetPositionsAndVelocities(context, follower.start_state)
    largest, tool = [], plant.GetFrameByName("tool_point")
    for t in np.arange(0.0, END + 1e-9, 0.05):
        simulator.AdvanceTo(t)
        pose = turntable(t, 0)
        y = pose[3:].reshape(3, 3).T @ (tool.CalcPoseInWorld(context).translation() - pose[:3])
        foot = path.position.derivatives(path.nearest(y), 0)[0]
        largest.append(np.linalg.norm(y - foot))
    fault = follower.GetOutputPort("fault").Eval(follower.GetMyContextFromRoot(root))[0]
    assert fault == 0
    # the tool is at rest at first, and the table is not
    assert largest[0] < 1e-9
    return max(largest[len(largest) // 2 :])


@pytest.mark.slow
def test_a_path_on_a_turntable(path):
    """From rest beside a table that turns on: the tool catches up, and stays."""
    exact = deviation(path, "rigid", None)
    assert exact < 1e-5
    assert deviation(path, "rigid", 1) > 5.0 * exact


def test_wrong_frames_are_refused(path):
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    file = models_directory() / "comau_racer_1_4" / "comau_racer_1_4.sdf"
    Parser(plant).AddModels(str(file))
    plant.Finalize()

    def refused(said, **changes):
        options = FollowerOptions(**({"frame": turntable(0.0, 0)} | changes))
        with pytest.raises(InputError, match=said):
            add_path_following(builder, plant, "tool_point", path, "rigid", options=options)

    refused("frame: shape .24,.; must be", frame=turntable(0.0, 1))
    refused("frame", frame=2.0 * turntable(0.0, 0))
    yielding = ComplianceParameters()
    yielding.tangential.stiffness.value = 0.0
    refused("frame: given; must be None if the tool complies", compliance=yielding)


def test_a_target_in_a_tilted_frame_is_transformed_with_its_yaw_axis():
    X_WC = RigidTransform(RollPitchYaw(0.4, -0.7, 1.1), CENTER)
    R_Ce = RotationMatrix(RollPitchYaw(0.2, 0.5, -0.3))
    yaw_axis = np.array([0.6, 0.0, 0.8])
    target = ToolTarget(np.array([0.1, -0.2, 0.3]), R_Ce.matrix(), yaw_axis=yaw_axis)
    frame = np.concatenate([CENTER, X_WC.rotation().matrix().ravel()])
    found = target_in_world(target, frame)
    np.testing.assert_allclose(found.y_t, X_WC @ target.y_t, atol=1e-15)
    np.testing.assert_allclose(found.R_e, (X_WC.rotation() @ R_Ce).matrix(), atol=1e-15)
    np.testing.assert_allclose(found.yaw_axis, X_WC.rotation() @ target.yaw_axis, atol=1e-15)
    bare = target_in_world(ToolTarget(target.y_t), frame)
    assert bare.R_e is None and bare.yaw_axis is None
