"""Shapes of the DELTA robot and what reaches Meshcat."""

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pfsc_drake.robot.delta.delta_parameters import load_delta_parameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.shapes import robot_parts, rod_poses, rod_shape, slide_origins
from pfsc_drake.systems.drawing.robot_visualizer import DeltaVisualizer, turn_scene_over

ROBOT = DeltaRobot(load_delta_parameters())
GEOMETRY = ROBOT.parameters.geometry
Q = np.array([0.12, 0.24, 0.18])


def test_rods_run_from_the_slides_to_the_plate():
    y_t = ROBOT.tool_position(Q)
    half = np.array([0.0, 0.0, rod_shape(GEOMETRY).length() / 2.0])
    poses = rod_poses(GEOMETRY, Q, y_t)
    for i, B in enumerate(slide_origins(GEOMETRY, Q)):
        pair = poses[2 * i : 2 * i + 2]
        C = y_t + GEOMETRY.l_EC * GEOMETRY.directions[i]
        upper = [pose @ -half for pose in pair]
        lower = [pose @ half for pose in pair]
        # parallelogram: both sides are equal vectors across the rail, in the base's plane
        assert np.allclose(upper[1] - upper[0], lower[1] - lower[0], rtol=0, atol=1e-12)
        side = upper[1] - upper[0]
        assert abs(side @ GEOMETRY.directions[i]) < 1e-12 and abs(side[2]) < 1e-12
        assert np.allclose(np.mean(upper, axis=0), B, rtol=0, atol=1e-12)
        assert np.allclose(np.mean(lower, axis=0), C, rtol=0, atol=1e-12)


def test_slides_start_at_the_base_and_move_towards_P():
    at_base = slide_origins(GEOMETRY, np.zeros(3))
    assert np.allclose(at_base, GEOMETRY.l_A * GEOMETRY.directions, rtol=0, atol=1e-15)
    at_P = slide_origins(GEOMETRY, np.full(3, GEOMETRY.rail_length))
    assert np.allclose(at_P, [0.0, 0.0, GEOMETRY.h_P], rtol=0, atol=1e-15)


def test_parts_have_unique_names_and_known_carriers():
    parts = robot_parts(ROBOT.parameters)
    assert len({part.name for part in parts}) == len(parts) == 20
    assert {part.carrier for part in parts} == {"base", "end_effector", *ROBOT.names}


class MeshcatSpy:
    """Records drawings; the last transform of every path with its time."""

    def __init__(self):
        self.objects, self.transforms = set(), {}

    def SetObject(self, path, shape, color):
        self.objects.add(path)

    def SetTransform(self, path, X, time_in_recording=None):
        self.transforms[path] = (X, time_in_recording)


def animate(meshcat, positions):
    """Draw a motion through two slide positions in half a second."""
    builder = DiagramBuilder()
    motion = PiecewisePolynomial.FirstOrderHold([0.0, 0.5], np.array(positions).T)
    source = builder.AddSystem(TrajectorySource(motion))
    visualizer = builder.AddSystem(DeltaVisualizer(ROBOT, meshcat, 0.125))
    builder.Connect(source.get_output_port(), visualizer.GetInputPort("slide_positions"))
    Simulator(builder.Build()).AdvanceTo(0.5)


def test_every_part_is_drawn_where_it_is_and_when():
    spy, end = MeshcatSpy(), Q + 0.05
    animate(spy, [Q, end])
    for part in robot_parts(ROBOT.parameters):
        path = f"delta_robot/{part.carrier}/{part.name}"
        assert path in spy.objects
        X, time = spy.transforms[path]
        assert X.IsExactlyEqualTo(part.X_CS) and time is None
    y_t = ROBOT.tool_position(end)
    origins = slide_origins(GEOMETRY, end)
    expected = {f"delta_robot/{name}": p for name, p in zip(ROBOT.names, origins, strict=True)}
    expected["delta_robot/end_effector"] = y_t
    for i, pose in enumerate(rod_poses(GEOMETRY, end, y_t)):
        assert f"delta_robot/rod_{i + 1}" in spy.objects
        expected[f"delta_robot/rod_{i + 1}"] = pose.translation()
    for path, position in expected.items():
        X, time = spy.transforms[path]
        assert np.allclose(X.translation(), position, rtol=0, atol=1e-12)
        assert time == 0.5
    assert len(spy.transforms) == 20 + len(expected)


def test_a_robot_that_cannot_be_drawn_stays_where_it_was():
    spy = MeshcatSpy()
    animate(spy, [Q, Q * np.nan])
    times = [time for _, time in spy.transforms.values() if time is not None]
    assert max(times, default=0.0) == 0.0


def test_meshcat_takes_it():
    meshcat = Meshcat()
    turn_scene_over(meshcat, 1.2)
    animate(meshcat, [Q, Q + 0.05])
    for part in robot_parts(ROBOT.parameters):
        assert meshcat.HasPath(f"delta_robot/{part.carrier}/{part.name}")
    assert all(meshcat.HasPath(f"delta_robot/rod_{i + 1}") for i in range(6))


def test_z_0_points_down_in_the_scene():
    spy = MeshcatSpy()
    turn_scene_over(spy, 1.2)
    X_WI, _ = spy.transforms["/drake"]
    assert np.allclose(X_WI @ np.array([0.1, 0.0, 0.5]), [0.1, 0.0, 0.7], rtol=0, atol=1e-15)
