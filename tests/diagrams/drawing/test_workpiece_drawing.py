"""A workpiece with a notch, and the ball in it, in the replay of any robot."""

import numpy as np
import pytest
from pydrake.geometry import Meshcat, MeshcatParams, Sphere
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station, build_station_replay, draw_station
from diagrams.drawing.recorded import RecordedMotion
from diagrams.environment.workpieces import NotchedWorkpiece, notch_surface
from diagrams.scenario import Keyframe, Line
from diagrams.scenario.workpiece import BallParameters, NotchParameters
from experiments.scenario_file import SCENARIO_DIRECTORY

PERIOD = 0.04
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def meshcat():
    return Meshcat(MeshcatParams(host="localhost"))


@pytest.fixture
def arm_in_a_notch(load_scenario):
    settings = load_scenario("pfc_compliant_6r")
    settings.path.shape = Line([0.8, -0.05, 0.9], [0.8, 0.05, 0.9])
    settings.path.orientation.convention = "zyz"
    settings.path.orientation.keyframes = [Keyframe(0.0, [0.0, 150.0, 180.0])]
    settings.start.posture_deg = [0.0, 90.0, -30.0, 0.0, 60.0, 0.0]
    settings.reference.points = [0.0, 0.1]
    settings.notch = NotchParameters(BallParameters(distance=0.0), [0.0, 0.0, 0.0])
    return settings


def resting(station, y_t, R_e):
    """Three frames at rest."""
    pose = np.concatenate([y_t, np.ravel(R_e)])
    # six axes, or three slides
    q = station.initial_state[: station.robot.dimension]
    point = station.path.evaluator(2)(y_t.tolist(), station.initial_projection[0])
    times = PERIOD * np.arange(3)
    return RecordedMotion(times, *(np.tile(x, (3, 1)) for x in (q, pose, point)))


def replay(settings, meshcat, y_t, R_e):
    meshcat.Delete()
    station = build_station(settings, SCENARIO_DIRECTORY)
    drawing = draw_station(settings, SCENARIO_DIRECTORY, station)
    motion = resting(station, np.array(y_t), R_e)
    diagram = build_station_replay(settings, station, drawing, motion, meshcat)
    Simulator(diagram).AdvanceTo(2 * PERIOD)
    return station, diagram


def tool_pose(diagram):
    """What the tool's parts move with, between two frames."""
    context = diagram.CreateDefaultContext()
    context.SetTime(0.5 * PERIOD)
    tool = diagram.GetSubsystemByName("tool_visualizer")
    return tool.GetInputPort("tool_pose").Eval(tool.GetMyContextFromRoot(context))


@pytest.mark.slow
def test_an_arm_in_a_notch_is_drawn_with_workpiece_and_ball(arm_in_a_notch, meshcat):
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    y_t = [0.8, 0.01, 0.902]
    _, diagram = replay(arm_in_a_notch, meshcat, y_t, turned)
    assert diagram.HasSubsystemNamed("robot_visualizer")
    assert meshcat.HasPath("/drake/workpiece")
    assert meshcat.HasPath("/drake/tool/ball")
    # the ball sits at the tool point: it has no holder
    assert not meshcat.HasPath("/drake/tool/holder")
    np.testing.assert_allclose(tool_pose(diagram), [*y_t, *turned.ravel()], atol=1e-12)


@pytest.mark.slow
def test_the_ball_of_a_delta_robot_hangs_below_its_tool(load_scenario, meshcat):
    settings = load_scenario("pfc_delta_notch")
    y_t = build_station(settings, SCENARIO_DIRECTORY).path.pose(0.05)[0]
    station, diagram = replay(settings, meshcat, y_t, np.eye(3))
    np.testing.assert_allclose(tool_pose(diagram)[:3], y_t, atol=1e-12)
    for name in ("workpiece", "tool/ball", "tool/holder", "delta_robot/slide_1"):
        assert meshcat.HasPath(f"/drake/{name}")
    assert station.workpiece is not None
    assert station.workpiece.reach > settings.notch.ball.radius


def test_what_is_drawn_is_what_is_touched(arm_in_a_notch):
    notch = arm_in_a_notch.notch
    notch.ball.distance = 0.1
    path = build_station_path(arm_in_a_notch)
    look = NotchedWorkpiece(path, notch).drawing(-9.81 * UP)
    vertices, triangles = notch_surface(path, notch, UP)
    np.testing.assert_array_equal(look.surface.vertices, vertices)
    np.testing.assert_array_equal(look.surface.triangles, triangles)
    ball, holder = look.tool_parts
    assert isinstance(ball.shape, Sphere)
    assert ball.shape.radius() == notch.ball.radius
    np.testing.assert_allclose(ball.X_TP.translation(), -0.1 * UP)
    # from the tool point to the ball
    assert holder.shape.length() == pytest.approx(0.1 - notch.ball.radius)
    np.testing.assert_allclose(holder.X_TP.translation(), -0.5 * holder.shape.length() * UP)


def build_station_path(settings):
    settings.notch, notch = None, settings.notch
    path = build_station(settings, SCENARIO_DIRECTORY).path
    settings.notch = notch
    return path
