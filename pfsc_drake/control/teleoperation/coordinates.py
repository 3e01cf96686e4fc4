"""Coordinates of the body that a side of a teleoperation moves, and their generalized forces."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.blocks.rotations import matrix_of, moment_of, nearest_turn, rotation_vector

LINEAR, TURNING = slice(0, 3), slice(3, None)


@dataclass(frozen=True)
class PortMotion:
    """Coordinates of a body and their change since the last tick.

    Attributes:
        coordinates: Coordinates since the start, shape (axes,) [m, rad].
        step: Change of the coordinates since the last tick, shape (axes,).
        displacement: Displacement since the last tick, conjugate to forces, shape (axes,) [m, rad].
        states: States at the next tick by name.
    """

    coordinates: Any
    step: Any
    displacement: Any
    states: dict[str, Any]


class PointCoordinates:
    """Three axes: position of a point along the world axes."""

    axes = 3

    def __init__(self) -> None:
        self.inputs = {"position": Port(3, "m")}
        self.states = {"origin": 3, "last": 3}

    def initial(self, u: Values) -> dict[str, Any]:
        """Return the initial states."""
        return {"origin": u.position, "last": u.position}

    def motion(self, x: Values, u: Values) -> PortMotion:
        """Return the motion; NaN or infinite inputs keep the last coordinates."""
        position = where(all_finite(u.position), u.position, x.last)
        step = position - x.last
        states = {"origin": x.origin, "last": position}
        return PortMotion(position - x.origin, step, step, states)

    def wrench(self, coordinates: Any, force: Any) -> Any:
        """Return the wrench of equal work for a force on the coordinates, shape (axes,) [N, Nm].

        Args:
            coordinates: Coordinates, shape (axes,).
            force: Force on the coordinates, shape (axes,).
        """
        return force


class BodyCoordinates(PointCoordinates):
    """Six axes: position and rotation of a body.

    The rotation is the vector phi of ``R R_0'``, axis times angle, with R_0 the initial
    orientation: two sides agree in it if they agree in R. It continues beyond pi, up to 2 pi.
    """

    axes = 6

    def __init__(self) -> None:
        super().__init__()
        self.inputs |= {"orientation": Port(9)}
        self.states |= {"first_rows": 9, "last_rows": 9, "turn": 3}

    def initial(self, u: Values) -> dict[str, Any]:
        """Return the initial states."""
        return super().initial(u) | {"first_rows": u.orientation, "last_rows": u.orientation}

    def motion(self, x: Values, u: Values) -> PortMotion:
        """Return the motion; NaN or infinite inputs keep the last coordinates."""
        point = super().motion(x, u)
        rows = where(all_finite(u.orientation), u.orientation, x.last_rows)
        R = matrix_of(rows)
        turn = nearest_turn(rotation_vector(R @ matrix_of(x.first_rows).T), x.turn)
        return PortMotion(
            ca.vertcat(point.coordinates, turn),
            ca.vertcat(point.step, turn - x.turn),
            ca.vertcat(point.displacement, rotation_vector(R @ matrix_of(x.last_rows).T)),
            point.states | {"first_rows": x.first_rows, "last_rows": rows, "turn": turn},
        )

    def wrench(self, coordinates: Any, force: Any) -> Any:
        """Return the wrench of equal work for a force on the coordinates, (axes,) [N, Nm]."""
        return ca.vertcat(force[LINEAR], moment_of(coordinates[TURNING], force[TURNING]))
