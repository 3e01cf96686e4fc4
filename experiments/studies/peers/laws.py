"""Laws that a user would take instead: Cartesian impedance, and joint servos on a plan.

Both see ``q`` and ``v`` once per tick and put out torques of drives; the one moves a target with
time along the path, the other joints along a trajectory that was planned beforehand.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.geometry import Curve, Path
from pfsc_drake.robot.robot_model import (
    RobotModel,
    bias_torque,
    gravity_function,
    mass_function,
    tool_motion_function,
)

# ``(tick, q, v) -> tau``, the latter three of shape (N,)
Law = Callable[[int, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class MovingPose:
    """A tool pose that moves with time, tick by tick.

    Attributes:
        position: [m], shape (T, 3).
        orientation: Rotation matrices, shape (T, 3, 3).
        twist: Velocity [m/s] and angular velocity [rad/s], world axes, shape (T, 6).
    """

    position: np.ndarray
    orientation: np.ndarray
    twist: np.ndarray


def moving_pose(path: Path, motion: Curve, ticks: int, period: float) -> MovingPose:
    """Return where a motion along a path is at the ticks; after its end it rests.

    Args:
        path: The path, with orientation.
        motion: Arc length over time [m, s].
        ticks: Number of ticks T.
        period: Time between them [s].
    """
    # one tick more on both sides, for differences in the middle
    times = np.clip(np.arange(-1, ticks + 1) * period, *motion.domain)
    poses = [path.pose(eta) for eta in motion.derivatives(times, 0)[:, 0, 0].tolist()]
    position = np.array([p for p, _ in poses])
    orientation = np.array([R for _, R in poses])
    velocity = (position[2:] - position[:-2]) / (2.0 * period)
    turn = Rotation.from_matrix(orientation[2:] @ orientation[:-2].transpose(0, 2, 1))
    twist = np.hstack([velocity, turn.as_rotvec() / (2.0 * period)])
    return MovingPose(position[1:-1], orientation[1:-1], twist)


@dataclass(frozen=True)
class ImpedanceGains:
    """Gains of a Cartesian impedance.

    Attributes:
        translation: K of positions [N/m].
        rotation: K of orientations [Nm/rad].
        posture: K of the joints in the null space [Nm/rad].
        largest_error: At which the error is clipped, position [m] and orientation [rad].
        matched: Whether the damping suits the inertia that the tool has at the start, and acts on
            the velocity relative to the target's; else it is ``2 sqrt(K)`` in SI units, whatever
            the inertia, and acts on the tool's own velocity.
    """

    translation: float
    rotation: float
    posture: float
    largest_error: tuple[float, float] = (0.1, 0.5)
    matched: bool = False


class CartesianImpedance:
    """Pulls the tool to a moving pose by springs and dampers.

    ::

        tau = J' (-K e - D (V - V_d)) + n_E(q, v) + N (k (q_0 - q) - 2 sqrt(k) v)

    with ``e = [p - p_d, log(R R_d')]`` in world axes, J the geometric Jacobian, ``n_E`` the
    Coriolis and gravity torques as they are believed, ``N = 1 - J' (J')^+`` and ``V_d = 0`` unless
    the damping is matched. At rest a force F moves the tool by ``F / K``.

    Args:
        robot: The robot as it is believed, N joints.
        gains: The gains.
        target: Where the tool is to be.
        q_0: Posture at the start, shape (N,).
    """

    def __init__(
        self, robot: RobotModel, gains: ImpedanceGains, target: MovingPose, q_0: np.ndarray
    ) -> None:
        self._gains, self._target, self._q_0 = gains, target, q_0
        self._terms = _tool_terms(robot)
        self._K = np.repeat([gains.translation, gains.rotation], 3)
        self._D = 2.0 * np.sqrt(self._K)
        if gains.matched:
            D_E = np.array(mass_function(robot)(q_0)) + np.diag(robot.D_M)
            J = self._terms(q_0, np.zeros_like(q_0))[1].full()
            self._D *= np.sqrt(np.diag(np.linalg.inv(J @ np.linalg.solve(D_E, J.T))))

    def __call__(self, tick: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the torques of the drives [Nm], shape (N,).

        Args:
            tick: Number of the tick.
            q: Joint coordinates [rad], shape (N,).
            v: Their rates [rad/s], shape (N,).
        """
        gains, target = self._gains, self._target
        pose, J, bias = (x.full() for x in self._terms(q, v))
        R, R_d = pose[3:].reshape(3, 3), target.orientation[tick]
        error = np.concatenate(
            [
                _clipped(pose[:3, 0] - target.position[tick], gains.largest_error[0]),
                _clipped(Rotation.from_matrix(R @ R_d.T).as_rotvec(), gains.largest_error[1]),
            ]
        )
        V = J @ v - (target.twist[tick] if gains.matched else 0.0)
        pull = gains.posture * (self._q_0 - q) - 2.0 * np.sqrt(gains.posture) * v
        free = pull - J.T @ np.linalg.lstsq(J.T, pull, rcond=None)[0]
        return J.T @ (-self._K * error - self._D * V) + bias[:, 0] + free


class JointServos:
    """Lets every joint follow its own part of a plan, as position controlled robots do.

    ::

        tau_i = D_i (a_0 int e_i dt + a_1 e_i + a_2 e_i') + g_i(q),    e = q_d - q

    with ``D_i`` the inertia that joint i has at the start, its rotor included, ``g`` the weight as
    it is believed, and the coefficients of ``(s + w)^2 (s + p)``, of which p = 0 leaves a PD. The
    integral is summed up tick by tick.

    Args:
        robot: The robot as it is believed, N joints.
        bandwidth: w, two poles of every joint by itself [1/s].
        plan: Joint coordinates and rates at the ticks, shape (T, 2, N).
        q_0: Posture at the start, shape (N,).
        period: Sampling time [s].
        integral: p, the third pole [1/s]; 0 for none.
    """

    def __init__(
        self,
        robot: RobotModel,
        bandwidth: float,
        plan: np.ndarray,
        q_0: np.ndarray,
        period: float,
        integral: float = 0.0,
    ) -> None:
        self._plan, self._gravity, self._period = plan, gravity_function(robot), period
        self._D = np.diag(np.array(mass_function(robot)(q_0))) + robot.D_M
        _, self._a_2, self._a_1, self._a_0 = np.poly([-bandwidth, -bandwidth, -integral])
        self._sum = np.zeros(robot.dimension)

    def __call__(self, tick: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the torques of the drives [Nm], shape (N,).

        Args:
            tick: Number of the tick.
            q: Joint coordinates [rad], shape (N,).
            v: Their rates [rad/s], shape (N,).
        """
        q_d, v_d = self._plan[tick]
        self._sum += (q_d - q) * self._period
        weight: np.ndarray = self._gravity(q).full()[:, 0]
        wanted = self._a_0 * self._sum + self._a_1 * (q_d - q) + self._a_2 * (v_d - v)
        return self._D * wanted + weight


def _clipped(error: np.ndarray, most: float) -> np.ndarray:
    return np.clip(error, -most, most)


def _tool_terms(robot: RobotModel) -> ca.Function:
    """Return ``(q, v) -> [y_t, R_e by rows], J, n_E``, shapes (12,), (6, N) and (N,)."""
    q, v = ca.SX.sym("q", robot.dimension), ca.SX.sym("v", robot.dimension)
    motion = tool_motion_function(robot)(q, v)
    terms: Sequence[ca.SX] = [
        motion[:12],
        ca.jacobian(motion[12:], v),
        ca.densify(bias_torque(robot, q, v)),
    ]
    return ca.Function("tool_terms", [q, v], ca.cse(terms))
