"""A workpiece under a surface, and the soft ball that is pressed on it."""

import numpy as np
from pydrake.geometry import GeometryId, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame

from diagrams.scenario.workpiece import WorkpieceParameters
from diagrams.surroundings.contact_geometry import add_rigid_surface, add_soft_ball
from diagrams.workpiece import FurtherLength, Workpiece, WorkpieceLook
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.geometry.surfaces.evaluator import SurfaceEvaluator
from pfsc_drake.geometry.surfaces.frame import surface_axes
from pfsc_drake.geometry.surfaces.mesh import surface_mesh
from pfsc_drake.geometry.surfaces.surface import Surface
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

    def check_start(self, y_t: np.ndarray) -> None:
        """See :class:`Workpiece`; the ball reaches to the tool point."""
        taught = (y_t - self.parameters.shift - self._middle) @ self._R + self._middle
        theta = SurfaceEvaluator(self._surface, 1).project_globally(taught).theta
        sigma, first, second = self._surface.partials(self._surface.wrap(theta), 1)
        height = float(surface_axes(first, second)[:, 2] @ (taught - sigma))
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
