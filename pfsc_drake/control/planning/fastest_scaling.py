"""Time-optimal speed scaling of a motion along a joint trajectory."""

from dataclasses import dataclass
from math import prod

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import maximum_filter1d
from scipy.sparse import csc_matrix, diags, identity

from pfsc_drake.control.planning.demand_polynomial import DemandPolynomial
from pfsc_drake.control.planning.scaling_spline import ScalingSpline, knots_of, time_derivatives

# bounds of the scaling where no limit applies
_SLOWEST, _LARGEST = 1e-3, 1e3
# largest ratio of neighbouring coefficients
_STEEPEST = 1.3
# solver: relative accuracy of the duration, and largest number of steps
_ACCURACY, _STEPS = 1e-6, 250
# window of samples around one near a limit, at which the limit is included
_AROUND = 41
# largest number of rounds that add missing limits, and violation from which one is added
_ROUNDS, _PASSED = 6, 1e-4
# highest derivative of the scaling that a demand depends on
_DERIVATIVES = 3
# small initial barrier and bound distance, so that a start near an optimum stays there
_SOLVER = {
    "print_level": 0,
    "sb": "yes",
    "max_iter": _STEPS,
    "tol": _ACCURACY,
    "nlp_scaling_method": "none",
    "mu_init": 1e-2,
    "bound_push": 1e-3,
    "bound_frac": 1e-3,
}


@dataclass(frozen=True)
class ScalingLimits:
    """Bounds of the speed scaling at every sample of a trajectory.

    Attributes:
        torque: Largest torques [Nm or N], shape (samples, N).
        torque_rate: Their largest rates [Nm/s or N/s], of the same shape; infinite for none.
        scaling: Largest scaling, from joint speeds and tool speed, shape (samples,).
    """

    torque: np.ndarray
    torque_rate: np.ndarray
    scaling: np.ndarray


@dataclass(frozen=True)
class FastestScaling:
    """Result of the optimization.

    Attributes:
        scaling: The speed scaling.
        converged: Whether it is a local optimum.
        status: Return status of the solver.
    """

    scaling: ScalingSpline
    converged: bool
    status: str


def find_fastest_scaling(
    demand: DemandPolynomial,
    theta: np.ndarray,
    limits: ScalingLimits,
    intervals: int,
    degree: int,
    watched: float = 0.0,
) -> FastestScaling:
    """Return the speed scaling of least duration that meets all limits.

    A B-spline ``c(theta)`` minimizes ``int 1/c dtheta`` with ``|tau| <= torque``,
    ``c <= scaling`` and ``|dtau/dtheta| c <= torque_rate`` at the samples, by an interior point
    method with exact derivatives. The scaling is constant over the first and the last interval, so
    that the motion between samples near rest is the scaled input motion.

    Args:
        demand: Torque demand at the samples.
        theta: Evenly spaced motion times from 0 on [s], shape (samples,).
        limits: Bounds at the samples.
        intervals: Number of intervals of the spline, more than its degree.
        degree: Degree of the spline, at least 3, and at least the highest derivative of the joint
            coordinates that the demand depends on, so that torques are continuous.
        watched: Share of a limit below which it is left out first, and checked afterwards.
    """
    program = _Program(demand, theta, limits, intervals, degree)
    share = program.shares(ScalingSpline(float(theta[-1]), np.ones(intervals + degree), degree))
    selected = _near(share, watched)
    for _ in range(_ROUNDS):
        found = program.solve(selected)
        share = program.shares(found.scaling)
        if not np.any((share > 1.0 + _PASSED) & ~selected):
            break
        selected |= _near(share, watched)
    return found


def _near(share: np.ndarray, watched: float) -> np.ndarray:
    """Return which limits are to be included, from their shares (samples, limits)."""
    return np.asarray(maximum_filter1d(share, _AROUND, axis=0) >= watched)


class _Program:
    """Optimization problem with a subset of the limits."""

    def __init__(
        self,
        demand: DemandPolynomial,
        theta: np.ndarray,
        limits: ScalingLimits,
        intervals: int,
        degree: int,
    ) -> None:
        self._demand, self._theta, self._limits, self._degree = demand, theta, limits, degree
        self._inner = ca.MX.sym("coefficients", intervals - degree)
        ends = ca.repmat(self._inner[0], degree), ca.repmat(self._inner[-1], degree)
        self._x = ca.vertcat(ends[0], self._inner, ends[1])
        tables = _tables(theta, intervals, degree)
        self._rates = time_derivatives(*[table @ self._x for table in tables])
        # at all samples, without the first monomial, which is 1
        self._monomials = [
            prod(rate**p for rate, p in zip(self._rates, powers, strict=True) if p)
            for powers in demand.exponents[1:]
        ]

    def shares(self, scaling: ScalingSpline) -> np.ndarray:
        """Return shares of the limits of torques and of their rates, shape (samples, 2N)."""
        rates = scaling.rates(self._theta)
        torques = self._demand.torques(rates)
        c = (rates[1:, :1] + rates[:-1, :1]) / 2.0
        slopes = np.diff(torques, axis=0) * c / self._theta[1] / self._limits.torque_rate[1:]
        # the rate over an interval is assigned to its end
        slopes = np.pad(slopes, ((1, 0), (0, 0)))
        return np.abs(np.concatenate([torques / self._limits.torque, slopes], axis=1))

    def solve(self, selected: np.ndarray) -> FastestScaling:
        """Return the fastest scaling subject to the selected limits, (samples, 2N)."""
        x, theta = self._x, self._theta
        rows = ca.vertcat(*self._rows(selected))
        # bounded ratio of neighbours: the scaled motion cannot resolve steeper changes
        steep = ca.vertcat(x[1:] - _STEEPEST * x[:-1], x[:-1] - _STEEPEST * x[1:])
        least = np.repeat([-1.0, -np.inf], [rows.numel(), steep.numel()])
        most = np.repeat([1.0, 0.0], [rows.numel(), steep.numel()])
        weights = np.full(len(theta), theta[1])
        weights[[0, -1]] /= 2.0
        duration = ca.dot(ca.DM(weights), 1.0 / self._rates[0])
        problem = {
            "x": self._inner,
            "f": duration / float(theta[-1]),
            "g": ca.vertcat(rows, steep),
        }
        options = {f"ipopt.{key}": value for key, value in _SOLVER.items()}
        solver = ca.nlpsol("fastest", "ipopt", problem, {**options, "print_time": False})
        found = solver(x0=1.0, lbg=least, ubg=most, lbx=_SLOWEST)
        coefficients = np.pad(np.array(found["x"])[:, 0], self._degree, mode="edge")
        scaling = ScalingSpline(float(theta[-1]), coefficients, self._degree)
        stats = solver.stats()
        return FastestScaling(scaling, bool(stats["success"]), str(stats["return_status"]))

    def _rows(self, selected: np.ndarray) -> list[ca.MX]:
        """Return the constraint expressions, which must be between -1 and 1."""
        limits, c, n = self._limits, self._rates[0], selected.shape[1] // 2
        rows = [c / ca.DM(np.minimum(limits.scaling, _LARGEST))]
        at, axis = np.nonzero(selected[:, :n])
        rows.append(self._torques(at, axis, 1.0 / limits.torque[at, axis]))
        at, axis = np.nonzero(selected[1:, n:] & np.isfinite(limits.torque_rate[1:]))
        scale = 1.0 / (2.0 * self._theta[1] * limits.torque_rate[at + 1, axis])
        slopes = self._torques(at + 1, axis, scale) - self._torques(at, axis, scale)
        rows.append(slopes * (c[at + 1] + c[at]))
        return rows

    def _torques(self, at: np.ndarray, axis: np.ndarray, scale: np.ndarray) -> ca.MX:
        """Return scaled torques of some axes at some samples, shape (rows, 1)."""
        table = self._demand.coefficients[at, :, axis] * scale[:, None]
        samples, rows = len(self._theta), np.arange(len(at))
        count = len(self._monomials)
        columns = at[:, None] + samples * np.arange(count)
        indices = np.repeat(rows, count), columns.ravel()
        map_of = csc_matrix((table[:, 1:].ravel(), indices), shape=(len(at), samples * count))
        return ca.DM(table[:, 0]) + ca.DM(map_of) @ ca.vertcat(*self._monomials)


def _tables(theta: np.ndarray, intervals: int, degree: int) -> list[ca.DM]:
    """Return the maps from coefficients to derivatives 0..3 by theta at the samples."""
    knots = knots_of(float(theta[-1]), intervals, degree)
    to_derivative, tables = identity(len(knots) - degree - 1, format="csr"), []
    for k in range(_DERIVATIVES + 1):
        bases = BSpline.design_matrix(theta, knots, degree - k)
        tables.append(ca.DM(csc_matrix(bases @ to_derivative)))
        if k < _DERIVATIVES:
            p = degree - k
            apart = (knots[p + 1 : -1] - knots[1 : -p - 1]) / p
            differences = diags([-1.0, 1.0], [0, 1], shape=(len(apart), len(apart) + 1))
            to_derivative, knots = diags(1.0 / apart) @ differences @ to_derivative, knots[1:-1]
    return tables
