"""Interface of robot models to the control laws, for any kinematics."""

from collections.abc import Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.jets import Jet

# for functions of a robot whose parameters may be free symbols
MAY_BE_PARAMETRIC = {"allow_free": True}


class RobotModel(Protocol):
    """Kinematics and dynamics of a fully actuated robot on jets.

    Serial chains and the DELTA robot are such models; a robot of another kind only needs
    ``dimension``, ``gather`` and the three maps below.
    """

    @property
    def dimension(self) -> int:
        """Number of joints N."""

    @property
    def elastic_joints(self) -> np.ndarray:
        """Which joints have a finite stiffness, shape (N,) of bool."""
        return np.isfinite(self.K_s)

    @property
    def is_elastic(self) -> bool:
        """Whether every joint has a finite stiffness."""
        return bool(self.elastic_joints.all())

    @property
    def is_rigid(self) -> bool:
        """Whether no joint has a finite stiffness."""
        return not self.elastic_joints.any()

    @property
    def is_massless(self) -> bool:
        """Whether all links have no mass: only the kinematics are modelled."""
        return False

    @property
    def numeric(self) -> "RobotModel":
        """The robot with numbers for all parameters: itself, unless some are symbols."""
        return self

    @property
    def viscous_damping(self) -> np.ndarray:
        """Damping of the joints' own bearings at the drives, shape (N,) [Nm s/rad or N s/m]."""
        return self.gather("viscous_damping")

    @property
    def D_M(self) -> np.ndarray:
        """Rotor inertias reflected to the joint side, shape (N,)."""
        return self.gather("reflected_inertia")

    @property
    def K_s(self) -> np.ndarray:
        """Joint stiffnesses, shape (N,); infinite when rigid."""
        return self.gather("stiffness")

    @property
    def springs(self) -> ca.SX:
        """Stiffnesses of the elastic joints and zeros of the rigid ones, shape (N, 1)."""
        return ca.SX(np.where(self.elastic_joints, self.K_s, 0.0))

    @property
    def K_d(self) -> np.ndarray:
        """Joint dampings, shape (N,)."""
        return self.gather("damping")

    @property
    def names(self) -> Sequence[str]:
        """Names of the joints."""
        return self.gather("name").tolist()

    def gather(self, attribute: str) -> np.ndarray:
        """Return ``effort_limit``, ``velocity_limit`` (N,), ``position_limits`` (N, 2), ..."""

    def tool_pose(self, q: Sequence[Jet]) -> tuple[Jet, Jet]:
        """Return tool point [m] and orientation, jets of the order of ``q``."""

    def inverse_dynamics(self, q: Sequence[Jet]) -> list[Jet]:
        """Return the link-side torques ``D_E q'' + n_E`` (2.65a), N jets of order r - 2."""

    def mass_matrix(self, q: ca.SX) -> ca.SX:
        """Return ``D_E(q)`` without rotors, shape (N, N)."""


def largest_speeds(robot: RobotModel) -> np.ndarray:
    """Return the largest speeds of joints [rad/s or m/s], infinite without a limit.

    Args:
        robot: The robot, N joints.

    Returns:
        Shape (N,).
    """
    speed = robot.gather("velocity_limit")
    # models without a limit have zero
    return np.where(speed > 0.0, speed, np.inf)


def gravity_torque(robot: RobotModel, q: ca.SX) -> ca.SX:
    """Return the torques that balance gravity, ``g_L(q)`` of (2.65a).

    Args:
        robot: The robot.
        q: Joint coordinates, shape (N, 1).

    Returns:
        Shape (N, 1) [Nm or N].
    """
    at_rest = [jets.constant(q[i], 2) for i in range(robot.dimension)]
    return ca.vertcat(*[tau.coefficients[0] for tau in robot.inverse_dynamics(at_rest)])


def bias_torque(robot: RobotModel, q: ca.SX, v: ca.SX) -> ca.SX:
    """Return the torques at constant velocities, ``n_E(q, v)`` of (2.65a).

    Args:
        robot: The robot.
        q: Joint coordinates, shape (N, 1).
        v: Their rates, shape (N, 1).

    Returns:
        Shape (N, 1) [Nm or N].
    """
    steady = [Jet([q[i], v[i], ca.SX(0)]) for i in range(robot.dimension)]
    return ca.vertcat(*[tau.coefficients[0] for tau in robot.inverse_dynamics(steady)])


@once_per_content()
def link_acceleration(robot: RobotModel) -> ca.Function:
    """Return the acceleration of elastic joints' links, (2.65a), each argument (N,).

    ``(q, v, tau_J) -> D_E^-1 (tau_J - n_E)``. The torque of rigid joints is not measured by a
    spring; their acceleration is assumed to be zero.
    """
    n, elastic = robot.dimension, robot.elastic_joints
    q, v, tau = (ca.SX.sym(name, n) for name in ("q", "v", "tau"))
    chosen = ca.diag(ca.DM(elastic.astype(float)))
    D = chosen @ robot.mass_matrix(q) @ chosen + (ca.DM.eye(n) - chosen)
    load = chosen @ (tau - bias_torque(robot, q, v))
    a = ca.ldl_solve(load, *ca.ldl(ca.densify(D)))
    return ca.Function("a", [q, v, tau], ca.cse([a]), ["q", "v", "tau"], ["a"], MAY_BE_PARAMETRIC)


@once_per_content()
def gravity_function(robot: RobotModel) -> ca.Function:
    """Return :func:`gravity_torque` as a function of numbers, (N,) to (N,)."""
    q = ca.SX.sym("q", robot.dimension)
    return ca.Function("gravity", [q], [ca.densify(gravity_torque(robot, q))], ["q"], ["tau"])


@once_per_content()
def mass_function(robot: RobotModel) -> ca.Function:
    """Return ``D_E(q)`` without rotors as a function of numbers, (N,) to (N, N)."""
    q = ca.SX.sym("q", robot.dimension)
    return ca.Function("D_E", [q], [robot.mass_matrix(q)], ["q"], ["D_E"])


@once_per_content()
def pose_function(robot: RobotModel) -> ca.Function:
    """Return the direct kinematics ``q -> [y_t, R_e by rows]``, shapes (N,) and (12,)."""
    q = ca.SX.sym("q", robot.dimension)
    still = [jets.constant(q[i], 1) for i in range(robot.dimension)]
    y, R = (jet.coefficients[0] for jet in robot.tool_pose(still))
    return ca.Function("tool_pose", [q], [ca.densify(ca.vertcat(y, ca.vec(R.T)))], ["q"], ["pose"])


@once_per_content()
def tool_motion_function(robot: RobotModel) -> ca.Function:
    """Return direct kinematics (2.5) and its rates (2.11), shapes (N,), (N,) and (18,).

    ``(q, v) -> [y_t, R_e by rows, y_t', w]``: tool point [m], orientation, velocity of the tool
    point [m/s] and angular velocity [rad/s], world axes.
    """
    q, v = ca.SX.sym("q", robot.dimension), ca.SX.sym("v", robot.dimension)
    y, R = robot.tool_pose([Jet([q[i], v[i]]) for i in range(robot.dimension)])
    (position, velocity), (orientation, rate) = y.coefficients[:2], R.coefficients[:2]
    w = ca.inv_skew(rate @ orientation.T)
    motion = ca.densify(ca.vertcat(position, ca.vec(orientation.T), velocity, w))
    return ca.Function("tool_motion", [q, v], ca.cse([motion]), ["q", "v"], ["motion"])


def joint_resonances(robot: RobotModel, q_J: np.ndarray) -> np.ndarray:
    """Return the undamped resonances of motors against links, see (3.69).

    Their squares are the eigenvalues of ``K_s (D_E^-1(q_J) + D_M^-1)`` over the elastic joints;
    the motors of rigid ones move with the links.

    Args:
        robot: A robot with elastic joints.
        q_J: Joint coordinates, shape (N,).

    Returns:
        Angular frequencies in increasing order [rad/s], one for each elastic joint.
    """
    elastic = robot.elastic_joints
    D_E = np.array(mass_function(robot)(q_J)) + np.diag(np.where(elastic, 0.0, robot.D_M))
    compliance = np.linalg.inv(D_E)[np.ix_(elastic, elastic)] + np.diag(1.0 / robot.D_M[elastic])
    # K^1/2 C K^1/2 has the eigenvalues of K C and is symmetric
    root = np.sqrt(robot.K_s[elastic])
    return np.sqrt(np.linalg.eigvalsh(root[:, None] * compliance * root))
