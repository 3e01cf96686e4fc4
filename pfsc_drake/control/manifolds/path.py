"""The path manifold on jets: tool motion to tangential, transversal, rotational coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.forces import (
    force_along_path,
    in_axes_of,
    path_axes,
    quaternion_matrix,
    rotational_force,
    torque_across_axis,
    turning_along_path,
    turning_force,
)
from pfsc_drake.control.manifolds.orientation import ToolOrientation, quaternion_rotation
from pfsc_drake.geometry import PathPointLayout, quaternion_to_matrix
from pfsc_drake.jets import Jet

_TRANSLATIONAL = (
    Coordinate("eta", Kind.TANGENTIAL, "tau_par"),
    Coordinate("xi_1", Kind.TRANSVERSAL, "tau_perp"),
    Coordinate("xi_2", Kind.TRANSVERSAL, "tau_cross"),
)


@dataclass(frozen=True)
class PathGeometry:
    """The path next to the tool, as expressions.

    Attributes:
        eta: Arc length at the projected point [m], scalar.
        normal: First normal vector ``e_perp`` of the parallel transport frame, shape (3, 1).
        position: ``sigma_t`` and its derivatives by theta, orders 0..r+1, each (3, 1).
        quaternion: Quaternion (w, x, y, z) of the reference orientation, of any
            positive norm, and its derivatives by theta, orders 0..r, each (4, 1);
            empty for arms that have no orientation to follow.
        tool: Controlled part of the tool's orientation.
        turn: Derivatives 1..r by theta of the angle about the tangent by which ``e_perp`` turns
            against parallel transport [rad], scalars; empty where it does not.
    """

    eta: ca.SX
    normal: ca.SX
    position: Sequence[ca.SX]
    quaternion: Sequence[ca.SX]
    tool: ToolOrientation = field(default_factory=ToolOrientation)
    turn: Sequence[ca.SX] = ()


def path_parameter(y: Jet, path: PathGeometry) -> Jet:
    """Return the jet of ``theta* - theta*(now)`` of the projected point.

    Order by order from ``F(t) = (y_t - sigma)' sigma' = 0`` (3.7): with
    ``theta_k`` set to zero, ``theta_k = [F]_k / (|sigma'|^2 (1 - alpha))``.
    """
    sigma, slope, curvature = path.position[:3]
    gradient = ca.dot(slope, slope) - ca.dot(y.coefficients[0] - sigma, curvature)
    theta = Jet([ca.SX(0)])
    for k in range(1, y.order + 1):
        trial = theta.append(ca.SX(0))
        offset = y - jets.compose(path.position[: k + 1], trial)
        tangent = jets.compose(path.position[1 : k + 2], trial)
        residual = jets.dot(offset, tangent).coefficients[k]
        theta = theta.append(residual / gradient)
    return theta


def path_coordinates(y: Jet, R_e: Jet, path: PathGeometry) -> list[Jet]:
    """Return the virtual output ``yhat = (eta, xi_1, xi_2, phi)`` (3.20) with its derivatives.

    ``eta' = |sigma'| theta'`` (3.13). ``xi`` are the projections of
    ``y_t - sigma`` on the parallel transport frame, whose derivatives are
    ``xi_i' = e_i . y_t'`` (3.16), (3.17); ``e_perp' = -(e_par' . e_perp) e_par``
    (3.4), primes being time derivatives. In a prescribed frame, which turns about the tangent by
    the angle ``psi``, they are turned by it. ``phi`` are the ZYX Euler angles of
    ``R_d' R_e``, see (3.43)-(3.47), or others of :class:`ToolOrientation`; their derivatives
    include the motion of the reference orientation along the path.

    Args:
        y: Tool point ``y_t`` [m], vector jet of order r >= 1.
        R_e: Tool orientation, matrix jet of order r.
        path: The path at the projection of the tool point.

    Returns:
        3 to 6 scalar jets of order r [m, m, m, rad, rad, rad].
    """
    theta = path_parameter(y, path)
    tangent = jets.compose(path.position[1 : y.order + 1], theta)
    speed = jets.sqrt(jets.dot(tangent, tangent))
    eta = (speed * theta.differentiate()).integrate(path.eta)
    e_par = tangent / speed
    e_perp = transport(path.normal, e_par)
    offset = y.coefficients[0] - path.position[0]
    velocity = y.differentiate()
    xi = [
        jets.dot(e, velocity).integrate(ca.dot(e.coefficients[0], offset))
        for e in (e_perp, jets.cross(e_par, e_perp))
    ]
    if path.turn:
        xi = rotate_components(xi, jets.compose([ca.SX(0), *path.turn], theta))
    if not path.quaternion:
        return [eta, *xi]
    R_d = quaternion_rotation(jets.compose(path.quaternion, theta))
    return [eta, *xi, *path.tool.error(R_e, R_d)]


def transport(normal: ca.SX, e_par: Jet) -> Jet:
    """Return the parallel transport (3.4) of a normal vector along the moving tangent."""
    if e_par.order == 0:
        return Jet([normal])
    turning = e_par.differentiate()
    return jets.solve_ode(lambda e: -(e_par * jets.dot(turning, e)), normal, e_par.order)


def rotate_components(xi: Sequence[Jet], psi: Jet) -> list[Jet]:
    """Return the components of a vector in axes that are turned by the angle ``psi``."""
    sin, cos = jets.sin_cos(psi)
    return [cos * xi[0] + sin * xi[1], cos * xi[1] - sin * xi[0]]


class PathManifold:
    """Path as a :class:`~pfsc_drake.control.manifolds.manifold.Manifold`.

    Its coordinates are arc length, two transversal ones and, with orientation, the three ZYX
    angles of the tool, the two of an axis of it, about which the tool may then turn freely, or
    the one of its turn about an axis in space, such as of an SCARA.

    Args:
        order: Relative degree r of the law, 1 to 5.
        oriented: Whether the path has an orientation.
        tool_axis: The axis that alone follows the orientation, in the tool frame, of any length,
            shape (3,); None if the whole tool does.
        yaw_axis: The axis about which alone the tool's turn follows the orientation, world axes,
            of any length, shape (3,); None if more does.
        euler: ``zyx`` or ``zyz`` for differences of Euler angles, see :class:`ToolOrientation`.
        turning: Whether ``e_perp`` is prescribed with the path, such as the normal of a surface
            that the path lies on, rather than transported in parallel.
        length: Length of an open path [m], at whose ends a tool stops; None without ends.

    Attributes:
        tool: Controlled part of the tool's orientation.

    Raises:
        InputError: If the order is out of range, or an axis has no direction, or no orientation
            to follow.
    """

    name = "path"
    follows_time = False

    def __init__(
        self,
        order: int,
        *,
        oriented: bool,
        tool_axis: np.ndarray | None = None,
        yaw_axis: np.ndarray | None = None,
        euler: str | None = None,
        turning: bool = False,
        length: float | None = None,
    ) -> None:
        self.tool = ToolOrientation(
            oriented, tool_axis=tool_axis, yaw_axis=yaw_axis, euler=euler, manifold=self.name
        )
        self.layout = PathPointLayout(order, oriented, turning)
        eta, *across = _TRANSLATIONAL
        # coordinates of a point that moves with time are errors, which have no ends
        if length is not None and not self.follows_time:
            eta = replace(eta, ends=(0.0, length))
        self.coordinates = (eta, *across, *self.tool.coordinates)

    @property
    def is_oriented(self) -> bool:
        """Whether the path has an orientation."""
        return self.layout.oriented

    def orientation(self, points: np.ndarray) -> np.ndarray:
        """Return the path's orientation, shape (samples, 3, 3)."""
        return quaternion_to_matrix(points[:, self.layout.quaternion][:, :4])

    def geometry(self, point: ca.SX) -> PathGeometry:
        """Return the parts of a path point for the maps."""
        layout = self.layout
        quaternion = ca.vertsplit(point[layout.quaternion], 4) if layout.oriented else []
        return PathGeometry(
            eta=point[layout.eta],
            normal=point[layout.normal],
            position=ca.vertsplit(point[layout.position], 3),
            quaternion=quaternion,
            tool=self.tool,
            turn=ca.vertsplit(point[layout.turn]) if layout.turning else (),
        )

    def virtual_output(self, y: Jet, R_e: Jet, point: ca.SX, lead: Sequence[Jet]) -> list[Jet]:
        """Return :func:`path_coordinates`."""
        return path_coordinates(y, R_e, self.geometry(point))

    def force(
        self, wrench: ca.SX, point: ca.SX, reference: ca.SX, *, with_turning: bool = False
    ) -> ca.SX:
        """Return (3.41) for the translational coordinates, (3.44) and (3.45) for the angles.

        Their power ``tau . yhat'`` is ``f . y_t' + mu . (omega - omega_d)``: the power of the
        wrench, with the rotation relative to the path's orientation. Where the frame turns
        with eta, the tool is assumed at its reference. With
        ``with_turning`` :func:`turning_force` is added to the tangential one; the power is then
        ``f . y_t' + mu . omega``, and ``A' tau = J_g' wrench`` with ``A = d yhat / dq``. If
        only an axis of the tool is controlled, this holds for torques across it; if only its turn
        about an axis in space is, for torques about that axis. Other torques move no coordinate
        and do not contribute to the forces.
        """
        force, torque, layout = wrench[:3], wrench[3:], self.layout
        translational = force_along_path(force, point, layout)
        if layout.turning:
            translational[0] += turning_along_path(force, point, layout, reference[1:3])
        if not layout.oriented:
            return translational
        torque, rotational = self.rotational_force(torque, point, reference[3:])
        if with_turning:
            translational[0] += turning_force(torque, point, layout)
        return ca.vertcat(translational, rotational)

    def rotational_force(self, torque: ca.SX, point: ca.SX, phi: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the torque that acts on the angles, shape (3,), and the forces along them [Nm].

        With differences of Euler angles it is the torque in the turn of the reference.

        Args:
            torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
            point: Path point.
            phi: Desired angles of the tool [rad], shape (3,), (2,) or (1,).
        """
        if self.tool.yaw_axis is not None:
            return self.tool.yaw_torque(torque)
        quaternion, alignment = point[self.layout.quaternion][:4], self.tool.alignment
        if self.tool.euler is not None:
            return self.tool.euler_torque(torque, quaternion_matrix(quaternion), phi)
        if alignment is not None:
            torque = torque_across_axis(torque, quaternion_matrix(quaternion), phi, alignment)
        return torque, rotational_force(in_axes_of(quaternion, torque), phi, alignment)

    def axes(self, point: Any) -> Any:
        """Return ``[e_par, e_perp, e_cross]`` as columns, shape (3, 3)."""
        return path_axes(point, self.layout)
