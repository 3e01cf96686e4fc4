"""A workpiece under a surface, and the soft ball that is pressed on it."""

import numpy as np
from pydrake.geometry import GeometryId, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame

from diagrams.robots.workpiece import FurtherLength, Workpiece, WorkpieceLook
from diagrams.scenario.workpiece import WorkpieceParameters
from diagrams.surroundings.contact_geometry import add_rigid_surface, add_soft_ball
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.geometry.surfaces.evaluator import SurfaceEvaluator
from pfsc_drake.geometry.surfaces.point import surface_axes
from pfsc_drake.geometry.surfaces.surface import Surface
from pfsc_drake.geometry.sweep import surface_mesh
from pfsc_drake.robot.delta.shapes import ACCENT
from pfsc_drake.systems.drawing.robot_visualizer import Surface as Triangles
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart


class PressedWorkpiece(Workpiece):
    """A rigid workpiece under a surface that it has moved away from since that was taught.

    Args:
        surface: The surface as it was taught; its normal points out of the material.
        manifold: The surface's, with the orientation of the tool normal to it.
        parameters: Workpiece and ball.

    Raises:
        InputError: If the tool's orientation is not normal to the surface.
    """

    def __init__(
        self, surface: Surface, manifold: SurfaceManifold, parameters: WorkpieceParameters
    ) -> None:
        if manifold.offset is None:
            raise InputError(
                "surface.orientation.kind: must be normal where there is a workpiece; the ball is "
                "behind the tool point along the normal"
            )
        self._surface, self.parameters = surface, parameters
        self._p_TC = parameters.ball.radius * manifold.offset[2]
        self._R = zyx_to_matrix(np.deg2rad(parameters.turn_zyx_deg))
        self._middle = surface.partials([sum(ends) / 2.0 for ends in surface.domain], 0)[0]
        self._evaluator = SurfaceEvaluator(surface, 1)

    @property
    def time_step(self) -> float:
        """See :class:`Workpiece`."""
        return self.parameters.time_step

    @property
    def reach(self) -> float:
        """See :class:`Workpiece`."""
        return 0.0

    @property
    def radius(self) -> float:
        """See :class:`Workpiece`."""
        return self.parameters.ball.radius

    def add(self, plant: MultibodyPlant, tool: Frame) -> list[GeometryId]:
        """See :class:`Workpiece`."""
        ball = self.parameters.ball
        add_rigid_surface(plant, *self.mesh(), "workpiece", ball.friction)
        return [add_soft_ball(plant, tool, ball, self._p_TC)]

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices [m] and triangles of the workpiece where it stands, world axes."""
        vertices, triangles = surface_mesh(self._surface, self.parameters.spacing)
        moved = (vertices - self._middle) @ self._R.T + self._middle + self.parameters.shift
        return moved, triangles

    def touch(
        self, y_t: np.ndarray, near: np.ndarray | None = None
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Return height over the workpiece [m], its normal, and the parameters of the foot.

        Args:
            y_t: Tool point [m], shape (3,).
            near: Parameters near which the foot is, shape (2,); sought everywhere if omitted.
        """
        taught = (y_t - self.parameters.shift - self._middle) @ self._R + self._middle
        if near is None:
            theta = np.array(self._evaluator.project_globally(taught).theta)
            sigma, first, second = self._surface.partials(self._surface.wrap(theta), 1)
        else:
            point = self._evaluator(taught.tolist(), near.tolist(), (0.0, 0.0))
            theta = point[:2]
            rows = point[self._evaluator.layout.position].reshape(-1, 3)
            sigma, first, second = rows[:3]
        normal = surface_axes(first, second)[:, 2]
        return float(normal @ (taught - sigma)), self._R @ normal, theta

    def stiffness(self, force: float) -> float:
        """Return the stiffness of the contact along the normal where it bears a force [N/m].

        See :meth:`SoftBall.stiffness <diagrams.scenario.workpiece.SoftBall.stiffness>`; the
        workpiece is rigid, and flat where it is touched.

        Args:
            force: [N].
        """
        return self.parameters.ball.stiffness(force)

    def check_start(self, y_t: np.ndarray) -> None:
        """See :class:`Workpiece`; the ball reaches to the tool point."""
        height, _, _ = self.touch(y_t)
        if height < 0.0:
            raise InputError(
                f"start: the tool point is {-1e3 * height:.3g} mm inside of the workpiece; "
                "start.offset[0] must be larger, along the normal"
            )

    def start_shift(self, gravity: np.ndarray) -> np.ndarray:
        """Return zero: how far from the surface it starts is the scenario's to say."""
        del gravity
        return np.zeros(3)

    def lengths(
        self, y_t: np.ndarray, initial_place: np.ndarray, gravity: np.ndarray
    ) -> dict[str, FurtherLength]:
        """Return none: distances from the surface are coordinates of the task."""
        del y_t, initial_place, gravity
        return {}

    def look(self, gravity: np.ndarray) -> WorkpieceLook:
        """See :class:`Workpiece`."""
        del gravity
        ball = ToolPart(
            "ball", Sphere(self.parameters.ball.radius), ACCENT, RigidTransform(self._p_TC)
        )
        return WorkpieceLook(Triangles(*self.mesh()), [ball])

    def normal(self, axes: np.ndarray) -> np.ndarray:
        """Return the surface's normal, turned as the workpiece is, shape (3,)."""
        return np.asarray(self._R @ axes[:, 2])
