"""A recorded motion in Meshcat."""

import base64
import re
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.systems.analysis import Simulator

from diagrams.drawing.recorded import RecordedMotion, RecordedPushes
from diagrams.drawing.replay import (
    Playback,
    camera_and_target,
    record,
)
from diagrams.drawing.robot_geometry import draw_robot
from diagrams.scenario import Line, PathParameters, RobotParameters
from diagrams.tasks.drawing import PathDrawing
from diagrams.tasks.task_geometry import make_path
from pfsc_drake.geometry import PathPointLayout

MODEL = "comau_racer_1_4_elastic_3r"
PERIOD = 0.04
LAYOUT = PathPointLayout(2, oriented=False)
MOVING = ("path_following/trail", "elbow/trail", "push/1", "push/1/shaft")
DRAWING = ("path", "frame", "frame/axis_0", "frame/axis_1", "frame/axis_2")


@pytest.fixture(scope="module")
def meshcat():
    return Meshcat(MeshcatParams(host="localhost"))


@pytest.fixture(scope="module")
def path():
    return make_path(PathParameters(Line([0.8, 0.0, 1.0], [0.8, 0.3, 1.0])), "rigid", None)


@pytest.fixture(scope="module")
def motion(path):
    """Four frames: the first motor turns by 0.3 rad, the tool goes along the path."""
    times = PERIOD * np.arange(4)
    positions = np.zeros((4, 6))
    positions[:, 0] = np.linspace(0.0, 0.3, 4)
    evaluator = path.evaluator(2)
    points = [evaluator([0.8, 0.1 * i, 1.0], 0.1 * i) for i in range(4)]
    poses = [np.concatenate([[0.8, 0.1 * i, 1.0], np.eye(3).ravel()]) for i in range(4)]
    elbow = np.array([[0.4, 0.05 * i, 0.9] for i in range(4)])
    forces = np.outer([0.0, 1.0, 2.0, 0.0], [0.0, 20.0, 0.0])
    pushes = RecordedPushes(elbow, forces)
    return RecordedMotion(times, positions, np.array(poses), np.array(points), elbow, pushes)


@pytest.fixture
def build(path, motion, meshcat, load_arm):
    def built():
        meshcat.Delete()
        arm = load_arm(MODEL)
        drawing = draw_robot(arm.plant, arm.tool, RobotParameters(MODEL), Path())
        return Playback(motion, meshcat, PERIOD).build(drawing, PathDrawing(path, LAYOUT))

    return built


def test_draws_robot_path_and_frame(build, motion, meshcat):
    simulator = Simulator(build())
    simulator.Initialize()
    assert meshcat.HasPath(f"/drake/visualizer/{MODEL}/link_3")
    for name in DRAWING:
        assert meshcat.HasPath(f"/drake/path_following/{name}")
    assert not meshcat.HasPath("/drake/path_following/trail")
    simulator.AdvanceTo(motion.times[-1])
    assert meshcat.HasPath("/drake/path_following/trail")
    assert meshcat.HasPath("/drake/elbow/trail")
    assert meshcat.HasPath("/drake/push/1/shaft/cylinder")


def test_robot_is_drawn_from_the_recorded_positions(build):
    diagram = build()
    context = diagram.CreateDefaultContext()
    context.SetTime(1.5 * PERIOD)  # halfway between two frames
    robot = diagram.GetSubsystemByName("robot_visualizer")
    positions = robot.GetInputPort("positions").Eval(robot.GetMyContextFromRoot(context))
    np.testing.assert_allclose(positions, [0.15, 0, 0, 0, 0, 0], atol=1e-12)


def test_recording_is_one_page_with_the_animation(build, motion, meshcat):
    page = record(build(), meshcat, motion.times[-1], PERIOD)
    assert "</html>" in page
    assert not re.search(r'<script[^>]+src="http', page)
    chunks = [
        base64.b64decode(chunk)
        for chunk in re.findall(r"data:application/octet-binary;base64,([A-Za-z0-9+/=]+)", page)
    ]
    (animation,) = [chunk for chunk in chunks if b"set_animation" in chunk]
    for name in (f"visualizer/{MODEL}/link_3", "path_following/frame", *MOVING):
        assert name.encode() in animation
    path_line = [chunk for chunk in chunks if b"path_following/path" in chunk]
    assert path_line


@pytest.mark.parametrize("hanging", [False, True])
@pytest.mark.parametrize("azimuth", [0.0, 2.5])
def test_camera_sees_robot_and_path(hanging, azimuth):
    """Wherever the robot stands and reaches; Meshcat's camera sees 75 deg from top to bottom."""
    turn = np.array(
        [
            [np.cos(azimuth), -np.sin(azimuth), 0.0],
            [np.sin(azimuth), np.cos(azimuth), 0.0],
            [0.0, 0.0, -1.0 if hanging else 1.0],
        ]
    )
    base = np.array([1.0, -2.0, 3.0 if hanging else 0.0])
    bodies = base + np.array([[0, 0, 0], [0, 0, 0.4], [0.1, 0, 1.1], [0.9, 0, 1.0]]) @ turn.T
    points = base + np.array([[0.8, y, 0.5] for y in (-0.4, 0.0, 0.4)]) @ turn.T
    camera, target = camera_and_target(points, bodies)
    axis = (target - camera) / np.linalg.norm(target - camera)
    rays = np.vstack([bodies, points]) - camera
    angles = np.degrees(np.arccos(rays @ axis / np.linalg.norm(rays, axis=1)))
    assert angles.max() < 37.5
    assert angles.max() > 15.0  # not from afar either
    # the path is before the robot, to its right
    right = np.cross(axis, [0.0, 0.0, 1.0])
    assert np.mean(points @ right) > base @ right
    assert np.linalg.norm(points.mean(axis=0) - camera) < np.linalg.norm(base - camera)
