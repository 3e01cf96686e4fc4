"""Moving path or surface: its frame is carried by a robot, turntable or conveyor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.control.manifolds.coordinate import Coordinate
from pfsc_drake.control.manifolds.manifold import Manifold, PointLayout
from pfsc_drake.control.manifolds.orientation import ToolOrientation
from pfsc_drake.jets import Jet

POSE_SIZE = 12


def frame_size(order: int) -> int:
    """Return the length of a frame jet, ``12 (order + 1)``.

    Args:
        order: Highest derivative.
    """
    return POSE_SIZE * (order + 1)


def frame_jets(frame: ca.SX) -> tuple[Jet, Jet]:
    """Return the motion of a frame C in the world as jets.

    Args:
        frame: Derivatives 0..r of ``[p_WC, R_WC by rows]``, shape (12 (r + 1),) [m, 1, per s, ..].

    Returns:
        ``p_WC``, vector jet, and ``R_WC``, matrix jet, both of order r.
    """
    rows = ca.vertsplit(frame, POSE_SIZE)
    position = Jet.from_derivatives([row[:3] for row in rows])
    rotation = Jet.from_derivatives([ca.reshape(row[3:], 3, 3).T for row in rows])
    return position, rotation


def frame_vector(position: Jet, rotation: Jet) -> Any:
    """Return jets of a frame as :func:`frame_jets` reads them, shape (12 (r + 1),).

    Args:
        position: ``p_WC`` [m], vector jet.
        rotation: ``R_WC``, matrix jet of the same order.
    """
    both = zip(position.derivatives(), rotation.derivatives(), strict=True)
    return ca.vertcat(*[ca.vertcat(p, ca.vec(R.T)) for p, R in both])


def relative_to(position: Jet, rotation: Jet, y: Jet, R_e: Jet) -> tuple[Jet, Jet]:
    """Return a tool's motion relative to a moving frame C.

    ``y_C = R_WC' (y_t - p_WC)`` and ``R_Ce = R_WC' R_e``, products of jets, which include velocity,
    Coriolis and centrifugal terms, and their counterparts of higher orders.

    Args:
        position: ``p_WC`` [m], vector jet.
        rotation: ``R_WC``, matrix jet.
        y: Tool point ``y_t`` in the world [m], vector jet.
        R_e: Orientation of the tool in the world, matrix jet.

    Returns:
        Tool point [m] and orientation in C, jets of the lower order of both motions.
    """
    R_CW = rotation.T
    return R_CW @ (y - position), R_CW @ R_e


@dataclass(frozen=True)
class FramedLayout:
    """Layout of a moving manifold's point: the manifold's own, then its frame.

    Attributes:
        own: Layout of the manifold's point in its frame C.
    """

    own: PointLayout

    @property
    def size(self) -> int:
        """Length of the array."""
        return self.own.size + frame_size(self.own.order)

    @property
    def order(self) -> int:
        """Relative degree r that the point's derivatives suffice for."""
        return self.own.order

    @property
    def alpha(self) -> slice:
        """Distance from the manifold as a fraction of the feasible neighbourhood, [1]."""
        return self.own.alpha

    @property
    def status(self) -> slice:
        """A :class:`~pfsc_drake.geometry.ProjectionStatus`, [1]."""
        return self.own.status

    @property
    def frame(self) -> slice:
        """Derivatives 0..r of the frame, see :func:`frame_jets`."""
        return slice(self.own.size, self.size)


class MovingFrameManifold:
    """Manifold in a frame C that moves in the world, as another manifold.

    The virtual output belongs to the tool's motion relative to C. With the frame's motion known up
    to its derivative of order r, the output's r-th derivative remains affine in the joints',
    ``yhat^(r) = A q^(r) + b``: the frame's motion is part of b, and nothing is differenced. The
    frame may be carried by another robot, a turntable or a conveyor.

    Coordinates, lengths and angles belong to the manifold in C; a ``yaw_axis`` is fixed in C.

    Args:
        own: The manifold in C.

    Attributes:
        name: The manifold's name with ``_in_frame``.
        coordinates: The manifold's coordinates.
        follows_time: Whether its point moves along it with time.
        layout: The manifold's layout, and the frame.
    """

    def __init__(self, own: Manifold) -> None:
        self.own = own
        self.name = f"{own.name}_in_frame"
        self.coordinates: tuple[Coordinate, ...] = own.coordinates
        self.follows_time = own.follows_time
        self.layout = FramedLayout(own.layout)

    @property
    def tool(self) -> ToolOrientation:
        """Controlled part of the tool's orientation."""
        return self.own.tool

    def virtual_output(self, y: Jet, R_e: Jet, point: ca.SX, lead: Sequence[Jet]) -> list[Jet]:
        """Return the manifold's coordinates of the tool's motion relative to the frame."""
        own_point, frame = self._split(point)
        return self.own.virtual_output(*relative_to(*frame_jets(frame), y, R_e), own_point, lead)

    def force(
        self, wrench: ca.SX, point: ca.SX, reference: ca.SX, *, with_turning: bool = False
    ) -> ca.SX:
        """Return the generalized forces along the coordinates, shape (m,) [N, Nm].

        Their power is the wrench's on the tool's motion relative to the frame.
        """
        own_point, frame = self._split(point)
        R_CW = _rotation(frame).T
        turned = ca.vertcat(R_CW @ wrench[:3], R_CW @ wrench[3:])
        return self.own.force(turned, own_point, reference, with_turning=with_turning)

    def axes(self, point: Any) -> Any:
        """Return the directions of the translational coordinates in the world, shape (3, 3)."""
        own_point, frame = self._split(point)
        return _rotation(frame) @ self.own.axes(own_point)

    def frame_rate(self, point: Any) -> Any:
        """Return the first derivative of ``[p_WC, R_WC]``, shape (12,) [m/s, 1/s].

        Args:
            point: The manifold's point, laid out by :attr:`layout`.
        """
        return self._split(point)[1][POSE_SIZE : 2 * POSE_SIZE]

    def _split(self, point: Any) -> tuple[Any, Any]:
        """Return the manifold's point in its frame, and the frame."""
        size = self.layout.own.size
        return point[:size], point[size:]


def _rotation(frame: Any) -> Any:
    """Return ``R_WC`` of a frame jet, shape (3, 3)."""
    return ca.reshape(frame[3:POSE_SIZE], 3, 3).T
