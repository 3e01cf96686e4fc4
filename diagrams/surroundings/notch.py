"""A workpiece with a notch, and the ball that runs in it."""

import numpy as np
from pydrake.geometry import Cylinder, GeometryId, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame

from diagrams.robots.workpiece import FurtherLength, Workpiece, WorkpieceLook, upwards
from diagrams.scenario.workpiece import NotchParameters
from diagrams.surroundings.contact_geometry import add_rigid_surface, add_soft_ball
from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.geometry.sweep import swept_surface
from pfsc_drake.robot.delta.shapes import ACCENT, METAL
from pfsc_drake.systems.drawing.robot_visualizer import Surface
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart


def place_in_notch(
    path: Path, notch: NotchParameters, y_t: np.ndarray, initial_theta: float, up: np.ndarray
) -> np.ndarray:
    """Return where the ball's centre is in the cross-section of its notch.

    It touches the round bottom at a distance ``notch.clearance`` from the notch's axis.

    Args:
        path: The path that was taught.
        notch: Ball and workpiece.
        y_t: Motion of the tool point [m], shape (samples, 3).
        initial_theta: Path parameter near the first sample.
        up: Unit vector in the world, shape (3,).

    Returns:
        To the left of the notch's axis, seen along the path, and above it [m], shape (samples, 2).
    """
    evaluator = path.evaluator(2)
    layout = PathPointLayout(2, path.orientation is not None)
    # back to where the workpiece stood, and from the bottom up to the axis
    moved = y_t - np.array(notch.displacement) - notch.clearance * up
    place, theta = np.full((len(y_t), 2), np.nan), initial_theta
    for k, y in enumerate(moved):
        if not np.isfinite(y).all():
            continue
        point = evaluator(y.tolist(), theta)
        theta = point[layout.theta][0]
        sigma, slope = point[layout.position].reshape(-1, 3)[:2]
        left = np.cross(up, slope)
        left /= np.linalg.norm(left)
        above = np.cross(slope / np.linalg.norm(slope), left)
        place[k] = left @ (y - sigma), above @ (y - sigma)
    return place


_SPACING = 4e-3  # m, between cross-sections
_ARC_POINTS = 13
_HOLDER_RADIUS = 0.008  # m


class NotchedWorkpiece(Workpiece):
    """A rigid workpiece with a notch along a path, and a ball with a soft shell on the tool.

    Args:
        path: The path that was taught.
        parameters: Workpiece and ball.
    """

    def __init__(self, path: Path, parameters: NotchParameters) -> None:
        self._path, self.parameters = path, parameters

    @property
    def time_step(self) -> float:
        """See :class:`Workpiece`."""
        return self.parameters.time_step

    @property
    def reach(self) -> float:
        """See :class:`Workpiece`."""
        return self.parameters.ball.distance

    @property
    def radius(self) -> float:
        """See :class:`Workpiece`."""
        return self.parameters.ball.radius

    def add(self, plant: MultibodyPlant, tool: Frame) -> list[GeometryId]:
        """See :class:`Workpiece`; a tool with a ball below it has the axes of the world."""
        ball, up = self.parameters.ball, upwards(plant.gravity_field().gravity_vector(), "notch")
        add_rigid_surface(
            plant, *notch_surface(self._path, self.parameters, up), "notch", ball.friction
        )
        return [add_soft_ball(plant, tool, ball, -ball.distance * up)]

    def start_shift(self, gravity: np.ndarray) -> np.ndarray:
        """Return the way to the middle of the notch, where the ball touches nothing."""
        up = upwards(gravity, "notch")
        return np.array(self.parameters.displacement) + self.parameters.clearance * up

    def check_start(self, y_t: np.ndarray) -> None:
        """See :class:`Workpiece`; :meth:`start_shift` leads out of it."""

    def lengths(
        self, y_t: np.ndarray, initial_place: np.ndarray, gravity: np.ndarray
    ) -> dict[str, FurtherLength]:
        """Return ``notch_position`` of the ball, see :func:`place_in_notch`."""
        up = upwards(gravity, "notch")
        place = place_in_notch(self._path, self.parameters, y_t, initial_place[0], up)
        limit = self.parameters.clearance
        return {"notch_position": FurtherLength(place, ["left", "above"], limit)}

    def look(self, gravity: np.ndarray) -> WorkpieceLook:
        """Return workpiece and ball, and the ball's holder if it is away from the tool point."""
        ball, up = self.parameters.ball, upwards(gravity, "notch")
        parts = [ToolPart("ball", Sphere(ball.radius), ACCENT, RigidTransform(-ball.distance * up))]
        length = ball.distance - ball.radius
        if length > 0.0:
            along = RotationMatrix.MakeFromOneVector(up, 2)
            X_TH = RigidTransform(along, -0.5 * length * up)
            parts.append(ToolPart("holder", Cylinder(_HOLDER_RADIUS, length), METAL, X_TH))
        return WorkpieceLook(Surface(*notch_surface(self._path, self.parameters, up)), parts)


def notch_surface(
    path: Path, notch: NotchParameters, up: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices [m], shape (k, 3), and triangles of the workpiece's surface.

    Args:
        path: The path that was taught.
        notch: Workpiece and ball.
        up: Unit vector in the world, shape (3,).
    """
    begin, end = path.position.domain
    theta = np.linspace(begin, end, 2 + int(path.length / _SPACING))
    vertices, triangles = swept_surface(path.position, theta, _profile(notch), up)
    # the path is that of E; the profile's origin is the notch's axis
    axis = np.array(notch.displacement) + (notch.clearance - notch.ball.distance) * up
    return vertices + axis, triangles


def _profile(notch: NotchParameters) -> np.ndarray:
    """Return the cross-section left to right about the notch's axis, rim walls upright."""
    angle = np.linspace(0.0, np.pi, _ARC_POINTS)
    arc = notch.radius * np.column_stack([np.cos(angle), -np.sin(angle)])
    rim, edge = notch.depth - notch.radius, 0.5 * notch.width
    left = [[edge, rim], [notch.radius, rim]]
    right = [[-notch.radius, rim], [-edge, rim]]
    if rim == 0.0:  # the rim ends where the arc begins
        left, right = left[:1], right[1:]
    return np.vstack([left, arc, right])
