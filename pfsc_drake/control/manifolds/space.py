"""All of space as a manifold: a freely guided tool with a constant reference orientation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.forces import (
    in_axes_of,
    quaternion_matrix,
    rotational_force,
    torque_across_axis,
)
from pfsc_drake.control.manifolds.orientation import ToolOrientation, quaternion_rotation
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.geometry.nearest_samples import ProjectionStatus
from pfsc_drake.jets import Jet

_TRANSLATIONAL = tuple(
    Coordinate(f"eta_{axis}", Kind.TANGENTIAL, f"tau_{axis}") for axis in ("1", "2", "3")
)


@dataclass(frozen=True)
class SpacePointLayout:
    """Layout of a point in space in a flat array of floats.

    | field        | length | meaning                                                   |
    |--------------|--------|-----------------------------------------------------------|
    | `position`   | 3      | tool point, its coordinates and parameters in one, m       |
    | `alpha`      | 1      | 0: no point is outside the feasible neighbourhood         |
    | `status`     | 1      | a `ProjectionStatus`                                      |
    | `quaternion` | 4      | reference orientation, w first; empty if there is none    |

    Args:
        order: Relative degree r of the law that reads it.
        oriented: Whether there is an orientation.
    """

    order: int
    oriented: bool

    @property
    def position(self) -> slice:
        """Slice of the tool point, [3], m."""
        return slice(0, 3)

    theta = eta = memory = position

    @property
    def alpha(self) -> slice:
        """Slice of alpha, [1]."""
        return slice(3, 4)

    @property
    def status(self) -> slice:
        """Slice of the status, [1]."""
        return slice(4, 5)

    @property
    def quaternion(self) -> slice:
        """Slice of the quaternion, [4] or empty."""
        return slice(5, 9 if self.oriented else 5)

    @property
    def size(self) -> int:
        """Length of the whole array."""
        return self.quaternion.stop


class SpaceManifold:
    """All of space as a :class:`~pfsc_drake.control.manifolds.manifold.Manifold`.

    Its coordinates are the tool point's along the world's axes, all of them tangential, and,
    with orientation, the ZYX angles of ``R_d' R_e`` against one ``R_d``, the two of an axis of
    the tool, or the one of its turn about an axis in space.

    Args:
        order: Relative degree r of the law.
        quaternion: Quaternion of ``R_d`` (w, x, y, z), shape (4,); None for no orientation.
        tool_axis: The axis that alone follows the orientation, in the tool frame, of any length,
            shape (3,); None if the whole tool does.
        yaw_axis: The axis about which alone the tool's turn follows the orientation, world axes,
            of any length, shape (3,); None if more does.
        euler: ``zyx`` or ``zyz`` for differences of Euler angles, see :class:`ToolOrientation`.

    Attributes:
        tool: Controlled part of the tool's orientation.

    Raises:
        InputError: If an axis has no direction, or no orientation to follow.
    """

    name = "space"
    follows_time = False

    def __init__(
        self,
        order: int,
        quaternion: np.ndarray | None = None,
        *,
        tool_axis: np.ndarray | None = None,
        yaw_axis: np.ndarray | None = None,
        euler: str | None = None,
    ) -> None:
        self.layout = SpacePointLayout(order, quaternion is not None)
        self._point = np.zeros(self.layout.size)
        self._point[self.layout.status] = ProjectionStatus.OK
        if quaternion is not None:
            self._point[self.layout.quaternion] = quaternion
        self.tool = ToolOrientation(
            self.is_oriented,
            tool_axis=tool_axis,
            yaw_axis=yaw_axis,
            euler=euler,
            manifold=self.name,
        )
        self.coordinates = (*_TRANSLATIONAL, *self.tool.coordinates)

    @property
    def is_oriented(self) -> bool:
        """Whether there is a reference orientation."""
        return self.layout.oriented

    @cached_property
    def evaluate(self) -> ca.Function:
        """``(y_t, memory) -> manifold_point``, see :class:`ProjectionEvaluator`."""
        y, memory = ca.SX.sym("y_t", 3), ca.SX.sym("memory", 3)
        point = ca.vertcat(y, *self._point[3:].tolist())
        return ca.Function("space_point", [y, memory], [point])

    @cached_property
    def find(self) -> ca.Function:
        """``y_t -> memory``, see :class:`ProjectionEvaluator`."""
        y = ca.SX.sym("y_t", 3)
        return ca.Function("space_place", [y], [y])

    def point(self, y_t: Sequence[float]) -> np.ndarray:
        """Return the manifold's point at a tool point [m], shape (layout.size,)."""
        point = self._point.copy()
        point[:3] = y_t
        return point

    def orientation(self, points: np.ndarray) -> np.ndarray:
        """Return the reference orientation, shape (samples, 3, 3)."""
        return quaternion_to_matrix(points[:, self.layout.quaternion])

    def virtual_output(self, y: Jet, R_e: Jet, point: ca.SX, lead: Sequence[Jet]) -> list[Jet]:
        """Return the tool point and the angles of ``R_d' R_e``, scalar jets [m, rad]."""
        position = [y[i] for i in range(3)]
        if not self.is_oriented:
            return position
        R_d = quaternion_rotation(jets.constant(point[self.layout.quaternion], y.order))
        return [*position, *self.tool.error(R_e, R_d)]

    def force(
        self, wrench: ca.SX, point: ca.SX, reference: ca.SX, *, with_turning: bool = False
    ) -> ca.SX:
        """Return the force itself, and (3.44), (3.45) for the angles."""
        force, torque = wrench[:3], wrench[3:]
        if not self.is_oriented:
            return force
        if self.tool.yaw_axis is not None:
            return ca.vertcat(force, self.tool.yaw_torque(torque)[1])
        phi, quaternion = reference[3:], point[self.layout.quaternion]
        if self.tool.euler is not None:
            R_d = quaternion_matrix(quaternion)
            return ca.vertcat(force, self.tool.euler_torque(torque, R_d, phi)[1])
        alignment = self.tool.alignment
        if alignment is not None:
            torque = torque_across_axis(torque, quaternion_matrix(quaternion), phi, alignment)
        turned = rotational_force(in_axes_of(quaternion, torque), phi, alignment)
        return ca.vertcat(force, turned)

    def axes(self, point: Any) -> Any:
        """Return the world's axes, shape (3, 3)."""
        return ca.DM.eye(3)
