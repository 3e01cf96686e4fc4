"""Orientation of a tool against a reference on jets: three angles, or two of its axis."""

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.control.manifolds.manifold import Coordinate, Kind
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import rotation_to_axis
from pfsc_drake.jets import Jet

_ANGLES = tuple(
    Coordinate(f"phi_{axis}", Kind.ROTATIONAL, f"tau_{axis}") for axis in ("z", "y", "x")
)


class ToolOrientation:
    """What of a tool's orientation a manifold has coordinates for.

    Args:
        oriented: Whether the manifold has an orientation.
        tool_axis: The axis that alone follows the orientation, in the tool frame, of any length,
            shape (3,); None if the whole tool does.
        manifold: What to call the manifold in errors.

    Attributes:
        alignment: Rotation whose first column is the axis, shape (3, 3), or None, see
            :func:`orientation_error`.
        coordinates: None, the three ZYX angles of the tool, or the two of its axis.

    Raises:
        InputError: If the axis has no direction, or no orientation to follow.
    """

    def __init__(self, oriented: bool, tool_axis: np.ndarray | None, manifold: str) -> None:
        if tool_axis is not None and not oriented:
            raise InputError(
                f"tool axis {list(tool_axis)}: the {manifold} has no orientation to follow"
            )
        self.alignment = None if tool_axis is None else rotation_to_axis(tool_axis)
        angles = _ANGLES if tool_axis is None else _ANGLES[:2]
        self.coordinates = angles if oriented else ()

    @property
    def tool_axis(self) -> np.ndarray | None:
        """The axis that alone follows the orientation, of length one, shape (3,), or None."""
        return None if self.alignment is None else self.alignment[:, 0]


def orientation_error(R_e: Jet, R_d: Jet, alignment: np.ndarray | None = None) -> list[Jet]:
    """Return the ZYX angles (2.7) of ``R_d' R_e``, each from the ratio of two entries.

    A factor that scales all entries of ``R_d`` alike cancels.

    Where only an axis of the tool matters, ``R_d C`` and ``R_e C`` take the place of ``R_d`` and
    ``R_e``, with the constant rotation C whose first column is the axis in the tool frame. The
    third angle then is a turn about the axis and is left out; the others depend on the first
    column of ``C' R_d' R_e C`` alone, the direction of the axis. Small ones are those by which it
    turns about the third and the second column of ``R_d C``.

    Args:
        R_e: Tool orientation, matrix jet.
        R_d: Reference orientation, matrix jet, times any positive scalar signal.
        alignment: The rotation C, shape (3, 3), or None if all of the orientation matters.

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
