"""The surface manifold on jets: tool motion to tangential, transversal, rotational coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.forces import (
    force_along_surface,
    quaternion_matrix,
    quaternion_turning_force,
    rotational_force,
    surface_axes,
    tangent_plane,
    torque_across_axis,
    turning_along_surface,
)
from pfsc_drake.control.manifolds.orientation import ToolOrientation, quaternion_rotation
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import check_rotation_matrix, quaternion_to_matrix
from pfsc_drake.geometry.manifold_point import SurfacePointLayout
from pfsc_drake.geometry.surfaces.parametric_surface import partial_index, partial_orders
from pfsc_drake.jets import Jet

_TRANSLATIONAL = (
    Coordinate("eta_1", Kind.TANGENTIAL, "tau_par_1"),
    Coordinate("eta_2", Kind.TANGENTIAL, "tau_par_2"),
    Coordinate("xi", Kind.TRANSVERSAL, "tau_perp"),
)


@dataclass(frozen=True)
class SurfaceGeometry:
    """The surface next to the tool, as expressions.

    Attributes:
        eta: Tangential coordinates at the projected point [m], shape (2, 1).
        position: Partial derivatives of ``sigma_t`` up to order r + 1, each (3, 1), rows as in
            `geometry.surfaces.partials`.
        quaternion: The same of the reference orientation's quaternion (w, x, y, z) of any positive
            norm, up to order r, each (4, 1); empty if it has none.
        offset: Rotation of the tool against the surface's frame, shape (3, 3); None if the
            frame's own axes are not the reference orientation.
        tool: Controlled part of the tool's orientation.
    """

    eta: ca.SX
    position: Sequence[ca.SX]
    quaternion: Sequence[ca.SX] = ()
    offset: np.ndarray | None = None
    tool: ToolOrientation = field(default_factory=ToolOrientation)


@dataclass(frozen=True)
class SurfaceFrame:
    """The moving frame of a surface as jets.

    Attributes:
        tangent: ``t_1``, direction of ``sigma_1``.
        normal: ``e_perp`` (4.3), a unit vector.
        speed: Norm of ``sigma_1``.
        across: Norm of the part of ``sigma_2`` along ``e_perp x t_1``.
    """

    tangent: Jet
    normal: Jet
    speed: Jet
    across: Jet

    @property
    def rotation(self) -> Jet:
        """Rotation matrix ``[t_1, e_perp x t_1, e_perp]``."""
        axes = (self.tangent, jets.cross(self.normal, self.tangent), self.normal)
        columns = zip(*[axis.coefficients for axis in axes], strict=True)
        return Jet([ca.horzcat(*column) for column in columns])


def slopes(position: Sequence[ca.SX], order: int, theta: tuple[Jet, Jet]) -> tuple[Jet, Jet]:
    """Return the jets of ``sigma_1`` and ``sigma_2`` along a motion of the parameters.

    Args:
        position: Partial derivatives of ``sigma_t`` up to ``order + 1``.
        order: Order of the result.
        theta: Jets of both parameters.
    """
    first, second = (
        [position[partial_index(i + a, j + 1 - a)] for i, j in partial_orders(order)]
        for a in (1, 0)
    )
    return jets.compose_pair(first, *theta), jets.compose_pair(second, *theta)


def surface_parameters(y: Jet, position: Sequence[ca.SX]) -> tuple[Jet, Jet]:
    """Return the jets of ``theta* - theta*(now)`` of the projected point.

    Order by order from ``F_i(t) = (y_t - sigma)' sigma_i = 0`` (4.10): with ``theta_k`` set to
    zero, ``theta_k = H^-1 [F]_k`` with the Hessian (4.12).

    Args:
        y: Tool point ``y_t`` [m], vector jet.
        position: Partial derivatives of ``sigma_t`` up to its order and one more.
    """
    sigma, s_1, s_2, s_11, s_12, s_22 = position[:6]
    d = y.coefficients[0] - sigma
    h_11, h_22 = ca.dot(s_1, s_1) - ca.dot(s_11, d), ca.dot(s_2, s_2) - ca.dot(s_22, d)
    h_12 = ca.dot(s_1, s_2) - ca.dot(s_12, d)
    determinant = h_11 * h_22 - h_12 * h_12
    theta = Jet([ca.SX(0)]), Jet([ca.SX(0)])
    for k in range(1, y.order + 1):
        trial = theta[0].append(ca.SX(0)), theta[1].append(ca.SX(0))
        offset = y - jets.compose_pair(position, *trial)
        f_1, f_2 = (jets.dot(offset, slope).coefficients[k] for slope in slopes(position, k, trial))
        theta = (
            theta[0].append((h_22 * f_1 - h_12 * f_2) / determinant),
            theta[1].append((h_11 * f_2 - h_12 * f_1) / determinant),
        )
    return theta


def surface_frame(position: Sequence[ca.SX], order: int, theta: tuple[Jet, Jet]) -> SurfaceFrame:
    """Return the surface's frame along a motion of the parameters, for arguments see `slopes`."""
    s_1, s_2 = slopes(position, order, theta)
    cross = jets.cross(s_1, s_2)
    speed, area = (jets.sqrt(jets.dot(x, x)) for x in (s_1, cross))
    return SurfaceFrame(s_1 / speed, cross / area, speed, area / speed)


def surface_coordinates(y: Jet, R_e: Jet, surface: SurfaceGeometry) -> list[Jet]:
    """Return the virtual output ``(eta_1, eta_2, xi, phi)`` (4.19) with its derivatives.

    ``eta' = Sigma theta'`` (4.15): the components of the projected point's velocity along ``t_1``
    and ``e_perp x t_1``. ``xi' = e_perp . y_t'`` (4.18). ``phi`` are the ZYX Euler angles of
    ``R_d' R_e``, as for paths; their derivatives include the motion of the reference orientation
    along the surface.

    Args:
        y: Tool point ``y_t`` [m], vector jet of order r >= 1.
        R_e: Tool orientation, matrix jet of order r.
        surface: The surface at the projection of the tool point.

    Returns:
        3 to 6 scalar jets of order r [m, m, m, rad, rad, rad].
    """
    theta, r = surface_parameters(y, surface.position), y.order
    frame = surface_frame(surface.position, r if surface.offset is not None else r - 1, theta)
    velocity = jets.compose_pair(surface.position, *theta).differentiate()
    eta = [
        jets.dot(frame.tangent, velocity).integrate(surface.eta[0]),
        (frame.across * theta[1].differentiate()).integrate(surface.eta[1]),
    ]
    offset = ca.dot(frame.normal.coefficients[0], y.coefficients[0] - surface.position[0])
    xi = jets.dot(frame.normal, y.differentiate()).integrate(offset)
    if surface.offset is not None:
        R_d = frame.rotation @ surface.offset
    elif surface.quaternion:
        R_d = quaternion_rotation(jets.compose_pair(surface.quaternion, *theta))
    else:
        return [*eta, xi]
    return [*eta, xi, *surface.tool.error(R_e, R_d)]


class SurfaceManifold:
    """Surface as a :class:`~pfsc_drake.control.manifolds.manifold.Manifold`.

    Its coordinates are two tangential ones, lengths along theta_1 and orthogonal to it, the
    distance along the normal, and, with orientation, the three ZYX angles of
    the tool, the two of an axis of it, about which the tool may then turn freely, or the one
    of its turn about an axis in space.

    Args:
        order: Relative degree r of the law, 1 to 5.
        orientation: ``"given"`` by the point's quaternion; ``"normal"``: the surface's
            frame ``[t_1, e_perp x t_1, e_perp]``; None for none.
        offset: Rotation from the surface's frame to the tool's reference orientation ``R_d``, such
            as lead and tilt, shape (3, 3); the identity by default. Only for ``"normal"``.
        tool_axis: The axis that alone follows the orientation, in the tool frame, of any length,
            shape (3,); None if the whole tool does.
        yaw_axis: The axis about which alone the tool's turn follows the orientation, world axes,
            of any length, shape (3,); None if more does.
        euler: ``zyx`` or ``zyz`` for differences of Euler angles, see :class:`ToolOrientation`.

    Attributes:
        tool: Controlled part of the tool's orientation.
        offset: The rotation, or None if the orientation is not the frame's.

    Raises:
        InputError: If the order is out of range, the orientation is unknown, the offset is no
            rotation or has no frame, or an axis has no direction, or no orientation to follow.
    """

    name = "surface"
    follows_time = False

    def __init__(
        self,
        order: int,
        *,
        orientation: Literal["given", "normal"] | None = None,
        offset: np.ndarray | None = None,
        tool_axis: np.ndarray | None = None,
        yaw_axis: np.ndarray | None = None,
        euler: str | None = None,
    ) -> None:
        if orientation not in (None, "given", "normal"):
            raise InputError(f"orientation '{orientation}': unknown; allowed are given, normal")
        if offset is not None and orientation != "normal":
            raise InputError(
                f"offset: given for the orientation '{orientation}'; only 'normal' has one"
            )
        self.layout = SurfacePointLayout(order, orientation == "given")
        self.tool = ToolOrientation(
            orientation is not None,
            tool_axis=tool_axis,
            yaw_axis=yaw_axis,
            euler=euler,
            manifold=self.name,
        )
        self.coordinates = (*_TRANSLATIONAL, *self.tool.coordinates)
        self.offset: np.ndarray | None = None
        if orientation == "normal":
            self.offset = check_rotation_matrix(np.eye(3) if offset is None else offset, "offset")

    @property
    def is_oriented(self) -> bool:
        """Whether there is an orientation to follow."""
        return self.offset is not None or self.layout.oriented

    def orientation(self, points: np.ndarray) -> np.ndarray:
        """Return the reference orientation at points, shape (samples, 3, 3)."""
        if self.offset is None:
            return quaternion_to_matrix(points[:, self.layout.quaternion][:, :4])
        return np.array([self.axes(point).full() for point in points]) @ self.offset

    def geometry(self, point: ca.SX) -> SurfaceGeometry:
        """Return the parts of a surface point for the maps."""
        layout = self.layout
        return SurfaceGeometry(
            eta=point[layout.eta],
            position=ca.vertsplit(point[layout.position], 3),
            quaternion=ca.vertsplit(point[layout.quaternion], 4) if layout.oriented else (),
            offset=self.offset,
            tool=self.tool,
        )

    def virtual_output(self, y: Jet, R_e: Jet, point: ca.SX, lead: Sequence[Jet]) -> list[Jet]:
        """Return :func:`surface_coordinates`."""
        return surface_coordinates(y, R_e, self.geometry(point))

    def force(
        self, wrench: ca.SX, point: ca.SX, reference: ca.SX, *, with_turning: bool = False
    ) -> ca.SX:
        """Return (4.32) for the translational coordinates, (3.44) and (3.45) for the angles.

        Their power ``tau . yhat'`` is the wrench's, with the rotation relative to the surface's
        orientation; with ``with_turning`` it is all of the wrench's power, and
        ``A' tau = J_g' wrench`` with ``A = d yhat / dq``. If only an axis of the tool is
        controlled, this holds for torques across it; if only its turn about an axis in space is,
        for torques about that axis. The tool is assumed at the reference's distance xi from the
        surface.
        """
        force, torque = wrench[:3], wrench[3:]
        plane = tangent_plane(point, self.layout)
        translational = force_along_surface(force, plane, reference[2])
        if len(self.coordinates) == 3:
            return translational
        phi, quaternion = reference[3:], point[self.layout.quaternion]
        frame = None if self.offset is None else plane.axes @ self.offset
        R_d = quaternion_matrix(quaternion[:4]) if frame is None else frame
        alignment = self.tool.alignment
        if alignment is not None:
            torque = torque_across_axis(torque, R_d, phi, alignment)
        rotational = None
        if self.tool.yaw_axis is not None:
            torque, rotational = self.tool.yaw_torque(torque)
        elif self.tool.euler is not None:
            torque, rotational = self.tool.euler_torque(torque, R_d, phi)
        if with_turning:
            if self.offset is None:
                turning = quaternion_turning_force(torque, plane, quaternion)
            else:
                turning = turning_along_surface(torque, plane)
            translational[:2] += turning
        if rotational is None:
            rotational = rotational_force(R_d.T @ torque, phi, alignment)
        return ca.vertcat(translational, rotational)

    def axes(self, point: Any) -> Any:
        """Return ``[t_1, e_perp x t_1, e_perp]`` as columns, shape (3, 3)."""
        return surface_axes(point, self.layout)
