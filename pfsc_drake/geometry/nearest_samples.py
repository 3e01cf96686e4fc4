"""Initial guesses of the search for the closest point as expressions, and its status."""

import math
from enum import IntEnum

import casadi as ca
import numpy as np

_STARTS = 3
# calls in a row of one function, so that code grows with the logarithm of the number of samples
_CALLS = 16


def nearest_samples(
    y: ca.MX, parameters: np.ndarray, points: np.ndarray, apart: np.ndarray
) -> list[ca.MX]:
    """Return the parameters of the nearest sample, and of the nearest ones farther away from it.

    If the point is not finite, they are the parameters of any sample.

    Args:
        y: The point, shape (dimension,).
        parameters: Parameters of the samples, [n, p].
        points: The samples, [n, dimension].
        apart: Parameters that differ by less, in all p, belong to one valley of the distance, [p].

    Returns:
        Three starts for a search of the nearest point, the nearest first, each of shape (p,).
    """
    dimension, p = points.shape[1], parameters.shape[1]
    # from their middle, so that nothing is lost where they are far from the origin
    middle = points.mean(axis=0)
    around = points - middle
    samples = np.column_stack([np.sum(around**2, axis=1), 2.0 * around, parameters])
    starts: list[ca.MX] = []
    for _ in range(_STARTS):
        known = ca.vertcat(*starts, np.full(p * (_STARTS - len(starts)), math.inf))
        state = ca.vertcat(y - middle, known, math.inf, ca.DM(parameters[0]))
        best = _over_all(_nearer(dimension, p, apart), state, samples)
        starts.append(best[-p:])
    return starts


def _nearer(dimension: int, p: int, apart: np.ndarray) -> ca.Function:
    """Return ``(state, sample) -> state``, which stores the nearest admissible sample.

    The state is ``[y, starts found so far, cost, parameters]``, a sample
    ``[|x|^2, 2 x, parameters]``; costs are squared distances without ``|y|^2``.
    """
    y, known = ca.SX.sym("y", dimension), [ca.SX.sym(f"start_{k}", p) for k in range(_STARTS)]
    best, parameters = ca.SX.sym("cost"), ca.SX.sym("parameters", p)
    square, double, own = ca.SX.sym("square"), ca.SX.sym("double", dimension), ca.SX.sym("own", p)
    cost = square - ca.dot(double, y)
    for start in known:
        near = [ca.fabs(own[k] - start[k]) < apart[k] for k in range(p)]
        cost = ca.if_else(ca.logic_all(ca.vertcat(*near)), math.inf, cost)
    nearer = cost < best
    nearest = [ca.if_else(nearer, new, old) for new, old in ((cost, best), (own, parameters))]
    return ca.Function(
        "nearer",
        [ca.vertcat(y, *known, best, parameters), ca.vertcat(square, double, own)],
        [ca.vertcat(y, *known, *nearest)],
    )


def _over_all(step: ca.Function, state: ca.MX, samples: np.ndarray) -> ca.MX:
    """Return the state after one step with each sample, [n, size]."""
    levels = max(1, math.ceil(math.log(len(samples), _CALLS)))
    calls = math.ceil(round(len(samples) ** (1.0 / levels), 9))
    # padded by the last one, which changes nothing
    rows = np.minimum(np.arange(calls**levels), len(samples) - 1)
    columns = samples[rows].T
    for _ in range(levels - 1):
        step = _repeat(step, calls)
    for part in np.hsplit(columns, calls):
        state = step(state, ca.DM(part))
    return state


def _repeat(step: ca.Function, calls: int) -> ca.Function:
    """Return a function that performs several steps."""
    begin = state = ca.MX.sym("state", step.size1_in(0))
    samples = ca.MX.sym("samples", step.size1_in(1), calls * step.size2_in(1))
    for part in ca.horzsplit(samples, step.size2_in(1)):
        state = step(state, part)
    return ca.Function(f"{step.name()}_{calls}", [begin, samples], [state])


class ProjectionStatus(IntEnum):
    """Value of the field `status` of a manifold's point."""

    OK = 0
    BEYOND_END = 1
    NOT_CONVERGED = 2
