"""A logged run of a DELTA robot in Meshcat, base on top as it hangs."""

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Diagram, DiagramBuilder

from diagrams.drawing.replay import RecordedMotion, add_motion
from diagrams.robots.workpiece import WorkpieceLook
from diagrams.tasks.drawing import ManifoldDrawing, look_down_at
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.systems.drawing.robot_visualizer import DeltaVisualizer, turn_scene_over

# m, between the path's lowest point and the grid
_CLEARANCE = 0.15


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
