"""Which of many points are nearest, as expressions."""

import math

import casadi as ca
import numpy as np

_STARTS = 3


def nearest_samples(
    y: ca.MX, parameters: np.ndarray, points: np.ndarray, apart: np.ndarray
) -> list[ca.MX]:
    """Return the parameters of the nearest sample, and of the nearest ones farther away from it.

    If the point is not finite, they are those of any.

    Args:
        y: The point, shape (dimension,).
        parameters: Of the samples, [n, p].
        points: The samples, [n, dimension].
        apart: Parameters that differ by less, in all p, belong to one valley of the distance, [p].

    Returns:
        Three starts for a search of the nearest point, the nearest first, each of shape (p,).
    """
    # from their middle, so that nothing is lost where they are far from the origin
    middle = points.mean(axis=0)
    around = points - middle
    cost = ca.MX(ca.DM(np.sum(around**2, axis=1))) - ca.MX(ca.DM(2.0 * around)) @ (y - middle)
    numbers = ca.MX(ca.DM(np.arange(float(len(points)))))
    columns = [ca.MX(ca.DM(column)) for column in parameters.T]
    starts = []
    for _ in range(_STARTS):
        index = ca.mmin(ca.if_else(cost <= ca.mmin(cost), numbers, len(points) - 1.0))
        starts.append(ca.vertcat(*[column[index] for column in columns]))
        near = ca.MX(1.0)
        for k, column in enumerate(columns):
            near = ca.logic_and(near, ca.fabs(column - starts[-1][k]) < apart[k])
        cost = ca.if_else(near, math.inf, cost)
    return starts
