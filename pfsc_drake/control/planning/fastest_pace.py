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
_ACCURACY, _STEPS = 1e-6, 400
# samples around one at which a limit is watched
_AROUND = 41
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
        watched: Of a limit, up to which a motion is thought to stay below it if it does so as it is
            given, at the pace 1, and around that place. Limits on which this saves time should be
            checked afterwards.
    """
    inner = ca.MX.sym("coefficients", intervals - degree)
    x = ca.vertcat(ca.repmat(inner[0], degree), inner, ca.repmat(inner[-1], degree))
    c, *slopes = (table @ x for table in _tables(theta, intervals, degree))
    rates = time_derivatives(c, *slopes)
    rows = _rows(demand, theta, limits, rates, watched)
    # neighbours may differ by a factor; what is more, the motion at this pace could not show
    steep = [x[1:] - _STEEPEST * x[:-1], x[:-1] - _STEEPEST * x[1:]]
    bounded, count = ca.vertcat(*rows), 2 * (intervals + degree - 1)
    lower = np.concatenate([-np.ones(bounded.numel()), np.full(count, -np.inf)])
    upper = np.concatenate([np.ones(bounded.numel()), np.zeros(count)])
    weights = np.full(len(theta), theta[1])
    weights[[0, -1]] /= 2.0
    problem = {
        "x": inner,
        "f": ca.dot(ca.DM(weights), 1.0 / c) / float(theta[-1]),
        "g": ca.vertcat(bounded, *steep),
    }
    options = {f"ipopt.{key}": value for key, value in _SOLVER.items()}
    solver = ca.nlpsol("fastest", "ipopt", problem, {**options, "print_time": False})
    found = solver(x0=1.0, lbg=lower, ubg=upper, lbx=_SLOWEST)
    status = str(solver.stats()["return_status"])
    coefficients = np.pad(np.array(found["x"])[:, 0], degree, mode="edge")
    pace = PaceSpline(float(theta[-1]), coefficients, degree)
    return FoundPace(pace, bool(solver.stats()["success"]), status)


def _rows(
    demand: DemandPolynomial,
    theta: np.ndarray,
    limits: PaceLimits,
    rates: list[ca.MX],
    watched: float,
) -> list[ca.MX]:
    """Return what must be between -1 and 1."""
    given = demand.torques(np.eye(1, 4).repeat(len(theta), axis=0))
    slopes = np.diff(given, axis=0) / theta[1] / limits.torque_rate[1:]
    near = {"torque": given / limits.torque, "rate": np.pad(slopes, ((1, 0), (0, 0)))}
    seen = {
        key: maximum_filter1d(np.abs(share), _AROUND, axis=0) >= watched
        for key, share in near.items()
    }
    rows = [rates[0] / ca.DM(np.minimum(limits.pace, _LARGEST))]
    for i in range(given.shape[1]):
        at = np.flatnonzero(seen["torque"][:, i])
        if at.size:
            rows.append(_torque(demand, rates, at, i) / ca.DM(limits.torque[at, i]))
        at = np.flatnonzero(seen["rate"][1:, i] & np.isfinite(limits.torque_rate[1:, i]))
        if at.size:
            slope = _torque(demand, rates, at + 1, i) - _torque(demand, rates, at, i)
            c = (rates[0][at + 1] + rates[0][at]) / 2.0
            rows.append(slope * c / ca.DM(theta[1] * limits.torque_rate[at + 1, i]))
    return rows


def _torque(demand: DemandPolynomial, rates: list[ca.MX], at: np.ndarray, i: int) -> ca.MX:
    """Return the torque of a drive at some samples."""
    chosen = [rate[at] for rate in rates]
    total = ca.MX(ca.DM(demand.coefficients[at, 0, i]))
    for k, powers in enumerate(demand.exponents[1:], start=1):
        monomial = prod(rate**p for rate, p in zip(chosen, powers, strict=True) if p)
        total += ca.DM(demand.coefficients[at, k, i]) * monomial
    return total


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
