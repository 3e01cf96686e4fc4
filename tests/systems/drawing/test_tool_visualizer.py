"""A tool, its frame, its trail and the forces on it in Meshcat."""

import numpy as np
from pydrake.geometry import Rgba, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pfsc_drake.systems.drawing.tool_visualizer import ToolPart, ToolVisualizer

COLOR = Rgba(0.2, 0.4, 0.6)


class MeshcatSpy:
    """Records drawings; the last transform of every path with its time."""

    def __init__(self):
        self.objects, self.transforms = {}, {}

    def SetObject(self, path, shape, color):
        self.objects[path] = (shape, color)

    def SetTransform(self, path, X, time_in_recording=None):
        self.transforms[path] = (X, time_in_recording)


def test_parts_move_with_the_tool():
    """Halfway between two frames a quarter turn apart it has turned by an eighth."""
    turned = RollPitchYaw(0.0, 0.0, np.pi / 2.0).ToRotationMatrix().matrix()
    poses = [[0.0, 0, 1, *np.eye(3).ravel()], [0.4, 0, 1, *turned.ravel()]]
    X_TP = RigidTransform([0.0, 0.0, -0.1])
    spy, builder = MeshcatSpy(), DiagramBuilder()
    moving = PiecewisePolynomial.FirstOrderHold([0.0, 0.2], np.array(poses).T)
    source = builder.AddSystem(TrajectorySource(moving))
    tool = builder.AddSystem(
        ToolVisualizer([ToolPart("ball", Sphere(0.02), COLOR, X_TP)], spy, period=0.1)
    )
    builder.Connect(source.get_output_port(), tool.GetInputPort("tool_pose"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.11)
    shape, color = spy.objects["tool/ball"]
    assert (shape.radius(), color) == (0.02, COLOR)
    X, time = spy.transforms["tool/ball"]
    assert X.IsExactlyEqualTo(X_TP)
    assert time is None
    X_WT, time = spy.transforms["tool"]
    assert time == 0.1
    np.testing.assert_allclose(X_WT.translation(), [0.2, 0.0, 1.0], atol=1e-12)
    yaw = X_WT.rotation().ToRollPitchYaw().vector()
    np.testing.assert_allclose(yaw, [0.0, 0.0, np.pi / 4.0], atol=1e-12)
