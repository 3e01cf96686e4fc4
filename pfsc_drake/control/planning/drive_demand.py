"""What a motion of the joints asks of the drives, and the pace at which they can follow it."""

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


# paces that are tried; slower than the slowest, a motion stands
_LADDER = np.linspace(1.0, 0.01, 100)
# steps to the time asked for, from a linear guess
_NEWTON = 4
# box filters that make the pace C^4
_BOXES = 5
# how often the pace is corrected, and by how much more than the demand tells
_CORRECTIONS, _FURTHER = 30, 0.97
# of what is allowed, left to the change of pace at the pace that is the largest if it is even
_FOR_CHANGES = 0.1
# of what may be used of what drives have left beside the weight that they hold
_BESIDE_WEIGHT = 0.5


@dataclass(frozen=True)
class Pace:
    """How fast a motion is gone through, on a grid of the time ``tau`` that was asked for.

    Attributes:
        rates: ``c = dtau/dt`` and its time derivatives, shape (samples, 4) [1, 1/s, ..].
        share: Largest share of its limit that a drive is asked for, shape (samples,).
        tightest: Column of the demand that decides over the pace, shape (samples,).
    """

    rates: np.ndarray
    share: np.ndarray
    tightest: np.ndarray


def allowed_demand(
    at_rest: np.ndarray, limits: np.ndarray, reserve: np.ndarray | float
) -> np.ndarray:
    """Return what may be asked of the drives, shape (samples, 2N).

    That is ``1 - reserve`` of the limits; where the weight of the links alone takes about that
    much, half of that share of what it leaves is allowed beside it.

    Args:
        at_rest: Demand at rest, shape (samples, 2N).
        limits: What drives can do, shape (2N,).
        reserve: Share of the limits that is left, shape (2N,) or one for all.
    """
    weight = np.minimum(np.abs(at_rest), limits)
    usable = (1.0 - reserve) * limits
    beside = np.where(weight < limits, limits - weight, 0.0)
    return np.maximum(usable, weight + _BESIDE_WEIGHT * (1.0 - reserve) * beside)


def find_pace(
    demand: DriveDemand,
    course: np.ndarray,
    step: float,
    allowed: np.ndarray,
    change: float,
    smoothing: float,
) -> Pace:
    """Return the pace at which the drives are asked for no more than is allowed.

    1. The largest even pace ``c(tau) <= 1`` from the polynomials of the demand.
    2. Its minimum over the way that the smoothing spans, and forward and backward passes that
       bound its change.
    3. Box filters, whose result is C^4 over ``tau``, and so over time.
    4. The demand of this very motion, its changes of pace with all their derivatives included.
       Where it is too large, the even pace is lowered, and what bounds its change; again from 2.

    Args:
        demand: Tells what a motion asks of the drives.
        course: Joint coordinates and derivatives by ``tau``, shape (samples, K + 1, N).
        step: Step of the grid [s].
        allowed: What may be asked, shape (samples, 2N).
        change: Largest change of pace ``dc/dt`` [1/s].
        smoothing: Width of the filters together [s].

    Raises:
        InputError: If no pace is slow enough.
    """
    polynomials = demand.at_constant_rate(course)
    # no pace changes the weight: of what it leaves, at most half is kept for changes
    weight = np.abs(polynomials[:, 0])
    even_allowed = np.maximum((1.0 - _FOR_CHANGES) * allowed, 0.5 * (weight + allowed))
    even, tightest = _even_pace(polynomials, even_allowed)
    bound = np.full(len(course), change)
    half = max(1, round(smoothing / (2.0 * _BOXES * step)))
    reach = 2 * _BOXES * half + 1
    for _ in range(_CORRECTIONS):
        rates = _smoothed(even, bound, step, half)
        ratio = np.abs(demand.of(with_pace(course, rates))) / allowed
        worst = ratio.argmax(axis=1)
        share = np.take_along_axis(ratio, worst[:, None], axis=1)[:, 0]
        if share.max() <= 1.0:
            return Pace(rates, share, np.where(even < 1.0, tightest, worst))
        # what would be asked without a change of pace, and with it
        alone = _evaluated(polynomials, rates[:, 0])
        constant = np.take_along_axis(np.abs(alone) / allowed, worst[:, None], axis=1)[:, 0]
        over = share > 1.0
        room = np.maximum(1.0 - constant, 0.0) / np.maximum(share - constant, 1e-12)
        slower = np.where(over, np.clip(_FURTHER * room, 0.5, 1.0), 1.0)
        bound = bound * minimum_filter1d(slower, reach)
        lower = np.where(over, _FURTHER * np.clip(share, 1.0, 2.0) ** -0.25, 1.0)
        even = np.minimum(even, np.where(over, rates[:, 0] * lower, np.inf))
        even = np.maximum(even, _LADDER[-1])
    raise InputError(f"no pace found; the drives are asked for {share.max():.3g} of what they may")


def _evaluated(polynomials: np.ndarray, pace: np.ndarray) -> np.ndarray:
    """Return polynomials (samples, k, 2N) of a pace each (samples,), or one of all."""
    value = polynomials[:, -1]
    for k in range(polynomials.shape[1] - 2, -1, -1):
        value = value * np.reshape(pace, (-1, 1)) + polynomials[:, k]
    return value


def _even_pace(polynomials: np.ndarray, allowed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest pace below which everything is allowed, and what forbids more."""
    pace = np.full(len(polynomials), _LADDER[-1])
    tightest = np.zeros(len(polynomials), dtype=int)
    left = np.arange(len(polynomials))
    # from slow to fast; a sample that has asked too much once is done
    for candidate in _LADDER[::-1]:
        ratio = np.abs(_evaluated(polynomials[left], candidate)) / allowed[left]
        tightest[left] = ratio.argmax(axis=1)
        fits = ratio.max(axis=1) <= 1.0
        left = left[fits]
        pace[left] = candidate
    return pace, tightest


def _smoothed(even: np.ndarray, bound: np.ndarray, step: float, half: int) -> np.ndarray:
    """Return a pace below another, and its time derivatives, shape (samples, 4)."""
    square = minimum_filter1d(even, 2 * _BOXES * half + 1) ** 2
    # d(c^2)/dtau = 2 dc/dt
    rise = (2.0 * step * bound).tolist()
    values = square.tolist()
    for i in range(1, len(values)):
        values[i] = min(values[i], values[i - 1] + rise[i])
    for i in range(len(values) - 2, -1, -1):
        values[i] = min(values[i], values[i + 1] + rise[i])
    pace = np.sqrt(values)
    for _ in range(_BOXES):
        pace = uniform_filter1d(pace, 2 * half + 1, mode="nearest")
    rates = [np.minimum(pace, 1.0)]
    for _ in range(3):
        rates.append(pace * np.gradient(rates[-1], step))
    return np.array(rates).T


class Clock:
    """The time ``t`` at which a time ``tau`` comes at a pace, and back.

    Args:
        pace: ``dtau/dt`` on an even grid of ``tau`` from 0 on, shape (samples,).
        step: Step of the grid [s].
    """

    def __init__(self, pace: np.ndarray, step: float) -> None:
        grid = step * np.arange(len(pace))
        # a rule that is not the same at odd and even samples would sound in high derivatives
        self._slowness = make_interp_spline(grid, 1.0 / pace, k=5)
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
