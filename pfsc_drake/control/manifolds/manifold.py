"""What a law needs to know of a manifold: a path, a moving point, and others to come."""

from collections.abc import Sequence
from typing import Any, Protocol

import casadi as ca
import numpy as np

from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.orientation import ToolOrientation
from pfsc_drake.jets import Jet

__all__ = [
    "Coordinate",
    "Kind",
    "Manifold",
    "PlaceLayout",
    "PlaceManifold",
    "PointLayout",
    "indices",
    "manifold_force_function",
]


class PointLayout(Protocol):
    """Where the quantities of a manifold's point lie in a flat array of floats.

    The point is what a projector, or whatever else finds the place on the manifold, tells the
    law at each tick.
    """

    @property
    def size(self) -> int:
        """Length of the array."""

    @property
    def order(self) -> int:
        """Relative degree r that the point's derivatives suffice for."""

    @property
    def alpha(self) -> slice:
        """Distance from the manifold as a fraction of the feasible neighbourhood, [1]."""

    @property
    def status(self) -> slice:
        """A :class:`~pfsc_drake.geometry.ProjectionStatus`, [1]."""


class PlaceLayout(PointLayout, Protocol):
    """Layout of the point of a manifold that the tool is projected onto."""

    @property
    def theta(self) -> slice:
        """Parameters of the nearest point."""

    @property
    def eta(self) -> slice:
        """Tangential coordinates [m]."""

    @property
    def position(self) -> slice:
        """Position [m] and its derivatives, the position itself first."""

    @property
    def memory(self) -> slice:
        """What tells the next projection where to begin."""


class Manifold(Protocol):
    """A map from the tool's motion to coordinates that a law makes linear.

    Attributes:
        name: In one word.
        coordinates: The m coordinates of the virtual output, in order.
        layout: Layout of the manifold's point.
        follows_time: Whether the point moves with time, so that the virtual output is the error
            from it. The map then needs ``lead``, derivatives of the tangential coordinates'
            references.
    """

    name: str
    coordinates: tuple[Coordinate, ...]
    follows_time: bool

    @property
    def layout(self) -> PointLayout:
        """Layout of the manifold's point."""

    @property
    def tool(self) -> ToolOrientation:
        """What of the tool's orientation there are coordinates for."""

    def virtual_output(self, y: Jet, R_e: Jet, point: ca.SX, lead: Sequence[Jet]) -> list[Jet]:
        """Return the coordinates of a moving tool, m scalar jets of the order of ``y``.

        Args:
            y: Tool point [m], vector jet of order 1 to r.
            R_e: Tool orientation, matrix jet of the same order.
            point: The manifold's point, laid out by ``layout``.
            lead: References of the tangential coordinates [m], scalar jets; only used by manifolds
                that follow time.
        """

    def force(
        self, wrench: ca.SX, point: ca.SX, reference: ca.SX, *, with_turning: bool = False
    ) -> ca.SX:
        """Return the generalized forces along the coordinates, shape (m,) [N, Nm].

        Args:
            wrench: ``[force, torque]`` on the tool at the tool point, world axes, shape (6,).
            point: The manifold's point.
            reference: Virtual output that the tool is to have, shape (m,), for the
                orientation that torques are resolved in, and for the distance from a manifold
                whose lever arms change with it.
            with_turning: Whether torques act along tangential coordinates where the
                manifold's orientation turns.
        """

    def axes(self, point: Any) -> Any:
        """Return the directions of the translational coordinates as columns, shape (3, 3).

        Args:
            point: The manifold's point, shape (layout.size,): an expression, or numbers.
        """


class PlaceManifold(Manifold, Protocol):
    """A manifold that the tool is projected onto, in whose coordinates its place is told."""

    @property
    def layout(self) -> PlaceLayout:
        """Layout of the manifold's point."""

    @property
    def is_oriented(self) -> bool:
        """Whether there is an orientation to follow."""

    def orientation(self, points: np.ndarray) -> np.ndarray:
        """Return the orientation that belongs to places, shape (samples, 3, 3).

        Args:
            points: Shape (samples, layout.size), all finite.
        """


def indices(coordinates: Sequence[Coordinate], kind: Kind) -> slice:
    """Return where the coordinates of a kind stand; they are neighbours.

    Args:
        coordinates: Of a manifold.
        kind: The kind.
    """
    matching = [i for i, coordinate in enumerate(coordinates) if coordinate.kind is kind]
    return slice(matching[0], matching[-1] + 1) if matching else slice(0, 0)


def manifold_force_function(manifold: Manifold, *, with_turning: bool = False) -> ca.Function:
    """Return :meth:`Manifold.force` as a function of numbers.

    Args:
        manifold: The manifold.
        with_turning: See there.

    Returns:
        ``(wrench, manifold_point, reference) -> force``, shapes (6,), (size,), (m,), (m,).
    """
    wrench, point = ca.SX.sym("wrench", 6), ca.SX.sym("manifold_point", manifold.layout.size)
    reference = ca.SX.sym("reference", len(manifold.coordinates))
    force = manifold.force(wrench, point, reference, with_turning=with_turning)
    return ca.Function(
        "manifold_force",
        [wrench, point, reference],
        ca.cse([ca.densify(force)]),
        ["wrench", "manifold_point", "reference"],
        ["force"],
    )
