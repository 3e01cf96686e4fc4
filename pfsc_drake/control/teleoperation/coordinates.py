"""What a side of a teleoperation moves, as coordinates, and what does work on it."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.blocks.rotations import matrix_of, moment_of, nearest_turn, rotation_vector

LINEAR, TURNING = slice(0, 3), slice(3, None)


@dataclass(frozen=True)
class Moved:
    """Where something is, and how it came there.

    Attributes:
        there: Coordinates since the start, shape (axes,) [m, rad].
        step: By how much they have changed since the last tick, shape (axes,).
        way: Displacement of that tick, which held forces do work along, shape (axes,) [m, rad].
        after: What is remembered, by state.
    """

    there: Any
    step: Any
    way: Any
    after: dict[str, Any]


class MovedPoint:
    """Three axes: a point, along the world's axes."""

    axes = 3

    def __init__(self) -> None:
        self.inputs = {"position": Port(3, "m")}
        self.states = {"origin": 3, "last": 3}

    def initial(self, u: Values) -> dict[str, Any]:
        """Return what is remembered at the start."""
        return {"origin": u.position, "last": u.position}

    def moved(self, x: Values, u: Values) -> Moved:
        """Return where it is; if the input is no number, where it was."""
        position = where(all_finite(u.position), u.position, x.last)
        step = position - x.last
        after = {"origin": x.origin, "last": position}
        return Moved(position - x.origin, step, step, after)

    def wrench(self, there: Any, force: Any) -> Any:
        """Return what does the work of a force on the coordinates, shape (axes,) [N, Nm].

        Args:
            there: Coordinates, shape (axes,).
            force: On them, shape (axes,).
        """
        return force


class MovedBody(MovedPoint):
    """Six axes: a point, and how a body is turned.

    The turn is the vector phi of ``R R_0'``, axis times angle, R_0 its orientation at the start:
    coordinates that two sides agree in when they agree in R. It goes on beyond pi, up to 2 pi.
    """

    axes = 6

    def __init__(self) -> None:
        super().__init__()
        self.inputs |= {"orientation": Port(9)}
        self.states |= {"first_rows": 9, "last_rows": 9, "turn": 3}

    def initial(self, u: Values) -> dict[str, Any]:
        """Return what is remembered at the start."""
        return super().initial(u) | {"first_rows": u.orientation, "last_rows": u.orientation}

    def moved(self, x: Values, u: Values) -> Moved:
        """Return where it is; if the input is no number, where it was."""
        point = super().moved(x, u)
        rows = where(all_finite(u.orientation), u.orientation, x.last_rows)
        R = matrix_of(rows)
        turn = nearest_turn(rotation_vector(R @ matrix_of(x.first_rows).T), x.turn)
        return Moved(
            ca.vertcat(point.there, turn),
            ca.vertcat(point.step, turn - x.turn),
            ca.vertcat(point.way, rotation_vector(R @ matrix_of(x.last_rows).T)),
            point.after | {"first_rows": x.first_rows, "last_rows": rows, "turn": turn},
        )

    def wrench(self, there: Any, force: Any) -> Any:
        """Return what does the work of a force on the coordinates, shape (axes,) [N, Nm]."""
        return ca.vertcat(force[LINEAR], moment_of(there[TURNING], force[TURNING]))
