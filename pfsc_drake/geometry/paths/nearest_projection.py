"""Closest point of a whole path to a moving point, tick by tick."""

import math
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.geometry.paths.geometric_path import Path

# ticks in which a whole path is searched, and least samples of a tick
_TICKS, _FEWEST = 16, 16
_SAMPLES_PER_SEGMENT = 16


class NearestProjection:
    """Projection of a moving point onto the nearest part of a path.

    At each tick Newton's method starts from the last projection or from the nearest of some samples
    of the path. The samples change with the tick; all of them are used within 16 ticks. A part of
    the path that comes nearer than the followed one is therefore found within 16 ticks, once it is
    nearer by the error of half a distance between samples.

    The distance to the new projection is never above the distance to the last one, whether Newton's
    method converges or not. An open path is not extended.

    Args:
        path: The path; its orientation is not used.

    Attributes:
        ticks: Number of ticks in which the whole path is searched.
    """

    ticks = _TICKS

    def __init__(self, path: Path) -> None:
        self._path = path if path.orientation is None else Path(path.position, frame=path.frame)

    def __content__(self) -> object:
        """Return all objects that the function depends on."""
        return self._path

    def nearest(self, y: Any) -> Any:
        """Return the parameter of the whole path's closest point to a point [m], shape (3,)."""
        curve, theta = self._path.position, self._path.evaluator(1).find(y)
        return theta if curve.closed else ca.fmin(ca.fmax(theta, curve.domain[0]), curve.domain[1])

    def distances(self, points: np.ndarray) -> np.ndarray:
        """Return the distances of a moving point from the path.

        Args:
            points: Its position at each tick [m], shape (n, 3); NaN where unknown.

        Returns:
            Distances [m], shape (n,).
        """
        step, distances = BoundFunction(self.function), np.full(len(points), np.nan)
        theta = math.nan
        for tick, y in enumerate(points):
            if math.isnan(theta):
                theta = float(self.nearest(y))
            step.arguments["y"][:], step.arguments["last"][:] = y, theta
            step.arguments["tick"][:] = tick
            step.evaluate()
            theta = float(step.results["theta"][0])
            distances[tick] = np.linalg.norm(y - step.results["position"])
        return distances

    @cached_property
    def function(self) -> ca.Function:
        """``(y, theta, tick) -> (theta, eta, position)``.

        Inputs: the point y [m], shape (3,), the unwrapped parameter of its last projection, and the
        number of the tick. Outputs: parameter, arc length [m] and position [m] of its projection.
        """
        return self._step_function()

    @once_per_content()
    def _step_function(self) -> ca.Function:
        y, last, tick = ca.MX.sym("y", 3), ca.MX.sym("theta"), ca.MX.sym("tick")
        evaluator, curve = self._path.evaluator(1), self._path.position
        layout = evaluator.layout

        def away(point: ca.MX) -> ca.MX:
            """Return the squared distance of a point of the path."""
            return ca.sumsqr(y - point[layout.position][:3])

        other, distance = self._sample(y, tick)
        if curve.closed:  # in the same period
            other += curve.period * ca.floor((last - other) / curve.period + 0.5)
        at_last = away(evaluator.at(last))
        begin, least = ca.if_else(distance < at_last, other, last), ca.fmin(distance, at_last)
        point = evaluator.evaluate(y, begin)
        ends = (-math.inf, math.inf) if curve.closed else curve.domain
        theta = point[layout.theta]
        inside = ca.logic_and(theta >= ends[0], theta <= ends[1])
        # also false for NaN
        good = ca.logic_and(inside, away(point) <= least)
        # beyond an end it is that end, unless the initial guess is nearer
        at = ca.MX.sym("at"), ca.MX.sym("begin"), ca.MX.sym("least"), ca.MX.sym("y", 3)
        end = ca.fmin(ca.fmax(at[0], ends[0]), ends[1])
        of_end = ca.sumsqr(at[3] - evaluator.at(end)[layout.position][:3]) <= at[2]
        clamped = evaluator.at(ca.if_else(of_end, end, at[1]))
        rare = ca.Function("rare", [*at, ca.MX.sym("point", point.numel())], [clamped])
        known = ca.MX.sym("point", point.numel())
        usual = ca.Function("usual", [*at, known], [known])
        point = ca.Function.if_else("place", usual, rare)(good, theta, begin, least, y, point)
        return ca.Function(
            "nearest_place",
            [y, last, tick],
            [point[layout.theta], point[layout.eta], point[layout.position][:3]],
            ["y", "last", "tick"],
            ["theta", "eta", "position"],
        )

    def _sample(self, y: ca.MX, tick: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Return the parameter of the nearest of a tick's samples, and its squared distance."""
        curve = self._path.position
        segments = len(curve.breakpoints) - 1
        count = max(_FEWEST, math.ceil(_SAMPLES_PER_SEGMENT * segments / _TICKS))
        theta = np.linspace(*curve.domain, _TICKS * count, endpoint=not curve.closed)
        rows = np.column_stack([theta, curve.derivatives(theta, 0)[:, 0]])
        # every 16th in a tick, each from end to end
        by_tick = rows.reshape(count, _TICKS, 4).transpose(1, 2, 0).reshape(_TICKS, -1)
        # a table of many columns, of which a tick takes one
        own = ca.reshape(ca.MX(ca.DM(by_tick.T))[:, ca.fmod(tick, _TICKS)], count, 4)
        away = sum((own[:, 1 + k] - y[k]) ** 2 for k in range(3))
        return _nearest_of(count)(own[:, 0], away)


def _nearest_of(count: int) -> ca.Function:
    """Return ``(parameters, distances) -> (parameter, distance)`` of the least distance."""
    theta, away = ca.SX.sym("theta", count), ca.SX.sym("away", count)
    best, least = theta[0], away[0]
    for k in range(1, count):
        nearer = away[k] < least
        best, least = ca.if_else(nearer, theta[k], best), ca.if_else(nearer, away[k], least)
    return ca.Function("nearest_of", [theta, away], [best, least])
