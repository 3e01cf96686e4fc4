"""A logged run in Meshcat: robot, path, moving frame and trail of the tool; a DELTA robot hangs."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from diagrams.drawing.held_look import HeldLook, add_held_drawing, held_points
from diagrams.drawing.mounting_look import MountingLook, add_mounting_drawing
from diagrams.drawing.recorded import RecordedMotion, RecordedPushes
from diagrams.drawing.robot_geometry import RobotDrawing
from diagrams.robots.workpiece import WorkpieceLook
from diagrams.tasks.drawing import ManifoldDrawing, add_workpiece_drawing, look_down_at
from pfsc_drake.geometry.rotation import placed_points
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.systems.drawing.manifold_visualizer import signed_color
from pfsc_drake.systems.drawing.obstacle_visualizer import ObstacleVisualizer
from pfsc_drake.systems.drawing.robot_visualizer import (
    DeltaVisualizer,
    RobotVisualizer,
    turn_scene_over,
)
from pfsc_drake.systems.drawing.tool_visualizer import ForceArrows, TrailVisualizer

# towards the camera if the path is in front of the robot, and its distance beside what is seen
_VIEW = np.array([0.53, -0.79, 0.31])
_DISTANCE = 0.95
_TOOL, _ELBOW = Rgba(0.9, 0.25, 0.1, 1.0), Rgba(0.45, 0.2, 0.75, 1.0)
# m, between the path's lowest point and the grid
_CLEARANCE = 0.15


def build_replay(
    robot: RobotDrawing,
    manifold: ManifoldDrawing,
    motion: RecordedMotion,
    meshcat: Meshcat,
    period: float,
    workpiece: WorkpieceLook | None = None,
    mounting: MountingLook | None = None,
    held: HeldLook | None = None,
) -> Diagram:
    """Return a diagram that draws a recorded motion while its time advances.

    Args:
        robot: How the robot is drawn.
        manifold: How the manifold is drawn.
        motion: What to draw.
        meshcat: Where to draw.
        period: Time between frames [s].
        workpiece: What its tool touches, if anything.
        mounting: How the plates of the motion are drawn, if there are any.
        held: How the workpiece and the robot that holds it are drawn, if one does.
    """
    bodies = body_origins(robot.plant, motion.positions[0])
    points = np.concatenate(manifold.outline())
    if held is not None and motion.held is not None:
        points = held_points(points, motion.held)
        if held.robot is not None and motion.held.positions is not None:
            others = body_origins(held.robot.plant, motion.held.positions[0])
            bodies = np.vstack([bodies, others])
    meshcat.SetCameraPose(*camera_and_target(points, bodies))
    if workpiece is not None:
        look_down_at(meshcat, points.mean(axis=0))
    builder = DiagramBuilder()
    positions = add_motion(builder, manifold, motion, workpiece, meshcat, period)
    if mounting is not None:
        _add_mounting(builder, mounting, motion, meshcat, period)
    if held is not None and motion.held is not None:
        pose = add_source(builder, "workpiece_pose", motion.times, motion.held.workpiece_pose)
        joints, holder = motion.held.positions, None
        if joints is not None:
            holder = add_source(builder, "holder_positions", motion.times, joints)
        add_held_drawing(builder, held, pose, holder, meshcat, period)
    visualizer = RobotVisualizer(robot.plant, robot.parts, meshcat, period)
    body = builder.AddNamedSystem("robot_visualizer", visualizer)
    builder.Connect(positions, body.GetInputPort("positions"))
    return builder.Build()


def build_delta_replay(
    robot: DeltaRobot,
    manifold: ManifoldDrawing,
    motion: RecordedMotion,
    meshcat: Meshcat,
    period: float,
    workpiece: WorkpieceLook | None = None,
) -> Diagram:
    """Return a diagram that draws a recorded motion while its time advances.

    Args:
        robot: The robot.
        manifold: How the manifold is drawn, axes of the inertial frame (z_0 down).
        motion: What to draw; its positions are those of the slides.
        meshcat: Where to draw.
        period: Time between frames [s].
        workpiece: What its tool touches, if anything.
    """
    arrange_scene(np.concatenate(manifold.outline())[:, 2], meshcat)
    if workpiece is not None:
        look_down_at(meshcat, np.array([0.0, 0.0, _CLEARANCE]))
    builder = DiagramBuilder()
    slides = add_motion(builder, manifold, motion, workpiece, meshcat, period)
    body = builder.AddNamedSystem("delta_visualizer", DeltaVisualizer(robot, meshcat, period))
    builder.Connect(slides, body.GetInputPort("slide_positions"))
    return builder.Build()


def arrange_scene(depth: np.ndarray, meshcat: Meshcat) -> None:
    """Hang the robot above the grid, and look at it from the side, level with the rods.

    Args:
        depth: Where something is to be seen, z_0 down [m], shape (K,).
        meshcat: Where to draw.
    """
    height = float(depth.max()) + _CLEARANCE
    turn_scene_over(meshcat, height)
    target = np.array([0.0, 0.0, height - 0.55 * depth.max()])
    meshcat.SetCameraPose(target + depth.max() * np.array([1.35, -1.0, 0.1]), target)


def _add_mounting(
    builder: DiagramBuilder,
    look: MountingLook,
    motion: RecordedMotion,
    meshcat: Meshcat,
    period: float,
) -> None:
    """Add plates and gripper, and what the plates are taken from and mounted into."""
    assert motion.plates is not None
    count = motion.plates.shape[1] // 12
    poses = [motion.tool_pose, *np.hsplit(motion.plates, count)]
    tool, *plates = (
        add_source(builder, f"mounting_pose_{k}", motion.times, pose)
        for k, pose in enumerate(poses)
    )
    add_mounting_drawing(builder, look, tool, plates, meshcat, period)


def add_motion(
    builder: DiagramBuilder,
    manifold: ManifoldDrawing,
    motion: RecordedMotion,
    workpiece: WorkpieceLook | None,
    meshcat: Meshcat,
    period: float,
) -> OutputPort:
    """Add what plays a recorded motion and draws all of it but the robot.

    Args:
        builder: Builder of the diagram.
        manifold: How the manifold is drawn.
        motion: What to draw.
        workpiece: What the tool touches, if anything.
        meshcat: Where to draw.
        period: Time between frames [s].

    Returns:
        The robot's positions, shape (nq,).
    """
    signals: Mapping[str, np.ndarray] = {
        "positions": motion.positions,
        "tool_pose": motion.tool_pose,
        "manifold_point": motion.manifold_point,
    }
    sources = {name: add_source(builder, name, motion.times, x) for name, x in signals.items()}
    drawing = manifold.add(builder, meshcat, period)
    builder.Connect(sources["manifold_point"], drawing)
    if motion.region_clock is not None:
        clock = add_source(builder, "clock", motion.times, motion.region_clock[:, np.newaxis])
        builder.Connect(clock, drawing.get_system().GetInputPort("region_clock"))
    if workpiece is not None:
        add_workpiece_drawing(builder, workpiece, sources["tool_pose"], meshcat, period)
    _add_tool(builder, motion, meshcat, period)
    _add_links(builder, motion, meshcat, period)
    if motion.obstacles is not None:
        seen = motion.obstacles
        places = add_source(builder, "obstacles", motion.times, seen.positions)
        drawn = ObstacleVisualizer(seen.shapes, seen.margin, meshcat, period)
        look = builder.AddNamedSystem("obstacle_visualizer", drawn)
        builder.Connect(places, look.GetInputPort("positions"))
    return sources["positions"]


def _add_trail(
    builder: DiagramBuilder,
    name: str,
    color: Rgba | Callable[[float], Rgba],
    motion: RecordedMotion,
    points: np.ndarray,
    meshcat: Meshcat,
    period: float,
) -> TrailVisualizer:
    """Add the way of a point, shape (frames, 3), and return what draws it."""
    trail = builder.AddNamedSystem(f"{name}_trail", TrailVisualizer(name, color, meshcat, period))
    source = add_source(builder, f"{name}_point", motion.times, points)
    builder.Connect(source, trail.GetInputPort("point"))
    return trail


def _add_arrows(
    builder: DiagramBuilder,
    name: str,
    motion: RecordedMotion,
    pushes: RecordedPushes,
    meshcat: Meshcat,
    period: float,
) -> None:
    """Add arrows for forces, the longest for the largest of all frames."""
    points, forces = pushes.points, pushes.forces
    size = np.linalg.norm(forces.reshape(len(forces), -1, 3), axis=2).max(initial=0.0)
    arrows = builder.AddNamedSystem(
        f"{name}_arrows", ForceArrows(points.shape[1] // 3, size, meshcat, period, name)
    )
    for port, samples in (("points", points), ("forces", forces)):
        source = add_source(builder, f"{name}_{port}", motion.times, samples)
        builder.Connect(source, arrows.GetInputPort(port))


def _add_tool(
    builder: DiagramBuilder, motion: RecordedMotion, meshcat: Meshcat, period: float
) -> None:
    """Add the way of the tool, and the force on it, where it is recorded."""
    points, distance = motion.tool_pose[:, :3], motion.distance
    color = _TOOL if distance is None else partial(signed_color, largest=distance.largest)
    way = points if motion.trail is None else motion.trail
    trail = _add_trail(builder, "path_following", color, motion, way, meshcat, period)
    if distance is not None:
        source = add_source(builder, "distance", motion.times, distance.values[:, np.newaxis])
        builder.Connect(source, trail.GetInputPort("value"))
    if motion.tool_force is not None:
        forces = RecordedPushes(_in_world(motion, points), motion.tool_force)
        _add_arrows(builder, "tool_force", motion, forces, meshcat, period)


def _in_world(motion: RecordedMotion, points: np.ndarray) -> np.ndarray:
    """Return where the tool is in the world [m], shape (frames, 3)."""
    return points if motion.held is None else placed_points(points, motion.held.workpiece_pose)


def _add_links(
    builder: DiagramBuilder, motion: RecordedMotion, meshcat: Meshcat, period: float
) -> None:
    """Add the way of the elbow, and the forces on links, where they are recorded."""
    if motion.elbow is not None:
        _add_trail(builder, "elbow", _ELBOW, motion, motion.elbow, meshcat, period)
    if motion.pushes is not None:
        _add_arrows(builder, "push", motion, motion.pushes, meshcat, period)


def camera_and_target(points: np.ndarray, bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where a camera stands and where it looks to see all [m], shape (3,) each.

    It looks from the side of the path, which is then to the right of the robot.

    Args:
        points: Points of the path [m], shape (k, 3).
        bodies: Origins of the robot's bodies [m], shape (bodies, 3), the base first.
    """
    seen = np.vstack([points, bodies])
    low, high = seen.min(axis=0), seen.max(axis=0)
    target, size = (low + high) / 2.0, float(np.linalg.norm(high - low))
    away = points.mean(axis=0) - bodies[0]
    azimuth = np.arctan2(away[1], away[0]) if np.linalg.norm(away[:2]) > 0.1 * size else 0.0
    view = RotationMatrix.MakeZRotation(azimuth) @ _VIEW
    return target + _DISTANCE * size * view, target


def body_origins(plant: MultibodyPlant, q: np.ndarray) -> np.ndarray:
    """Return the origins of all bodies but the world at a plant's positions [m], (bodies, 3)."""
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    bodies = [plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())]
    return np.array([body.EvalPoseInWorld(context).translation() for body in bodies])


def add_source(
    builder: DiagramBuilder, name: str, times: np.ndarray, samples: np.ndarray
) -> OutputPort:
    """Add a source that plays samples, linear in between, and return its output.

    Args:
        builder: Builder of the diagram.
        name: Name of the source.
        times: Times of the samples [s], shape (frames,).
        samples: Shape (frames, size).
    """
    trajectory = PiecewisePolynomial.FirstOrderHold(times, samples.T)
    return builder.AddNamedSystem(name, TrajectorySource(trajectory)).get_output_port()


def record(diagram: Diagram, meshcat: Meshcat, duration: float, period: float) -> str:
    """Play a replay diagram and return the recording as one self-contained page.

    Args:
        diagram: From :func:`build_replay`.
        meshcat: The same as there.
        duration: Length of the motion [s].
        period: Time between frames [s].
    """
    simulator = Simulator(diagram)
    meshcat.StartRecording(frames_per_second=1.0 / period, set_visualizations_while_recording=False)
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    meshcat.PublishRecording()
    return meshcat.StaticHtml()
