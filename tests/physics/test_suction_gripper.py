"""A gripper that takes a plate from a shelf, carries it and lets it fall."""

import numpy as np
import pytest
from pydrake.geometry import Box, SceneGraph, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput

from pfsc_drake.physics.suction import SuctionGripper, SuctionParameters
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.plants.applied_wrenches import AppliedForces

MASS, SIZE, PERIOD = 0.8, (0.24, 0.16, 0.01), 1e-3
DOWN = RotationMatrix.MakeXRotation(np.pi)
SHELF = 0.5  # m, height of its top
FACE = SHELF + SIZE[2]
# pressed by 0.5 mm, lifted by 5 cm; the vacuum is on from 0.1 to 0.8 s
TIMES, HEIGHTS = [0.0, 0.2, 0.3, 0.6], [FACE + 2e-3, FACE - 5e-4, FACE - 5e-4, FACE + 0.05]
BEGIN, END = 0.1, 0.8


class Script(LeafSystem):
    """A tool that moves up and down, and a vacuum."""

    def __init__(self):
        super().__init__()
        everything = {self.time_ticket()}
        self.DeclareVectorOutputPort("tool_motion", 18, self._motion, everything)
        self.DeclareVectorOutputPort("vacuum", 1, self._vacuum, everything)

    def _motion(self, context, output):
        t = context.get_time()
        height = np.interp(t, TIMES, HEIGHTS)
        rate = (np.interp(t + 1e-6, TIMES, HEIGHTS) - height) / 1e-6
        output.SetFromVector(
            [0, 0, height, *DOWN.matrix().ravel(), 0, 0, rate, 0, 0, 0],
        )

    def _vacuum(self, context, output):
        output.SetFromVector([float(BEGIN <= context.get_time() < END)])


@pytest.fixture(name="log", scope="module")
def fixture_log():
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(PERIOD))
    scene_graph = builder.AddSystem(SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    inertia = SpatialInertia.SolidBoxWithMass(MASS, *SIZE)
    plate = plant.AddRigidBody("plate", inertia.Shift([0, 0, -SIZE[2] / 2.0]))
    friction = CoulombFriction(0.2, 0.2)
    for i, (x, y) in enumerate([(0.1, 0.07), (0.1, -0.07), (-0.1, 0.07), (-0.1, -0.07)]):
        support = RigidTransform([x, y, SIZE[2] - 2e-3])
        plant.RegisterCollisionGeometry(plate, support, Sphere(2e-3), f"foot_{i}", friction)
    shelf = RigidTransform([0, 0, SHELF - 0.05])
    plant.RegisterCollisionGeometry(
        plant.world_body(), shelf, Box(1.0, 1.0, 0.1), "shelf", friction
    )
    plant.Finalize()
    plant.SetDefaultFloatingBaseBodyPose(plate, RigidTransform(DOWN, [0.01, 0.0, FACE]))
    pose = scene_graph.get_source_pose_port(plant.get_source_id())
    builder.Connect(plant.get_geometry_pose_output_port(), pose)
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    script = builder.AddSystem(Script())
    cups = SuctionGripper(SuctionParameters(), np.array(SIZE[:2]) / 2.0, 1)
    gripper = builder.AddSystem(BlockSystem(cups, PERIOD))
    pushes = builder.AddSystem(AppliedForces([plate.index()]))
    for name in ("tool_motion", "vacuum"):
        builder.Connect(script.GetOutputPort(name), gripper.GetInputPort(name))
    builder.Connect(plant.get_state_output_port(), gripper.GetInputPort("plate_state"))
    applied = plant.get_applied_spatial_force_input_port()
    builder.Connect(gripper.GetOutputPort("pushes"), pushes.get_input_port())
    builder.Connect(pushes.get_output_port(), applied)
    sinks = {
        "held": LogVectorOutput(gripper.GetOutputPort("held"), builder, PERIOD),
        "wrench": LogVectorOutput(gripper.GetOutputPort("wrench"), builder, PERIOD),
        "state": LogVectorOutput(plant.get_state_output_port(), builder, PERIOD),
    }
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.0)
    logs = {name: sink.FindLog(simulator.get_context()) for name, sink in sinks.items()}
    return {"t": logs["held"].sample_times()} | {k: log.data().T for k, log in logs.items()}


def at(time):
    return round(time / PERIOD)


def test_it_takes_hold_when_pressed_and_lets_go_with_the_vacuum(log):
    share = log["held"][:, 0]
    change = log["t"][np.flatnonzero(np.diff(share)) + 1]
    assert len(change) == 2
    assert 0.1 < change[0] < 0.2  # on the way down, before the tool stops
    assert change[1] == pytest.approx(END, abs=2.0 * PERIOD)
    assert share[at(0.5)] == 1.0


def test_the_plate_moves_with_the_tool(log):
    height = log["state"][:, 6]
    assert height[at(0.15)] == pytest.approx(FACE, abs=1e-5)
    # it hangs where it was gripped, lowered by its weight on four cups
    lowered = MASS * 9.81 / (4.0 * SuctionParameters().stiffness)
    assert height[at(0.79)] == pytest.approx(FACE + 0.05 - lowered, abs=2e-5)


def test_it_carries_the_weight(log):
    wrench = log["wrench"][at(0.79)]
    np.testing.assert_allclose(wrench[:3], [0, 0, -MASS * 9.81], atol=0.02)
    # the plate's middle is 1 cm in front of the tool
    np.testing.assert_allclose(wrench[3:], [0, 0.01 * MASS * 9.81, 0], atol=2e-3)


def test_then_the_plate_falls(log):
    fall = log["t"][-1] - END
    dropped = log["state"][at(END), 6] - log["state"][at(END + 0.08), 6]
    assert dropped == pytest.approx(9.81 / 2.0 * 0.08**2, rel=0.05)
    assert fall > 0.08
    assert not log["wrench"][at(END + 0.02) :].any()
