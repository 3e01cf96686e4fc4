"""Drive demand of a joint trajectory, and the speed scaling at which the drives can follow it."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.control.law.laws import LAWS
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

# at constant speed everything is a polynomial of the speed of this degree
_DEGREE = 4


@dataclass(frozen=True)
class DriveLimits:
    """Limits of the drives.

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
        """Both limits, shape (2N,)."""
        return np.concatenate([self.effort, self.speed])


class DriveDemand:
    """Drive torques and joint speeds that a joint trajectory needs.

    With ``tau_J`` the inverse dynamics of the links, ``D_M`` the rotor inertias and ``d_v`` the
    viscous damping of the drives::

        rigid, velocity_servo:   tau_d = tau_J + D_M q'' + d_v q'
        singular_perturbation:   the same, minus epsilon D_b tau_J' of the elastic joints
        visco_elastic, elastic:  tau_d = tau_J + D_M q_M'' + d_v q_M',  q_M = q + K_s^-1 tau_J

    The small effect of the joints' damping on ``q_M`` is neglected.

    Args:
        robot: Nominal robot model, N joints.
        law: The control law; it determines which elastic effects the drives compensate.
        viscous: Viscous damping in addition to the robot model's, shape (N,).
        boundary_layer_damping: Diagonal of ``epsilon D_b`` [s], shape (N,), of the law
            ``singular_perturbation``.

    Attributes:
        derivatives: Highest derivative of the joint coordinates that the demand depends on.
    """

    def __init__(
        self,
        robot: RobotModel,
        law: str,
        viscous: np.ndarray | None = None,
        boundary_layer_damping: np.ndarray | None = None,
    ) -> None:
        self.derivatives = LAWS[law].demand_order
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

    def at_constant_rate(self, trajectory: np.ndarray) -> np.ndarray:
        """Return the demand as polynomials of a constant speed scaling ``c``.

        Args:
            trajectory: Motion as for :meth:`of`, at scaling 1.

        Returns:
            Coefficients of ``c^0 .. c^4``, shape (samples, 5, 2N).
        """
        scalings = np.linspace(0.0, 1.0, _DEGREE + 1)
        powers = scalings[:, None] ** np.arange(self.derivatives + 1)
        values = np.array([self.of(trajectory * power[:, None]) for power in powers])
        through = np.linalg.inv(np.vander(scalings, increasing=True))
        return np.einsum("kp,psn->skn", through, values)


@once_per_content()
def _demand_function(
    robot: RobotModel,
    law: str,
    viscous: np.ndarray | None,
    boundary_layer_damping: np.ndarray | None,
) -> ca.Function:
    """Return ``motion -> demand``, see :class:`DriveDemand`, shapes ((K + 1) N,) and (2N,)."""
    record, n = LAWS[law], robot.dimension
    derivatives = record.demand_order
    motion = ca.SX.sym("motion", (derivatives + 1) * n)
    q = ca.vertsplit(motion, n)
    jets = robot.inverse_dynamics(joint_jets(q))
    tau_J = [ca.vertcat(*[tau.derivative(k) for tau in jets]) for k in range(derivatives - 1)]
    velocity, acceleration, fast = q[1], q[2], ca.SX(n, 1)
    if record.inverts_springs:
        K_s = ca.DM(robot.K_s)
        velocity, acceleration = velocity + tau_J[1] / K_s, acceleration + tau_J[2] / K_s
    elif record.damps_springs:
        assert boundary_layer_damping is not None  # the law rejects None
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


def apply_scaling(trajectory: np.ndarray, scaling: np.ndarray) -> np.ndarray:
    """Return the time derivatives of ``Q(tau(t))`` by the chain rule.

    Args:
        trajectory: ``Q`` and its derivatives, shape (samples, K + 1, N) with K up to 4.
        scaling: ``tau', tau'', ..``, K of them, shape (samples, K) or more columns.
    """
    motion = trajectory.copy()
    highest = trajectory.shape[1] - 1
    c, a, j, s = (scaling[:, k, None] if k < scaling.shape[1] else 0.0 for k in range(4))
    Q = [trajectory[:, k] for k in range(highest + 1)]
    motion[:, 1] = Q[1] * c
    if highest > 1:
        motion[:, 2] = Q[2] * c**2 + Q[1] * a
    if highest > 2:
        motion[:, 3] = Q[3] * c**3 + 3.0 * Q[2] * c * a + Q[1] * j
    if highest > 3:
        curved = Q[2] * (3.0 * a**2 + 4.0 * c * j)
        motion[:, 4] = Q[4] * c**4 + 6.0 * Q[3] * c**2 * a + curved + Q[1] * s
    return motion


# candidate scalings; below the slowest one a motion counts as standing still
_LADDER = np.linspace(1.0, 0.01, 100)
# Newton steps to the requested time, from a linear guess
_NEWTON = 4
# box filters that make the scaling C^4
_BOXES = 5
# largest number of corrections, and safety factor of each
_CORRECTIONS, _FURTHER = 30, 0.97
# share of the allowed demand that the constant scaling leaves to changes of the scaling
_FOR_CHANGES = 0.1
# usable share of the torque that gravity leaves
_BESIDE_WEIGHT = 0.5


@dataclass(frozen=True)
class SpeedScaling:
    """Speed of a motion relative to the requested one, on a grid of the requested time ``tau``.

    Attributes:
        rates: ``c = dtau/dt`` and its time derivatives, shape (samples, 4) [1, 1/s, ..].
        share: Largest demand relative to its limit, shape (samples,).
        tightest: Column of the demand that limits the scaling, shape (samples,).
    """

    rates: np.ndarray
    share: np.ndarray
    tightest: np.ndarray


def allowed_demand(
    at_rest: np.ndarray, limits: np.ndarray, reserve: np.ndarray | float
) -> np.ndarray:
    """Return the allowed drive demand, shape (samples, 2N).

    It is ``1 - reserve`` of the limits. Where gravity alone takes about that much, it is gravity
    plus half of ``1 - reserve`` of the remaining torque.

    Args:
        at_rest: Demand at rest, shape (samples, 2N).
        limits: Limits of the drives, shape (2N,).
        reserve: Share of the limits that is not used, shape (2N,) or one for all.
    """
    weight = np.minimum(np.abs(at_rest), limits)
    usable = (1.0 - reserve) * limits
    beside = np.where(weight < limits, limits - weight, 0.0)
    return np.maximum(usable, weight + _BESIDE_WEIGHT * (1.0 - reserve) * beside)


def find_scaling(
    demand: DriveDemand,
    trajectory: np.ndarray,
    step: float,
    allowed: np.ndarray,
    change: float,
    smoothing: float,
) -> SpeedScaling:
    """Return a speed scaling at which the drive demand is within the allowed one.

    1. The largest constant scaling ``c(tau) <= 1`` from the polynomials of the demand.
    2. Its minimum over the window of the smoothing, and forward and backward passes that bound its
       change.
    3. Box filters, whose result is C^4 over ``tau``, and so over time.
    4. The demand of the resulting motion, with all derivatives of the scaling. Where it is too
       large, the constant scaling and the bound on its change are lowered; repeat from 2.

    Args:
        demand: Drive demand of a motion.
        trajectory: Joint coordinates and derivatives with respect to ``tau``, shape
            (samples, K + 1, N).
        step: Step of the grid [s].
        allowed: Allowed demand, shape (samples, 2N).
        change: Largest rate of change of the scaling, ``dc/dt`` [1/s].
        smoothing: Total width of the filters [s].

    Raises:
        InputError: If no scaling is slow enough.
    """
    polynomials = demand.at_constant_rate(trajectory)
    # gravity does not depend on the scaling; at most half of the rest is reserved for changes
    weight = np.abs(polynomials[:, 0])
    even_allowed = np.maximum((1.0 - _FOR_CHANGES) * allowed, 0.5 * (weight + allowed))
    even, tightest = _even_scaling(polynomials, even_allowed)
    bound = np.full(len(trajectory), change)
    half = max(1, round(smoothing / (2.0 * _BOXES * step)))
    reach = 2 * _BOXES * half + 1
    for _ in range(_CORRECTIONS):
        rates = _smooth(even, bound, step, half)
        ratio = np.abs(demand.of(apply_scaling(trajectory, rates))) / allowed
        worst = ratio.argmax(axis=1)
        share = np.take_along_axis(ratio, worst[:, None], axis=1)[:, 0]
        if share.max() <= 1.0:
            return SpeedScaling(rates, share, np.where(even < 1.0, tightest, worst))
        # demand without and with a change of the scaling
        alone = _evaluate(polynomials, rates[:, 0])
        constant = np.take_along_axis(np.abs(alone) / allowed, worst[:, None], axis=1)[:, 0]
        over = share > 1.0
        margin = np.maximum(1.0 - constant, 0.0) / np.maximum(share - constant, 1e-12)
        slower = np.where(over, np.clip(_FURTHER * margin, 0.5, 1.0), 1.0)
        bound = bound * minimum_filter1d(slower, reach)
        lower = np.where(over, _FURTHER * np.clip(share, 1.0, 2.0) ** -0.25, 1.0)
        even = np.minimum(even, np.where(over, rates[:, 0] * lower, np.inf))
        even = np.maximum(even, _LADDER[-1])
    raise InputError(f"no speed scaling found; the demand is {share.max():.3g} of the allowed one")


def _evaluate(polynomials: np.ndarray, scaling: np.ndarray) -> np.ndarray:
    """Return polynomials (samples, k, 2N) at one scaling each (samples,), or at one for all."""
    value = polynomials[:, -1]
    for k in range(polynomials.shape[1] - 2, -1, -1):
        value = value * np.reshape(scaling, (-1, 1)) + polynomials[:, k]
    return value


def _even_scaling(polynomials: np.ndarray, allowed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest constant scaling within the allowed demand, and the limiting column."""
    scaling = np.full(len(polynomials), _LADDER[-1])
    tightest = np.zeros(len(polynomials), dtype=int)
    left = np.arange(len(polynomials))
    # from slow to fast; a sample that has exceeded the allowed demand once is done
    for candidate in _LADDER[::-1]:
        ratio = np.abs(_evaluate(polynomials[left], candidate)) / allowed[left]
        tightest[left] = ratio.argmax(axis=1)
        fits = ratio.max(axis=1) <= 1.0
        left = left[fits]
        scaling[left] = candidate
    return scaling, tightest


def _smooth(even: np.ndarray, bound: np.ndarray, step: float, half: int) -> np.ndarray:
    """Return a smooth scaling below another one, and its time derivatives, (samples, 4)."""
    square = minimum_filter1d(even, 2 * _BOXES * half + 1) ** 2
    # d(c^2)/dtau = 2 dc/dt
    rise = (2.0 * step * bound).tolist()
    values = square.tolist()
    for i in range(1, len(values)):
        values[i] = min(values[i], values[i - 1] + rise[i])
    for i in range(len(values) - 2, -1, -1):
        values[i] = min(values[i], values[i + 1] + rise[i])
    scaling = np.sqrt(values)
    for _ in range(_BOXES):
        scaling = uniform_filter1d(scaling, 2 * half + 1, mode="nearest")
    rates = [np.minimum(scaling, 1.0)]
    for _ in range(3):
        rates.append(scaling * np.gradient(rates[-1], step))
    return np.array(rates).T


class Clock:
    """Map between the time ``t`` of a scaled motion and the requested time ``tau``.

    Args:
        scaling: ``dtau/dt`` on an even grid of ``tau`` from 0 on, shape (samples,).
        step: Step of the grid [s].
    """

    def __init__(self, scaling: np.ndarray, step: float) -> None:
        grid = step * np.arange(len(scaling))
        # a rule that differs at odd and even samples would excite high derivatives
        self._slowness = make_interp_spline(grid, 1.0 / scaling, k=5)
        self._time = self._slowness.antiderivative()
        self._grid, self.times = grid, self._time(grid)

    @property
    def end(self) -> float:
        """``t`` at the end [s]."""
        return float(self.times[-1])

    def tau(self, times: np.ndarray) -> np.ndarray:
        """Return ``tau(t)`` [s], of the shape of the times."""
        tau = np.interp(times, self.times, self._grid)
        for _ in range(_NEWTON):
            tau -= (self._time(tau) - times) / self._slowness(tau)
        return np.clip(tau, 0.0, self._grid[-1])
