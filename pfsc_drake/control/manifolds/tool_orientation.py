"""What of a tool's orientation a manifold has coordinates for."""

import casadi as ca
import numpy as np

from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.euler_angles import euler_difference, euler_torque
from pfsc_drake.control.manifolds.orientation import orientation_error, yaw_error
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import rotation_to_axis
from pfsc_drake.jets import Jet


def _angles(*axes: str) -> tuple[Coordinate, ...]:
    return tuple(Coordinate(f"phi_{axis}", Kind.ROTATIONAL, f"tau_{axis}") for axis in axes)


_ANGLES = {"zyx": _angles("z", "y", "x"), "zyz": _angles("z", "y", "z2")}
_YAW = (Coordinate("phi", Kind.ROTATIONAL, "tau_phi"),)


class ToolOrientation:
    """All of a tool's orientation, the direction of an axis of it, or its turn about the vertical.

    Args:
        oriented: Whether there is an orientation to follow.
        tool_axis: The axis that alone follows the orientation, in the tool frame, of any length,
            shape (3,); None if more of the tool does.
        yaw_axis: The axis about which alone the tool's turn follows the orientation, such as the
            vertical of an SCARA, world axes, of any length, shape (3,); None if more does.
        euler: ``zyx`` or ``zyz``, if the coordinates are to be the Euler angles of the tool less
            those of the reference, see :mod:`~pfsc_drake.control.manifolds.euler_angles`; None
            for the ZYX angles of ``R_d' R_e``.
        manifold: What to call what has the orientation in errors.

    Attributes:
        alignment: Rotation whose first column is the tool's axis, shape (3, 3), or None, see
            :func:`~pfsc_drake.control.manifolds.orientation.orientation_error`.
        yaw_axis: The axis of turning, of length one, shape (3,), or None.
        euler: The convention, or None.
        coordinates: None, the three angles of the tool, the two of its axis, or the one of its
            turn.

    Raises:
        InputError: If an axis has no direction, or no orientation to follow, or several are given,
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
        given = {"tool axis": tool_axis, "yaw axis": yaw_axis}
        said = [f"{name} {list(axis)}" for name, axis in given.items() if axis is not None]
        if euler is not None:
            said.append(f"Euler angles {euler}")
        if said and not oriented:
            raise InputError(f"{said[0]}: the {manifold} has no orientation to follow")
        if len(said) > 1:
            raise InputError(f"{' and '.join(said)}: one of them at most")
        if euler not in (None, *_ANGLES):
            raise InputError(f"{said[0]}: unknown; allowed are {', '.join(_ANGLES)}")
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
        """Return :func:`~pfsc_drake.control.manifolds.euler_angles.euler_torque`."""
        assert self.euler is not None
        return euler_torque(torque, R_d, phi, self.euler)
