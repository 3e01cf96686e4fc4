"""Two arms in Meshcat: drawings on the workpiece move with it."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.systems.analysis import Simulator

from diagrams.drawing.moving_workpiece_drawing import MovingWorkpieceDrawing
from diagrams.drawing.recorded import RecordedHolder, RecordedMotion
from diagrams.drawing.replay import Playback
from diagrams.drawing.robot_geometry import draw_robot
from diagrams.scenario import (
    HolderWorkpiece,
    Line,
    PathParameters,
    RobotParameters,
    SolidParameters,
)
from diagrams.scenario.robot import PoseParameters
from diagrams.tasks.drawing import PathDrawing
from diagrams.tasks.task_geometry import make_path
from pfsc_drake.geometry import PathPointLayout, zyx_to_matrix

MODEL, PERIOD = "comau_racer_1_4_elastic_3r", 0.04
WORKPIECE = HolderWorkpiece(
    solids=[
        SolidParameters(box=[0.2, 0.1, 0.05]),
        SolidParameters(cylinder=[0.03, 0.3], pose=PoseParameters(position=[0.0, 0.0, 0.2])),
    ]
)


@pytest.fixture
def holder():
    """Three frames: the workpiece rises and turns about z."""
    turned = [zyx_to_matrix([0.2 * k, 0.0, 0.0]).ravel() for k in range(3)]
    poses = [np.append([0.9, 0.1, 0.5 + 0.1 * k], R) for k, R in enumerate(turned)]
    return RecordedHolder(np.zeros((3, 6)), np.array(poses))


def test_points_at_the_first_pose_of_the_workpiece(holder):
    holder.workpiece_pose[0, 3:] = zyx_to_matrix([0.5 * np.pi, 0.0, 0.0]).ravel()
    (placed,) = holder.first_points(np.array([[0.1, 0.0, 0.02]]))
    assert np.allclose(placed, [0.9, 0.2, 0.52], rtol=0, atol=1e-15)


def test_everything_on_the_workpiece_moves_with_it(holder, load_arm):
    path = make_path(PathParameters(Line([0.0, 0.0, 0.1], [0.0, 0.1, 0.1])), "rigid", None)
    arm, other = load_arm(MODEL), load_arm(MODEL)
    drawing = draw_robot(arm.plant, arm.tool, RobotParameters(MODEL), Path())
    moving = MovingWorkpieceDrawing(
        WORKPIECE, draw_robot(other.plant, other.tool, RobotParameters(MODEL), Path())
    )
    evaluator = path.evaluator(2)
    points = np.array([evaluator([0.0, 0.04 * k, 0.1], 0.0) for k in range(3)])
    tool = np.array([np.append([0.0, 0.04 * k, 0.1], np.eye(3)) for k in range(3)])
    force = np.tile([0.0, 0.0, 60.0], (3, 1))
    motion = RecordedMotion(
        PERIOD * np.arange(3), np.zeros((3, 6)), tool, points, tool_force=force, holder=holder
    )
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    layout = PathPointLayout(2, oriented=False)
    diagram = Playback(motion, meshcat, PERIOD).build(
        drawing, PathDrawing(path, layout), moving=moving
    )
    simulator = Simulator(diagram)
    simulator.AdvanceTo(2 * PERIOD)
    root = "/drake/path_following"
    for drawn in ("solid_0", "solid_1", "path", "frame", "trail"):
        assert meshcat.HasPath(f"{root}/{drawn}")
    assert meshcat.HasPath(f"/drake/visualizer/{MODEL}/link_3")
    assert meshcat.HasPath(f"/drake/holder/{MODEL}/link_3")
    # the last message to the browser
    X_WC = system_pose(diagram, simulator)
    assert np.allclose(X_WC[:3], [0.9, 0.1, 0.7], rtol=0, atol=1e-12)
    # forces have world axes, and act at the tool's position in the world
    arrows = diagram.GetSubsystemByName("tool_force_arrows")
    context = arrows.GetMyContextFromRoot(simulator.get_context())
    point = zyx_to_matrix([0.4, 0.0, 0.0]) @ [0.0, 0.08, 0.1] + X_WC[:3]
    assert np.allclose(arrows.GetInputPort("points").Eval(context), point, rtol=0, atol=1e-12)


def system_pose(diagram, simulator):
    """Return the drawn pose of the workpiece."""
    system = diagram.GetSubsystemByName("path_following_moving")
    return system.GetInputPort("tool_pose").Eval(
        system.GetMyContextFromRoot(simulator.get_context())
    )
