"""What a motion of the joints asks of the drives."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

# highest derivative of the joint coordinates that decides over the drives' torques, by law
_DERIVATIVES = {
    "velocity_servo": 2,
    "rigid": 2,
    "singular_perturbation": 3,
    "visco_elastic": 4,
    "elastic": 4,
}
# at constant speed everything is a polynomial of the speed of this degree
_DEGREE = 4


@dataclass(frozen=True)
class DriveLimits:
    """What drives can do.

    Attributes:
        effort: Largest torques [Nm or N], shape (N,).
        speed: Largest joint velocities [rad/s or m/s], shape (N,).
    """

    effort: np.ndarray
    speed: np.ndarray

    def __post_init__(self) -> None:
        for name in ("effort", "speed"):
            values = getattr(self, name)
            if not np.all(values > 0.0):
                raise InputError(f"limits of {name}: {values}; must be positive numbers")

    @property
    def together(self) -> np.ndarray:
        """Both, shape (2N,)."""
        return np.concatenate([self.effort, self.speed])


class DriveDemand:
    """Torques and speeds that a motion of the joints asks for.

    With ``tau_J`` the link side's inverse dynamics, ``D_M`` the rotors and ``d_v`` the viscous
    damping of the drives::

        rigid, velocity_servo:   tau_d = tau_J + D_M q'' + d_v q'
        singular_perturbation:   the same, and -epsilon D_b tau_J' of the joints that are elastic
        visco_elastic, elastic:  tau_d = tau_J + D_M q_M'' + d_v q_M',  q_M = q + K_s^-1 tau_J

    The joints' damping bends ``q_M`` a little less than that; it is left out.

    Args:
        robot: The robot as it is believed, N joints.
        law: The law, which decides what of the joints' elasticity the drives have to follow.
        viscous: What the drives overcome besides the robot's own damping, shape (N,).
        boundary_layer_damping: Diagonal of ``epsilon D_b`` [s], shape (N,), of the law
            ``singular_perturbation``.

    Attributes:
        derivatives: Up to which derivative of the joint coordinates it depends on the motion.
    """

    def __init__(
        self,
        robot: RobotModel,
        law: str,
        viscous: np.ndarray | None = None,
        boundary_layer_damping: np.ndarray | None = None,
    ) -> None:
        self.derivatives = _DERIVATIVES[law]
        self._function = BoundFunction(
            _demand_function(robot, law, viscous, boundary_layer_damping)
        )

    def of(self, motion: np.ndarray) -> np.ndarray:
        """Return ``[tau_d, q']`` of every sample, shape (samples, 2N).

        Args:
            motion: Joint coordinates and their time derivatives, shape (samples, derivatives + 1,
                N).
        """
        argument, evaluate = self._function.arguments["motion"], self._function.evaluate
        demand = self._function.results["demand"]
        found = np.empty((len(motion), len(demand)))
        for i, sample in enumerate(motion.reshape(len(motion), -1)):
            argument[:] = sample
            evaluate()
            found[i] = demand
        return found

    def at_constant_rate(self, course: np.ndarray) -> np.ndarray:
        """Return the polynomials of the pace ``c`` at which a motion is gone through evenly.

        Args:
            course: As the motion of :meth:`of`, at the pace 1.

        Returns:
            Coefficients of ``c^0 .. c^4``, shape (samples, 5, 2N).
        """
        paces = np.linspace(0.0, 1.0, _DEGREE + 1)
        powers = paces[:, None] ** np.arange(self.derivatives + 1)
        values = np.array([self.of(course * power[:, None]) for power in powers])
        through = np.linalg.inv(np.vander(paces, increasing=True))
        return np.einsum("kp,psn->skn", through, values)


@once_per_content()
def _demand_function(
    robot: RobotModel,
    law: str,
    viscous: np.ndarray | None,
    boundary_layer_damping: np.ndarray | None,
) -> ca.Function:
    """Return ``motion -> demand``, see :class:`DriveDemand`, shapes ((K + 1) N,) and (2N,)."""
    derivatives, n = _DERIVATIVES[law], robot.dimension
    motion = ca.SX.sym("motion", (derivatives + 1) * n)
    q = ca.vertsplit(motion, n)
    jets = robot.inverse_dynamics(joint_jets(q))
    tau_J = [ca.vertcat(*[tau.derivative(k) for tau in jets]) for k in range(derivatives - 1)]
    velocity, acceleration, fast = q[1], q[2], ca.SX(n, 1)
    if law in ("visco_elastic", "elastic"):
        K_s = ca.DM(robot.K_s)
        velocity, acceleration = velocity + tau_J[1] / K_s, acceleration + tau_J[2] / K_s
    elif law == "singular_perturbation":
        assert boundary_layer_damping is not None  # the law has refused that
        elastic = robot.elastic_joints
        fast = -ca.DM(np.where(elastic, boundary_layer_damping, 0.0)) * tau_J[1]
    damping = robot.viscous_damping + (np.zeros(n) if viscous is None else viscous)
    torque = tau_J[0] + ca.DM(robot.D_M) * acceleration + ca.DM(damping) * velocity + fast
    return ca.Function(
        "drive_demand",
        [motion],
        [ca.densify(e) for e in ca.cse([ca.vertcat(torque, q[1])])],
        ["motion"],
        ["demand"],
    )


def with_pace(course: np.ndarray, pace: np.ndarray) -> np.ndarray:
    """Return the time derivatives of ``Q(tau(t))`` by the chain rule.

    Args:
        course: ``Q`` and its derivatives, shape (samples, K + 1, N) with K up to 4.
        pace: ``tau', tau'', ..``, K of them, shape (samples, K) or more columns.
    """
    motion = course.copy()
    highest = course.shape[1] - 1
    c, a, j, s = (pace[:, k, None] if k < pace.shape[1] else 0.0 for k in range(4))
    Q = [course[:, k] for k in range(highest + 1)]
    motion[:, 1] = Q[1] * c
    if highest > 1:
        motion[:, 2] = Q[2] * c**2 + Q[1] * a
    if highest > 2:
        motion[:, 3] = Q[3] * c**3 + 3.0 * Q[2] * c * a + Q[1] * j
    if highest > 3:
        curved = Q[2] * (3.0 * a**2 + 4.0 * c * j)
        motion[:, 4] = Q[4] * c**4 + 6.0 * Q[3] * c**2 * a + curved + Q[1] * s
    return motion
