"""A wrench that slows a robot down along its path and does nothing else."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, where
from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.control.manifolds.path import PathManifold, path_coordinates
from pfsc_drake.physics.force_profile import smooth_pulse
from pfsc_drake.robot.robot_model import RobotModel

_LOOKS_BEFORE = 0.1  # s


class DecoupledForce(Block):
    """A pulse of the wrench of :func:`decoupled_force_function`.

    The wrench's direction is that of the last tick; its size follows the time smoothly.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point (input): The path next to the tool.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm].

    State:
        The wrench of ``unit`` size; looked for while there is a force or will be soon.

    Args:
        robot: A robot with six axes.
        manifold: A path with orientation.
        pulse: ``begin, end, ramp`` [s] and ``force`` along the tangent [N].
        period: Sampling time [s].
    """

    expands = False  # the wrench is long, and rarely needed

    def __init__(
        self,
        robot: RobotModel,
        manifold: PathManifold,
        pulse: tuple[float, float, float, float],
        period: float,
    ) -> None:
        self._begin, self._end, self._ramp, self._force = pulse
        self._size, self._period = robot.dimension, period
        self._wrench = decoupled_force_function(robot, manifold)
        self.inputs = {
            "joint_state": Port(4 * robot.dimension, "rad, rad/s or m, m/s"),
            "manifold_point": Port(manifold.layout.size),
        }
        self.outputs, self.states = {"wrench": Port(6, "N, Nm")}, {"unit": 6}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        pulse = smooth_pulse(t * self._period, self._begin, self._end, self._ramp)
        return {"wrench": self._force * pulse * x.unit}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        time, q = t * self._period, u.joint_state[: self._size]
        near = all_of(time >= self._begin - _LOOKS_BEFORE, time <= self._end)
        unit = ca.if_else(near, self._wrench(q, u.manifold_point), x.unit, True)
        return {"unit": where(all_finite(unit), unit, x.unit)}


def decoupled_force_function(robot: RobotModel, manifold: PathManifold) -> ca.Function:
    """Return the wrench whose effect on the slow dynamics (3.68) is along ``eta`` alone.

    An external wrench w accelerates the virtual output by ``A (D_E + D_M)^-1 J_g' w``.
    A force along the tangent moves the other coordinates too, through the arm's inertia;
    the wrench returned here moves ``eta`` only, and its force along the tangent is 1 N.

    Args:
        robot: A robot with six axes.
        manifold: A path with orientation.

    Returns:
        CasADi function ``(q, manifold_point) -> [force, torque]`` at the tool point, world
        axes, shapes (6,), (size,) and (6,).
    """
    n = robot.dimension
    q, rate = ca.SX.sym("q", n), ca.SX.sym("rate", n)
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    path = manifold.geometry(point)
    y, R_e = robot.tool_pose(joint_jets([q, rate]))
    output = path_coordinates(y, R_e, path)
    A = ca.jacobian(ca.vertcat(*[x.coefficients[1] for x in output]), rate)
    spin = R_e.coefficients[1] @ R_e.coefficients[0].T
    twist = ca.vertcat(y.coefficients[1], ca.inv_skew(spin))
    J_g = ca.jacobian(twist, rate)
    tau = (robot.mass_matrix(q) + ca.diag(robot.D_M)) @ ca.solve(A, ca.SX.eye(n)[:, 0])
    wrench = ca.solve(J_g.T, tau)
    tangent = path.position[1] / ca.norm_2(path.position[1])
    wrench = wrench / ca.dot(wrench[:3], tangent)
    return ca.Function("decoupled_force", [q, point], [ca.densify(wrench)])
