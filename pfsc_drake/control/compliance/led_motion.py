"""A tool that a hand leads along a path or a surface, as far as the robot can follow."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, any_of, unit, where
from pfsc_drake.control.fixtures.program import SLOTS, program_function
from pfsc_drake.control.fixtures.robot_limits import RobotLimits, limit_kinds, tightest_function
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import Manifold, indices

# below it a limit does not depend on the motion along the manifold
_ACROSS = 1e-6


class LedMotion(Block):
    """Takes back a speed along a path or a surface to what the robot can follow.

    With the directions t of the tangential coordinates, a limit ``n w >= -beta`` of the tool's
    velocity (:class:`RobotLimits`) is one of ``eta'``, ``(n t) eta' >= -beta``. Near the manifold
    ``y' = t eta'``; motion across it, which a position loop makes, goes on as measured. Of the
    twelve tightest of these, :func:`program_function` finds the motion next to the wanted one.

    Ports:
        wanted_speed (input): Of the tangential coordinates, then their mass, shape (count + 1,)
            [m/s, kg]; from :class:`ImpedanceFilter`. What is no number is left as it is.
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        manifold_point (input): Where on the manifold the tool is.
        allowed_speed (output): What of it the robot can follow, shape (count,) [m/s].
        limit_force (output): By what forces the robot's limits held the hand in the last interval,
            shape (kinds,) [N].

    State:
        limit_force: The same.

    Args:
        limits: Of the tool's velocity.
        manifold: The path or surface.
        period: Sampling time [s].

    Attributes:
        tangential: Which coordinates are tangential.
        kinds: What limits there are, see :func:`limit_kinds`, each once.
    """

    expands = False  # the program skips what is rare

    def __init__(self, limits: RobotLimits, manifold: Manifold, period: float) -> None:
        self._limits, self._axes = limits, manifold.axes
        self._program = program_function(period)
        self.tangential = indices(manifold.coordinates, Kind.TANGENTIAL)
        self._count = self.tangential.stop - self.tangential.start
        every = limit_kinds(limits.num_joints)
        self.kinds = list(dict.fromkeys(every))
        # 1 where a limit is of a kind
        self._of_kind = ca.DM([[one == kind for kind in self.kinds] for one in every])
        self.inputs = {
            "wanted_speed": Port(self._count + 1, "m/s, kg"),
            "joint_state": Port(4 * limits.num_joints, "rad, rad/s or m, m/s"),
            "manifold_point": Port(manifold.layout.size),
        }
        self.outputs = {
            "allowed_speed": Port(self._count, "m/s"),
            "limit_force": Port(len(self.kinds), "N"),
        }
        self.states = {"limit_force": len(self.kinds)}
        self.inner = {"held": len(self.kinds)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`; ``held``: by how much of each kind of limit [m/s^2]."""
        wanted = u.wanted_speed[: self._count]
        speed, held = self._allowed(u.joint_state, u.manifold_point, wanted)
        return {
            "allowed_speed": where(any_of(held), speed, wanted),
            "limit_force": x.limit_force,
            "held": held,
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        moves, mass = all_finite(u.wanted_speed[: self._count]), u.wanted_speed[self._count]
        return {"limit_force": where(moves, mass * y.held, x.limit_force)}

    def _allowed(self, joint_state: Any, point: Any, wanted: Any) -> tuple[Any, Any]:
        """Return the motion next to a wanted one that the limits allow, and what holds it.

        Args:
            joint_state: As measured, shape (4N,).
            point: The manifold's point.
            wanted: ``eta'`` [m/s], shape (1,) or (2,).

        Returns:
            ``eta'``, and by how much of each kind of limit it is held [m/s^2], shape (kinds,);
            zeros where a number is none.
        """
        n, unused = self._limits.num_joints, 3 - self._count
        limits = self._limits.function(joint_state[:n], joint_state[n : 2 * n])
        rows = limits[:, 1:4] @ self._axes(point)[:, : self._count]
        size = ca.sqrt(ca.sum2(rows**2))
        number = where(size > _ACROSS, limits[:, 0], -1.0)
        units = ca.horzcat(rows, limits[:, 4]) / ca.repmat(size, 1, self._count + 1)
        units = where(ca.repmat(number >= 0.0, 1, self._count + 1), units, 0.0)
        n_t = ca.horzcat(units[:, :-1], ca.DM.zeros(units.shape[0], unused))
        target = ca.vertcat(wanted, ca.DM.zeros(unused))
        pick = tightest_function(units.shape[0], SLOTS)
        picked = pick(ca.horzcat(number, n_t, units[:, -1]), target)
        # no beta is negative, so that rest is always allowed and no slot has to give way
        number, no = picked[:, 0], ca.DM.zeros(SLOTS)
        velocity, forces, _ = self._program(
            1.0, target, number >= 0.0, picked[:, 1:4], no, picked[:, 4], no, no
        )
        chosen = ca.horzcat(*[unit(number[i], self._of_kind.shape[0]) for i in range(SLOTS)])
        return velocity[: self._count], self._of_kind.T @ (chosen @ forces)
