"""A logged run in Meshcat: robot, path, moving frame and trail of the tool; a DELTA robot hangs."""

from collections.abc import Callable
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

from diagrams.drawing.legend import ELBOW_COLOR, TOOL_COLOR
from diagrams.drawing.mounting_drawing import MountingDrawing
from diagrams.drawing.moving_workpiece_drawing import MovingWorkpieceDrawing
from diagrams.drawing.recorded import RecordedMotion, RecordedPushes
from diagrams.drawing.robot_geometry import RobotDrawing
from diagrams.robots.workpiece import WorkpieceDrawing
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

# direction to the camera if the path is in front of the robot, and its distance per size of the
# scene
_VIEW = np.array([0.53, -0.79, 0.31])
_DISTANCE = 0.95
# m, between the path's lowest point and the grid
_CLEARANCE = 0.15


class Playback:
    """Diagram under construction that draws a recorded motion while its time advances.

    Args:
        motion: The recorded motion.
        meshcat: Meshcat instance to draw in.
        period: Time between frames [s].
    """

    def __init__(self, motion: RecordedMotion, meshcat: Meshcat, period: float) -> None:
        self._motion, self._meshcat, self._period = motion, meshcat, period
        self._builder = DiagramBuilder()

    def build(
        self,
        robot: RobotDrawing,
        manifold: ManifoldDrawing,
        workpiece: WorkpieceDrawing | None = None,
        mounting: MountingDrawing | None = None,
        moving: MovingWorkpieceDrawing | None = None,
    ) -> Diagram:
        """Return the diagram for a serial robot.

        Args:
            robot: Drawing of the robot.
            manifold: Drawing of the manifold.
            workpiece: Drawing of the workpiece that its tool touches, if there is one.
            mounting: Drawing of the plates of the motion, if there are any.
            moving: Drawing of a workpiece that moves and of the robot that holds it, if there is
                one.
        """
        motion, meshcat = self._motion, self._meshcat
        bodies = body_origins(robot.plant, motion.positions[0])
        points = np.concatenate(manifold.outline())
        if moving is not None and motion.holder is not None:
            points = motion.holder.first_points(points)
            if moving.robot is not None and motion.holder.positions is not None:
                others = body_origins(moving.robot.plant, motion.holder.positions[0])
                bodies = np.vstack([bodies, others])
        meshcat.SetCameraPose(*camera_and_target(points, bodies))
        if workpiece is not None:
            look_down_at(meshcat, points.mean(axis=0))
        positions = self._add_motion(manifold, workpiece)
        if mounting is not None:
            self._add_mounting(mounting)
        if moving is not None and motion.holder is not None:
            pose = self._add_source("workpiece_pose", motion.holder.workpiece_pose)
            joints, holder = motion.holder.positions, None
            if joints is not None:
                holder = self._add_source("holder_positions", joints)
            moving.add(self._builder, pose, holder, meshcat, self._period)
        visualizer = RobotVisualizer(robot.plant, robot.parts, meshcat, self._period)
        body = self._builder.AddNamedSystem("robot_visualizer", visualizer)
        self._builder.Connect(positions, body.GetInputPort("positions"))
        return self._builder.Build()

    def build_delta(
        self,
        robot: DeltaRobot,
        manifold: ManifoldDrawing,
        workpiece: WorkpieceDrawing | None = None,
    ) -> Diagram:
        """Return the diagram for a DELTA robot; the positions of the motion are slide positions.

        Args:
            robot: The robot.
            manifold: Drawing of the manifold, axes of the inertial frame (z_0 down).
            workpiece: Drawing of the workpiece that its tool touches, if there is one.
        """
        meshcat, builder = self._meshcat, self._builder
        arrange_scene(np.concatenate(manifold.outline())[:, 2], meshcat)
        if workpiece is not None:
            look_down_at(meshcat, np.array([0.0, 0.0, _CLEARANCE]))
        slides = self._add_motion(manifold, workpiece)
        visualizer = DeltaVisualizer(robot, meshcat, self._period)
        body = builder.AddNamedSystem("delta_visualizer", visualizer)
        builder.Connect(slides, body.GetInputPort("slide_positions"))
        return builder.Build()

    def _add_source(self, name: str, samples: np.ndarray) -> OutputPort:
        return add_source(self._builder, name, self._motion.times, samples)

    def _add_mounting(self, mounting: MountingDrawing) -> None:
        """Add plates, gripper, magazine and frame."""
        motion = self._motion
        assert motion.plates is not None
        count = motion.plates.shape[1] // 12
        poses = [motion.tool_pose, *np.hsplit(motion.plates, count)]
        tool, *plates = (
            self._add_source(f"mounting_pose_{k}", pose) for k, pose in enumerate(poses)
        )
        mounting.add(self._builder, tool, plates, self._meshcat, self._period)

    def _add_motion(
        self, manifold: ManifoldDrawing, workpiece: WorkpieceDrawing | None
    ) -> OutputPort:
        """Draw the motion without the robot, and return the robot's positions, shape (nq,)."""
        motion, builder = self._motion, self._builder
        meshcat, period = self._meshcat, self._period
        positions = self._add_source("positions", motion.positions)
        tool_pose = self._add_source("tool_pose", motion.tool_pose)
        drawing = manifold.add(builder, meshcat, period)
        builder.Connect(self._add_source("manifold_point", motion.manifold_point), drawing)
        if motion.region_clock is not None:
            clock = self._add_source("clock", motion.region_clock[:, np.newaxis])
            builder.Connect(clock, drawing.get_system().GetInputPort("region_clock"))
        if workpiece is not None:
            add_workpiece_drawing(builder, workpiece, tool_pose, meshcat, period)
        self._add_tool()
        if motion.elbow is not None:
            self._add_trail("elbow", ELBOW_COLOR, motion.elbow)
        if motion.pushes is not None:
            self._add_arrows("push", motion.pushes)
        if motion.obstacles is not None:
            obstacles = motion.obstacles
            drawn = ObstacleVisualizer(obstacles.shapes, obstacles.margin, meshcat, period)
            visualizer = builder.AddNamedSystem("obstacle_visualizer", drawn)
            source = self._add_source("obstacles", obstacles.positions)
            builder.Connect(source, visualizer.GetInputPort("positions"))
        return positions

    def _add_trail(
        self, name: str, color: Rgba | Callable[[float], Rgba], points: np.ndarray
    ) -> TrailVisualizer:
        """Add the path of a point, shape (frames, 3), and return its visualizer."""
        visualizer = TrailVisualizer(name, color, self._meshcat, self._period)
        trail = self._builder.AddNamedSystem(f"{name}_trail", visualizer)
        source = self._add_source(f"{name}_point", points)
        self._builder.Connect(source, trail.GetInputPort("point"))
        return trail

    def _add_arrows(self, name: str, pushes: RecordedPushes) -> None:
        """Add arrows for forces, scaled by the largest force of all frames."""
        points, forces = pushes.points, pushes.forces
        size = np.linalg.norm(forces.reshape(len(forces), -1, 3), axis=2).max(initial=0.0)
        visualizer = ForceArrows(points.shape[1] // 3, size, self._meshcat, self._period, name)
        arrows = self._builder.AddNamedSystem(f"{name}_arrows", visualizer)
        for port, samples in (("points", points), ("forces", forces)):
            source = self._add_source(f"{name}_{port}", samples)
            self._builder.Connect(source, arrows.GetInputPort(port))

    def _add_tool(self) -> None:
        """Add the path of the tool, and the force on it, where it is recorded."""
        motion = self._motion
        points, distance = motion.tool_pose[:, :3], motion.distance
        color = TOOL_COLOR if distance is None else partial(signed_color, largest=distance.largest)
        path = points if motion.trail is None else motion.trail
        trail = self._add_trail("path_following", color, path)
        if distance is not None:
            source = self._add_source("distance", distance.values[:, np.newaxis])
            self._builder.Connect(source, trail.GetInputPort("value"))
        if motion.tool_force is not None:
            if motion.holder is not None:
                points = placed_points(points, motion.holder.workpiece_pose)
            self._add_arrows("tool_force", RecordedPushes(points, motion.tool_force))


def arrange_scene(depth: np.ndarray, meshcat: Meshcat) -> None:
    """Hang the robot above the grid, with the camera at its side, level with the rods.

    Args:
        depth: Depths of the visible points, z_0 down [m], shape (K,).
        meshcat: Meshcat instance to draw in.
    """
    height = float(depth.max()) + _CLEARANCE
    turn_scene_over(meshcat, height)
    target = np.array([0.0, 0.0, height - 0.55 * depth.max()])
    meshcat.SetCameraPose(target + depth.max() * np.array([1.35, -1.0, 0.1]), target)


def camera_and_target(points: np.ndarray, bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return position and target of a camera that shows all points [m], shape (3,) each.

    It looks from the side of the path, which is then to the right of the robot.

    Args:
        points: Points of the path [m], shape (k, 3).
        bodies: Origins of the robot's bodies [m], shape (bodies, 3), the base first.
    """
    shown = np.vstack([points, bodies])
    low, high = shown.min(axis=0), shown.max(axis=0)
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
        samples: The samples, shape (frames, size).
    """
    trajectory = PiecewisePolynomial.FirstOrderHold(times, samples.T)
    return builder.AddNamedSystem(name, TrajectorySource(trajectory)).get_output_port()


def record(diagram: Diagram, meshcat: Meshcat, duration: float, period: float) -> str:
    """Play a replay diagram and return the recording as one self-contained page.

    Args:
        diagram: Diagram from :class:`Playback`.
        meshcat: Its Meshcat instance.
        duration: Length of the motion [s].
        period: Time between frames [s].
    """
    simulator = Simulator(diagram)
    meshcat.StartRecording(frames_per_second=1.0 / period, set_visualizations_while_recording=False)
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    meshcat.PublishRecording()
    return meshcat.StaticHtml()
