"""A B-spline of equal knot intervals, span by span, as expressions of its control points."""

import math
from functools import cached_property

import casadi as ca
import numpy as np

_NODES = 8  # of the quadrature of a span's arc length
_BENDS = 5  # points of a span at which its curvature is evaluated


class UniformSpline:
    """B-spline of degree p over the knots 0, 1, 2, .., of class C^(p - 1).

    Span i is ``theta = i .. i + 1``. It depends on the control points i .. i + p only: a control
    point that is added at the end adds one span and changes none. Control point k has its largest
    weight at the site ``k - (p - 1) / 2``.

    Control points c beside waypoints w, ``c_k = w_k - s (w_(k-1) - 2 w_k + w_(k+1))`` with
    ``s = (p + 1) / 24``, define a spline that passes the waypoints with an error of the fourth
    order of their distance: its value at a site is ``c + s (second difference of c) + ..``

    Args:
        degree: p, from 2 on.

    Attributes:
        degree: p.
        basis: Coefficients of the p + 1 basis functions of a span by powers of u, the fraction of
            the span, lowest power first, shape (p + 1, p + 1).
        reach: Control points on each side of a site that the spline there depends on.
        sharpening: s.
    """

    def __init__(self, degree: int) -> None:
        self.degree, p = degree, degree
        self.reach = (p + 1) // 2
        self.sharpening = (p + 1) / 24.0
        self.basis = np.array(
            [
                [
                    math.comb(p, i)
                    / math.factorial(p)
                    * sum(
                        (-1) ** (s - j) * math.comb(p + 1, s - j) * (p - s) ** (p - i)
                        for s in range(j, p + 1)
                    )
                    for i in range(p + 1)
                ]
                for j in range(p + 1)
            ]
        )

    def site(self, k: float) -> float:
        """Return the parameter at which control point k has its largest weight."""
        return k - (self.degree - 1) / 2.0

    def derivatives(self, points: ca.SX, u: ca.SX, order: int) -> list[ca.SX]:
        """Return the derivatives 0..order by theta within a span, each of shape (dimension,).

        Args:
            points: Its control points as columns, shape (dimension, p + 1).
            u: Fraction of the span, 0 to 1.
            order: Highest derivative.
        """
        coefficients = points @ ca.DM(self.basis)
        found = []
        for k in range(order + 1):
            value = ca.SX.zeros(points.size1())
            for i in range(self.degree, k - 1, -1):
                value = value * u + math.perm(i, k) * coefficients[:, i]
            found.append(value)
        return found

    def sharpen(self, before: ca.SX, at: ca.SX, after: ca.SX) -> ca.SX:
        """Return the control point beside a waypoint between two others."""
        return at - self.sharpening * (before - 2.0 * at + after)

    def point_function(self, dimension: int, order: int) -> ca.Function:
        """Return ``(points, u) -> derivatives`` 0..order, flat, those of each order together.

        Args:
            dimension: Dimension of the control points, which are flat, one after the other.
            order: Highest derivative.
        """
        points, u = ca.SX.sym("points", dimension * (self.degree + 1)), ca.SX.sym("u")
        columns = ca.reshape(points, dimension, self.degree + 1)
        found = ca.vertcat(*self.derivatives(columns, u, order))
        return ca.Function("span_point", [points, u], [found], {"cse": True})

    @cached_property
    def length(self) -> ca.Function:
        """``(points, u) -> length``: arc length from a span's begin, of points (3 (p + 1),)."""
        points, u = ca.SX.sym("points", 3 * (self.degree + 1)), ca.SX.sym("u")
        columns = ca.reshape(points, 3, self.degree + 1)
        length = ca.SX(0.0)
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        for node, weight in zip(nodes, weights, strict=True):
            slope = self.derivatives(columns, u * (1.0 + node) / 2.0, 1)[1]
            length += weight / 2.0 * u * ca.norm_2(slope)
        return ca.Function("span_length", [points, u], [length], {"cse": True})

    @cached_property
    def shape(self) -> ca.Function:
        """``points -> [curvature, jerk]`` of a span, of points (3 (p + 1),).

        The largest curvature [1/m], and the largest third derivative by theta over the third power
        of the first one [1/m^2], among several points of the span.
        """
        points = ca.SX.sym("points", 3 * (self.degree + 1))
        columns = ca.reshape(points, 3, self.degree + 1)
        curvature, jerk = ca.SX(0.0), ca.SX(0.0)
        for u in np.linspace(0.0, 1.0, _BENDS):
            _, slope, bend, third = self.derivatives(columns, ca.SX(u), 3)
            speed = ca.norm_2(slope)
            curvature = ca.fmax(curvature, ca.norm_2(ca.cross(slope, bend)) / speed**3)
            jerk = ca.fmax(jerk, ca.norm_2(third) / speed**3)
        found = ca.vertcat(curvature, jerk)
        return ca.Function("span_shape", [points], [found], {"cse": True})
