"""The pace at which a motion along its course takes the least time."""

from dataclasses import dataclass
from math import prod

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import maximum_filter1d
from scipy.sparse import csc_matrix, diags, identity

from pfsc_drake.control.planning.demand_polynomial import DemandPolynomial
from pfsc_drake.control.planning.pace_spline import PaceSpline, knots_of, time_derivatives

# least pace, and the largest where nothing else bounds it
_SLOWEST, _LARGEST = 1e-3, 1e3
# how much faster or slower a pace may become over the support of a spline's coefficient
_STEEPEST = 1.3
# of the solver: relative accuracy of the duration, and steps
_ACCURACY, _STEPS = 1e-6, 250
# samples around one that comes near to a limit, at which that is looked at
_AROUND = 41
# how often limits that were left out are added, where they are passed by more than this
_ROUNDS, _PASSED = 6, 1e-4
# of a pace, that a demand depends on
_DERIVATIVES = 3
# where barriers begin, and how far from its bounds: a start that is near an optimum stays there
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
class PaceLimits:
    """What bounds the pace of a motion, at every sample of its course.

    Attributes:
        torque: Largest torques [Nm or N], shape (samples, N).
        torque_rate: Their largest rates [Nm/s or N/s], of the same shape; infinite for none.
        pace: Largest pace, from joint speeds and the tool's, shape (samples,).
    """

    torque: np.ndarray
    torque_rate: np.ndarray
    pace: np.ndarray


@dataclass(frozen=True)
class FoundPace:
    """A pace, and what the solver says of it.

    Attributes:
        pace: The pace.
        converged: Whether it is a local optimum.
        status: What the solver says.
    """

    pace: PaceSpline
    converged: bool
    status: str


def find_fastest_pace(
    demand: DemandPolynomial,
    theta: np.ndarray,
    limits: PaceLimits,
    intervals: int,
    degree: int,
    watched: float = 0.0,
) -> FoundPace:
    """Return the pace at which a motion ends first while every limit is kept.

    A B-spline ``c(theta)`` minimizes ``int 1/c dtheta`` with ``|tau| <= torque``,
    ``c <= pace`` and ``|dtau/dtheta| c <= torque_rate`` at the samples, by an interior point method
    with exact derivatives. Over the first and the last interval the pace is even, so that the
    motion leaves rest as the given one does: what happens there between two samples is known.

    Args:
        demand: Torques that it asks for, at the samples.
        theta: Even samples of its own time from 0 on [s], shape (samples,).
        limits: What bounds it.
        intervals: Number of intervals of the spline, more than its degree.
        degree: Degree of the spline, at least 3, and at least the highest derivative of the joint
            coordinates that the demand depends on: torques are continuous then.
        watched: Of a limit, up to which it is left out at first, and looked at afterwards.
    """
    program = _Program(demand, theta, limits, intervals, degree)
    share = program.shares(PaceSpline(float(theta[-1]), np.ones(intervals + degree), degree))
    seen = _near(share, watched)
    for _ in range(_ROUNDS):
        found = program.solve(seen)
        share = program.shares(found.pace)
        if not np.any((share > 1.0 + _PASSED) & ~seen):
            break
        seen |= _near(share, watched)
    return found


def _near(share: np.ndarray, watched: float) -> np.ndarray:
    """Return which shares of limits, (samples, limits), are to be looked at."""
    return np.asarray(maximum_filter1d(share, _AROUND, axis=0) >= watched)


class _Program:
    """The optimization problem, of which only some limits are looked at."""

    def __init__(
        self,
        demand: DemandPolynomial,
        theta: np.ndarray,
        limits: PaceLimits,
        intervals: int,
        degree: int,
    ) -> None:
        self._demand, self._theta, self._limits, self._degree = demand, theta, limits, degree
        self._inner = ca.MX.sym("coefficients", intervals - degree)
        ends = ca.repmat(self._inner[0], degree), ca.repmat(self._inner[-1], degree)
        self._x = ca.vertcat(ends[0], self._inner, ends[1])
        tables = _tables(theta, intervals, degree)
        self._rates = time_derivatives(*[table @ self._x for table in tables])
        # of all samples, without the first, which is 1
        self._monomials = [
            prod(rate**p for rate, p in zip(self._rates, powers, strict=True) if p)
            for powers in demand.exponents[1:]
        ]

    def shares(self, pace: PaceSpline) -> np.ndarray:
        """Return shares of the limits of torques and of their rates, shape (samples, 2N)."""
        rates = pace.rates(self._theta)
        torques = self._demand.torques(rates)
        c = (rates[1:, :1] + rates[:-1, :1]) / 2.0
        slopes = np.diff(torques, axis=0) * c / self._theta[1] / self._limits.torque_rate[1:]
        # that of an interval is that of its end
        slopes = np.pad(slopes, ((1, 0), (0, 0)))
        return np.abs(np.concatenate([torques / self._limits.torque, slopes], axis=1))

    def solve(self, seen: np.ndarray) -> FoundPace:
        """Return the fastest pace with limits of which some are seen, (samples, 2N)."""
        x, theta = self._x, self._theta
        rows = ca.vertcat(*self._rows(seen))
        # neighbours may differ by a factor; what is more, the motion at this pace could not show
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
        pace = PaceSpline(float(theta[-1]), coefficients, self._degree)
        stats = solver.stats()
        return FoundPace(pace, bool(stats["success"]), str(stats["return_status"]))

    def _rows(self, seen: np.ndarray) -> list[ca.MX]:
        """Return what must be between -1 and 1."""
        limits, c, n = self._limits, self._rates[0], seen.shape[1] // 2
        rows = [c / ca.DM(np.minimum(limits.pace, _LARGEST))]
        at, axis = np.nonzero(seen[:, :n])
        rows.append(self._torques(at, axis, 1.0 / limits.torque[at, axis]))
        at, axis = np.nonzero(seen[1:, n:] & np.isfinite(limits.torque_rate[1:]))
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
        places = np.repeat(rows, count), columns.ravel()
        map_of = csc_matrix((table[:, 1:].ravel(), places), shape=(len(at), samples * count))
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
