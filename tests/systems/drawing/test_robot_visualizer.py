"""Parts of a robot in Meshcat, and their poses."""

import numpy as np
import pytest
from pydrake.geometry import Box, Meshcat, MeshcatParams, Rgba
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pfsc_drake.systems.drawing.robot_visualizer import (
    BodyPart,
    RobotVisualizer,
    Triangles,
    body_path,
)

COLOR = Rgba(0.2, 0.4, 0.6)


class MeshcatSpy:
    """Records drawings; the last transform of every path with its time."""

    def __init__(self):
        self.objects, self.meshes, self.transforms = {}, {}, {}

    def SetObject(self, path, shape, color):
        self.objects[path] = (shape, color)

    def SetTriangleMesh(self, path, vertices, faces, color):
        self.meshes[path] = (vertices, faces, color)

    def SetTransform(self, path, X, time_in_recording=None):
        self.transforms[path] = (X, time_in_recording)


@pytest.fixture(scope="module")
def plant():
    """A crank about z that carries a slide along x, 0.5 m out."""
    plant = MultibodyPlant(0.0)
    model = plant.AddModelInstance("arm")
    inertia = SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1)
    crank = plant.AddRigidBody("crank", model, inertia)
    slide = plant.AddRigidBody("slide", model, inertia)
    outer = FixedOffsetFrame("wrist", crank.body_frame(), RigidTransform([0.5, 0, 0]), model)
    shoulder, wrist = plant.world_frame(), plant.AddFrame(outer)
    plant.AddJoint(RevoluteJoint("turn", shoulder, crank.body_frame(), [0, 0, 1]))
    plant.AddJoint(PrismaticJoint("move", wrist, slide.body_frame(), [1, 0, 0]))
    plant.Finalize()
    return plant


@pytest.fixture
def parts(plant):
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    X_BP = RigidTransform([0.1, 0.2, 0.3])
    crank, slide = plant.GetBodyByName("crank"), plant.GetBodyByName("slide")
    return [
        BodyPart(crank, "bar", Box(0.5, 0.1, 0.1), X_BP, COLOR),
        BodyPart(slide, "plate", Triangles(corners, np.array([[0, 1, 2]]))),
    ]


def play(meshcat, plant, parts, *positions):
    """Draw a motion of half a second."""
    builder = DiagramBuilder()
    times = np.linspace(0.0, 0.5, len(positions))
    motion = PiecewisePolynomial.FirstOrderHold(times, np.array(positions).T)
    source = builder.AddSystem(TrajectorySource(motion))
    visualizer = builder.AddSystem(RobotVisualizer(plant, parts, meshcat, 0.125))
    builder.Connect(source.get_output_port(), visualizer.GetInputPort("positions"))
    Simulator(builder.Build()).AdvanceTo(0.5)


def test_parts_are_drawn_with_their_bodies(plant, parts):
    spy = MeshcatSpy()
    play(spy, plant, parts, [0.0, 0.0], [np.pi / 2.0, 0.2])
    shape, color = spy.objects["visualizer/arm/crank/bar"]
    assert isinstance(shape, Box) and color == COLOR
    X, time = spy.transforms["visualizer/arm/crank/bar"]
    np.testing.assert_array_equal(X.translation(), [0.1, 0.2, 0.3])
    assert time is None  # fixed to its body
    vertices, faces, _ = spy.meshes["visualizer/arm/slide/plate"]
    np.testing.assert_array_equal(vertices[:, 1], [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(faces, [[0], [1], [2]])
    X_WC, time = spy.transforms["visualizer/arm/crank"]
    np.testing.assert_allclose(X_WC.rotation().col(0), [0.0, 1.0, 0.0], atol=1e-12)
    assert time == 0.5
    X_WS, time = spy.transforms["visualizer/arm/slide"]
    np.testing.assert_allclose(X_WS.translation(), [0.0, 0.7, 0.0], atol=1e-12)
    assert time == 0.5


def test_meshcat_takes_it(plant, parts):
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    play(meshcat, plant, parts, [0.0, 0.0], [0.1, 0.1])
    for part in parts:
        assert meshcat.HasPath(f"{body_path(plant, part.body)}/{part.name}")
