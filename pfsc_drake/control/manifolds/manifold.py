"""Interfaces of manifolds and projections to the control laws."""

from collections.abc import Sequence
from typing import Any, Protocol

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.orientation import ToolOrientation
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel, pose_function

__all__ = [
    "Coordinate",
    "Kind",
    "Manifold",
    "PointLayout",
    "ProjectedManifold",
    "ProjectionLayout",
    "indices",
    "manifold_force_function",
]


class PointLayout(Protocol):
    """Layout of a manifold's point in a flat array of floats.

    The point is the output of a projector, or of another source of the manifold's coordinates, to
    the law at each tick.
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


class ProjectionLayout(PointLayout, Protocol):
    """Layout of the point of a manifold that the tool is projected onto."""

    @property
    def theta(self) -> slice:
        """Parameters of the closest point."""

    @property
    def eta(self) -> slice:
        """Tangential coordinates [m]."""

    @property
    def position(self) -> slice:
        """Position [m] and its derivatives, the position itself first."""

    @property
    def memory(self) -> slice:
        """Initial values of the next projection."""


class Manifold(Protocol):
    """Map from the tool's motion to coordinates that a law makes linear.

    Attributes:
        name: Name, one word.
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
        """Controlled part of the tool's orientation."""

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
            reference: Desired virtual output, shape (m,), for the
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


class ProjectedManifold(Manifold, Protocol):
    """Manifold that the tool is projected onto."""

    @property
    def layout(self) -> ProjectionLayout:
        """Layout of the manifold's point."""

    @property
    def is_oriented(self) -> bool:
        """Whether there is an orientation to follow."""

    def orientation(self, points: np.ndarray) -> np.ndarray:
        """Return the orientation at points of the manifold, shape (samples, 3, 3).

        Args:
            points: Shape (samples, layout.size), all finite.
        """


def indices(coordinates: Sequence[Coordinate], kind: Kind) -> slice:
    """Return the indices of the coordinates of a kind, which are contiguous.

    Args:
        coordinates: Coordinates of a manifold.
        kind: The kind.
    """
    matching = [i for i, coordinate in enumerate(coordinates) if coordinate.kind is kind]
    return slice(matching[0], matching[-1] + 1) if matching else slice(0, 0)


def manifold_force_function(manifold: Manifold, *, with_turning: bool = False) -> ca.Function:
    """Return :meth:`Manifold.force` as a function of numbers.

    Args:
        manifold: The manifold.
        with_turning: Whether torques act along tangential coordinates, as of
            :meth:`Manifold.force`.

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


class ToolKinematics(Block):
    """Direct kinematics (2.5) of a robot.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        tool_pose (output): ``[y_t, R_e]``, tool point [m] and orientation by rows, in
            world axes, shape (12,).

    Args:
        robot: The robot.
        of_motors: Whether the pose belongs to the motor coordinates q_M, for laws that
            act on them.
    """

    def __init__(self, robot: RobotModel, of_motors: bool = False) -> None:
        n = robot.dimension
        self._part = slice(2 * n, 3 * n) if of_motors else slice(0, n)
        self._pose = pose_function(robot)
        self.inputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.outputs, self.states = {"tool_pose": Port(12, "m, 1")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"tool_pose": self._pose(u.joint_state[self._part])}


class ProjectionEvaluator(Protocol):
    """Functions for the projection of a point onto a manifold."""

    @property
    def layout(self) -> ProjectionLayout:
        """Layout of the manifold's point."""

    @property
    def evaluate(self) -> ca.Function:
        """``(y_t, memory) -> manifold_point``: projection, started from the last one."""

    @property
    def find(self) -> ca.Function:
        """``y_t -> memory``: the closest point of the whole manifold."""


class Projector(Block):
    """Orthogonal projection onto a manifold, (3.6), (4.9).

    Newton's iteration (3.72), (4.48) starts from the projection of the last tick, the memory. It
    follows its branch through self-intersections and counts revolutions in closed directions. For a
    path the memory is only the unwrapped parameter ``theta*``: arc length and parallel transport
    frame are functions of it, so that neither drifts nor depends on the speed.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        manifold_point (output): The manifold next to the tool, laid out by ``layout``.

    State:
        place: The part ``layout.memory`` of the last point. It starts at the closest point of the
        whole manifold, and is unchanged while the tool's position is NaN or infinite.

    Args:
        evaluator: The manifold.
        start: Added to the initial memory, such as the initial lengths of a motion along a surface;
            zero if omitted.

    Attributes:
        layout: Layout of the manifold's point.
    """

    def __init__(self, evaluator: ProjectionEvaluator, start: np.ndarray | None = None) -> None:
        self.layout, self._evaluator = evaluator.layout, evaluator
        memory = self.layout.memory
        self.inputs = {"tool_pose": Port(12, "m, 1")}
        self.outputs = {"manifold_point": Port(self.layout.size)}
        self.states = {"projection": memory.stop - memory.start}
        self._start = np.zeros(self.states["projection"]) if start is None else start

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial state; omitted parts are zero."""
        return {"projection": self._evaluator.find(u.tool_pose[:3]) + ca.DM(self._start)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"manifold_point": self._evaluator.evaluate(u.tool_pose[:3], x.projection)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the state at the next tick; omitted parts stay."""
        memory = y.manifold_point[self.layout.memory]
        return {"projection": where(all_finite(memory), memory, x.projection)}
