"""Recording of an excitation in Meshcat: the robot in its cell and its end effector's path."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams, Rgba
from pydrake.systems.framework import DiagramBuilder

from diagrams.drawing.replay import add_source, arrange_scene, camera_and_target, record
from diagrams.drawing.robot_geometry import draw_robot
from diagrams.robots.model import read_robot
from identification.excitation.balls import ends
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.run_in import ExcitationRun
from identification.excitation.scene import Cell, obstacle_shape, removed_tool_name
from identification.model.subject import Subject, tool_frame_of
from identification.output import write_text
from pfsc_drake import jets
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.drawing.robot_visualizer import DeltaVisualizer, RobotVisualizer
from pfsc_drake.systems.drawing.tool_visualizer import TrailVisualizer

_TRAIL = Rgba(0.9, 0.25, 0.1, 1.0)
_OBSTACLE = Rgba(0.55, 0.58, 0.62, 0.4)


def record_excitation(
    subject: Subject,
    motion: FourierTrajectory | ExcitationRun,
    path: str | Path | None = None,
    cell: Cell | None = None,
    frame_rate: float = 25.0,
) -> str:
    """Return one period, or a run, as a page that plays it in a browser, and write it.

    Args:
        subject: The robot.
        motion: Motion of its joints.
        path: File of the page, which is replaced; None for none.
        cell: Environment of a serial robot.
        frame_rate: Frames per second [1/s].

    Raises:
        InputError: If joints are too few or too many, the rate is not positive or the file cannot
            be written.
    """
    if not 0.0 < frame_rate < np.inf:
        raise InputError(f"frame_rate = {frame_rate!r} Hz; must be a positive number")
    if isinstance(motion, ExcitationRun):
        trajectory, duration = motion.trajectory, motion.duration
    else:
        trajectory, duration = motion, motion.period
    if trajectory.dimension != subject.dimension:
        raise InputError(
            f"excitation: of {trajectory.dimension} joints; {subject.name} has {subject.dimension}"
        )
    times = np.linspace(0.0, duration, max(2, round(duration * frame_rate) + 1))
    q, _, _ = motion.motion(times)
    meshcat, period = Meshcat(MeshcatParams(host="localhost")), float(times[1])
    builder = DiagramBuilder()
    tool_points = _tool_points(subject, q)
    if subject.delta is not None:
        arrange_scene(tool_points[:, 2], meshcat)
        visualizer = DeltaVisualizer(subject.delta, meshcat, period)
        positions, port = q, visualizer.GetInputPort("slide_positions")
    else:
        visualizer, positions = _serial_robot(subject, q, meshcat, period)
        port = visualizer.GetInputPort("positions")
        meshcat.SetCameraPose(*camera_and_target(tool_points, np.zeros((1, 3))))
        for obstacle in cell.obstacles if cell is not None else ():
            pose, shape = obstacle_shape(obstacle)
            meshcat.SetObject(f"cell/{obstacle.name}", shape, _OBSTACLE)
            meshcat.SetTransform(f"cell/{obstacle.name}", pose)
    builder.AddNamedSystem("robot_visualizer", visualizer)
    builder.Connect(add_source(builder, "positions", times, positions), port)
    trail = builder.AddNamedSystem("trail", TrailVisualizer("tool", _TRAIL, meshcat, period))
    tool_point = add_source(builder, "tool_point", times, tool_points)
    builder.Connect(tool_point, trail.GetInputPort("point"))
    page = record(builder.Build(), meshcat, duration, period)
    if path is not None:
        write_text(Path(path), page)
    return page


def _serial_robot(
    subject: Subject, q: np.ndarray, meshcat: Meshcat, period: float
) -> tuple[RobotVisualizer, np.ndarray]:
    """Return the drawing of a serial robot, and its plant's positions, shape (K, nq)."""
    if subject.block is None:
        raise InputError(f"{subject.name}: cannot be drawn without a model")
    plant, _ = read_robot(subject.block, subject.folder)
    tool = tool_frame_of(plant, subject.block)
    _, coordinates = chain_from_plant(plant, tool)
    drawing = draw_robot(plant, tool, subject.block, subject.folder)
    parts = [part for part in drawing.parts if part.body.name() != removed_tool_name(subject)]
    states = np.concatenate([q, np.zeros_like(q)] * 2, axis=1)
    positions = [coordinates.plant_state(state)[: plant.num_positions()] for state in states]
    return RobotVisualizer(plant, parts, meshcat, period), np.array(positions)


def _tool_points(subject: Subject, q: np.ndarray) -> np.ndarray:
    """Return the end effector's positions for a series of postures [m], shape (K, 3)."""
    joints = ca.SX.sym("q", subject.dimension)
    still = [jets.constant(joints[i], 1) for i in range(subject.dimension)]
    robot = subject.robot
    if subject.chain is not None:
        robot = replace(subject.chain, p_LT=list(ends(subject).values())[-1])
    y_t, _ = robot.tool_pose(still)
    function = ca.Function("tool", [joints], [ca.densify(y_t.coefficients[0])])
    return np.array(function.map(len(q))(q.T)).T
