"""Orientation of a tool against a reference on jets: three angles, two of its axis, or its yaw.

Alternatively the difference of Euler angles, as of the analytic Jacobian:
``phi = Phi(R_e) - Phi(R_d)``, whose rates are ``T^-1(Phi_e) omega_e - T^-1(Phi_d) omega_d`` with T
of (2.15), so that the rows of the decoupling matrix are those of (2.16) where the reference rests.
"""

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import rotation_to_axis
from pfsc_drake.jets import Jet


def orientation_error(R_e: Jet, R_d: Jet, alignment: np.ndarray | None = None) -> list[Jet]:
    """Return the ZYX angles (2.7) of ``R_d' R_e``, each from the ratio of two entries.

    A factor that scales all entries of ``R_d`` alike cancels.

    If only an axis of the tool is controlled, ``R_d C`` and ``R_e C`` replace ``R_d`` and
    ``R_e``, with the constant rotation C whose first column is the axis in the tool frame. The
    third angle then is a turn about the axis and is omitted; the others depend on the first
    column of ``C' R_d' R_e C`` alone, the direction of the axis. Small ones are rotations about
    the third and the second column of ``R_d C``.

    Args:
        R_e: Tool orientation, matrix jet.
        R_d: Reference orientation, matrix jet, times any positive scalar signal.
        alignment: The rotation C, shape (3, 3), or None for the whole orientation.

    Returns:
        3 scalar jets [rad], 2 of an axis.
    """
    if alignment is not None:
        R_d, R_e = R_d @ alignment, R_e @ alignment
    x = R_d.T @ R_e[:, 0]
    horizontal = jets.sqrt(x[0] ** 2 + x[1] ** 2)
    direction = [jets.atan2(x[1], x[0]), jets.atan2(-x[2], horizontal)]
    if alignment is not None:
        return direction
    z = R_d[:, 2]
    return [*direction, jets.atan2(jets.dot(z, R_e[:, 1]), jets.dot(z, R_e[:, 2]))]


def yaw_error(R_e: Jet, R_d: Jet, axis: np.ndarray) -> Jet:
    """Return the angle by which ``R_e`` is turned about a fixed axis against ``R_d`` [rad].

    With the quaternion ``(w, v)`` of ``M = R_e R_d'`` and the axis ``a`` it is
    ``2 atan2(a . v, w)``. In right-handed axes ``a, b, c`` it comes from the entries of M:
    ``c' M b - b' M c = 4 w a . v`` and ``b' M b + c' M c = 2 w^2 - 2 (a . v)^2``. Where the tool is
    not tilted against its reference it is the angle of M itself, and its rate the relative angular
    velocity about ``a``; it is defined unless the tilt is half a turn. A factor that scales all
    entries of ``R_d`` alike cancels.

    Args:
        R_e: Tool orientation, matrix jet.
        R_d: Reference orientation, matrix jet, times any positive scalar signal.
        axis: ``a``, world axes, of length one, shape (3,).
    """
    _, b, c = rotation_to_axis(axis).T
    b_e, c_e, b_d, c_d = R_e.T @ b, R_e.T @ c, R_d.T @ b, R_d.T @ c
    sine = jets.dot(c_e, b_d) - jets.dot(b_e, c_d)
    return jets.atan2(sine, jets.dot(b_e, b_d) + jets.dot(c_e, c_d))


def quaternion_rotation(q: Jet) -> Jet:
    """Return ``|q|^2 R(q)`` of a quaternion signal (w, x, y, z)."""
    w, x, y, z = (q[i] for i in range(4))
    ww, xx, yy, zz = w**2, x**2, y**2, z**2
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    rows = [
        [ww + xx - yy - zz, (xy - wz) * 2.0, (xz + wy) * 2.0],
        [(xy + wz) * 2.0, ww - xx + yy - zz, (yz - wx) * 2.0],
        [(xz - wy) * 2.0, (yz + wx) * 2.0, ww - xx - yy + zz],
    ]
    return Jet(
        [
            ca.vertcat(*[ca.horzcat(*[entry.coefficients[k] for entry in row]) for row in rows])
            for k in range(q.order + 1)
        ]
    )


def euler_difference(R_e: Jet, R_d: Jet, convention: str) -> list[Jet]:
    """Return the Euler angles of ``R_e`` minus those of ``R_d``, between -pi and pi each.

    Each angle is the polar angle of a point in a plane, and the difference the angle between two
    points, so that it does not jump where an angle does. A factor that scales all entries of
    ``R_d`` alike cancels.
    Not defined where the second angle of either is at an end of its range.

    Args:
        R_e: Tool orientation, matrix jet.
        R_d: Reference orientation, matrix jet, times any positive scalar signal.
        convention: ``zyx`` (2.7) or ``zyz`` (2.6).

    Returns:
        3 scalar jets [rad].
    """
    pairs = zip(_points(R_e, convention), _points(R_d, convention), strict=True)
    return [
        jets.atan2(y_e * x_d - x_e * y_d, x_e * x_d + y_e * y_d) for (y_e, x_e), (y_d, x_d) in pairs
    ]


def euler_torque(torque: ca.SX, R_d: ca.SX, phi: ca.SX, convention: str) -> tuple[ca.SX, ca.SX]:
    """Return the parts of a torque in the turn of the reference, and along the angles.

    ``omega_e = T(Phi_e) (phi' + Phi_d')`` and ``Phi_d' = T^-1(Phi_d) omega_d``: the power of a
    torque mu is the power of ``T'(Phi_e) mu`` along ``phi``, plus the power of
    ``T^-T(Phi_d) T'(Phi_e) mu`` in the turn of the reference.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        R_d: Reference orientation, shape (3, 3).
        phi: Desired angles of the tool against the reference [rad], shape (3,).
        convention: ``zyx`` or ``zyz``.

    Returns:
        Torque that turns with the reference, world axes [Nm], shape (3,), and generalized forces
        along the angles [Nm], shape (3,).
    """
    points = _points(Jet([R_d]), convention)
    Phi_d = ca.vertcat(*[ca.atan2(y.coefficients[0], x.coefficients[0]) for y, x in points])
    along = euler_rates(Phi_d + phi, convention).T @ torque
    return ca.solve(euler_rates(Phi_d, convention).T, along), along


def euler_rates(Phi: ca.SX, convention: str) -> ca.SX:
    """Return T of ``omega = T Phi'`` (2.15), world axes, shape (3, 3).

    Args:
        Phi: Euler angles [rad], shape (3,).
        convention: ``zyx`` or ``zyz``.
    """
    sin_1, cos_1, sin_2, cos_2 = ca.sin(Phi[0]), ca.cos(Phi[0]), ca.sin(Phi[1]), ca.cos(Phi[1])
    across, down = (cos_2, -sin_2) if convention == "zyx" else (sin_2, cos_2)
    return ca.vertcat(
        ca.horzcat(0.0, -sin_1, cos_1 * across),
        ca.horzcat(0.0, cos_1, sin_1 * across),
        ca.horzcat(1.0, 0.0, down),
    )


def _points(R: Jet, convention: str) -> list[tuple[Jet, Jet]]:
    """Return (y, x) of a point at each of the angles of a rotation times a positive scalar."""
    if convention == "zyx":
        first = R[1, 0], R[0, 0]
        second, third = (-R[2, 0], _length(*first)), (R[2, 1], R[2, 2])
    else:
        first = R[1, 2], R[0, 2]
        second, third = (_length(*first), R[2, 2]), (R[2, 1], -R[2, 0])
    return [first, second, third]


def _length(y: Jet, x: Jet) -> Jet:
    return jets.sqrt(x**2 + y**2)


def _angles(*axes: str) -> tuple[Coordinate, ...]:
    return tuple(Coordinate(f"phi_{axis}", Kind.ROTATIONAL, f"tau_{axis}") for axis in axes)


_ANGLES = {"zyx": _angles("z", "y", "x"), "zyz": _angles("z", "y", "z2")}
_YAW = (Coordinate("phi", Kind.ROTATIONAL, "tau_phi"),)


class ToolOrientation:
    """Controlled part of a tool's orientation: all, the direction of an axis, or a turn.

    Args:
        oriented: Whether there is an orientation to follow.
        tool_axis: The axis that alone follows the orientation, in the tool frame, of any length,
            shape (3,); None if more of the tool does.
        yaw_axis: The axis about which alone the tool's turn follows the orientation, such as the
            vertical of an SCARA, world axes, of any length, shape (3,); None if more does.
        euler: ``zyx`` or ``zyz`` for the Euler angles of the tool minus those of the reference as
            coordinates, see :mod:`~pfsc_drake.control.manifolds.orientation`; None
            for the ZYX angles of ``R_d' R_e``.
        manifold: Name of the manifold in error messages.

    Attributes:
        alignment: Rotation whose first column is the tool's axis, shape (3, 3), or None, see
            :func:`~pfsc_drake.control.manifolds.orientation.orientation_error`.
        yaw_axis: The axis of turning, of length one, shape (3,), or None.
        euler: The convention, or None.
        coordinates: None, the three angles of the tool, the two of its axis, or the one of its
            turn.

    Raises:
        InputError: If an axis has no direction, or no orientation to follow, or several are set,
            or the convention is unknown.
    """

    def __init__(
        self,
        oriented: bool = True,
        *,
        tool_axis: np.ndarray | None = None,
        yaw_axis: np.ndarray | None = None,
        euler: str | None = None,
        manifold: str = "manifold",
    ) -> None:
        axes = {"tool axis": tool_axis, "yaw axis": yaw_axis}
        choices = [f"{name} {list(axis)}" for name, axis in axes.items() if axis is not None]
        if euler is not None:
            choices.append(f"Euler angles {euler}")
        if choices and not oriented:
            raise InputError(f"{choices[0]}: the {manifold} has no orientation to follow")
        if len(choices) > 1:
            raise InputError(f"{' and '.join(choices)}: one of them at most")
        if euler not in (None, *_ANGLES):
            raise InputError(f"{choices[0]}: unknown; allowed are {', '.join(_ANGLES)}")
        self.euler = euler
        self.alignment = None if tool_axis is None else rotation_to_axis(tool_axis)
        self.yaw_axis = None if yaw_axis is None else rotation_to_axis(yaw_axis)[:, 0]
        angles = _ANGLES[euler or "zyx"] if yaw_axis is None else _YAW
        self.coordinates = angles[: 2 if tool_axis is not None else 3] if oriented else ()

    @property
    def tool_axis(self) -> np.ndarray | None:
        """The axis that alone follows the orientation, of length one, shape (3,), or None."""
        return None if self.alignment is None else self.alignment[:, 0]

    def error(self, R_e: Jet, R_d: Jet) -> list[Jet]:
        """Return the angles of the tool against its reference [rad].

        Args:
            R_e: Tool orientation, matrix jet.
            R_d: Reference orientation, matrix jet, times any positive scalar signal.

        Returns:
            A scalar jet for each of the coordinates.
        """
        if self.yaw_axis is not None:
            return [yaw_error(R_e, R_d, self.yaw_axis)]
        if self.euler is not None:
            return euler_difference(R_e, R_d, self.euler)
        return orientation_error(R_e, R_d, self.alignment)

    def yaw_torque(self, torque: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return a torque's part about the axis of turning, shape (3,), and its size [Nm].

        It alone does work on the turn of a tool that is not tilted against its reference.

        Args:
            torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        """
        size = ca.dot(ca.DM(self.yaw_axis), torque)
        return size * ca.DM(self.yaw_axis), size

    def euler_torque(self, torque: ca.SX, R_d: ca.SX, phi: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return :func:`~pfsc_drake.control.manifolds.orientation.euler_torque`."""
        assert self.euler is not None
        return euler_torque(torque, R_d, phi, self.euler)
