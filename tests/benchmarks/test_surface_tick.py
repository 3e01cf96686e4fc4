"""Time that a surface's point takes at each tick, on ways of 1 m/s beside the surface.

Run with ``pytest tests/benchmarks --benchmark-enable``; otherwise every benchmark runs once.
"""

import math

import numpy as np
import pytest

from pfsc_drake.geometry import (
    ProjectionStatus,
    SurfaceEvaluator,
    cylinder,
    extruded_surface,
    interpolate,
    paraboloid,
    sphere,
    surface_through_grid,
    torus,
    translated_surface,
)

COUNT = 200
HEIGHT = 0.01


def _wave(axis):
    along = np.linspace(-0.4, 0.4, 9)
    points = np.zeros((9, 3))
    points[:, axis], points[:, 2] = along, 0.02 * np.sin(9.0 * along)
    return interpolate(points, smoothness=5)


def _hills():
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 30), np.linspace(-0.4, 0.4, 25), indexing="ij")
    points = np.stack([x, y, 0.02 * np.sin(9.0 * x) * np.cos(7.0 * y)], axis=-1)
    return surface_through_grid(points, smoothness=5)


SURFACES = {
    "cylinder": (cylinder(0.09, (-0.3, 0.3)), (0.0, 0.0), (10.0, 0.3)),
    "sphere": (sphere(0.2, (-1.4, 1.4)), (0.0, 0.0), (3.0, 3.0)),
    "torus": (torus(0.5, 0.1), (0.0, 0.0), (1.4, 5.0)),
    "paraboloid": (paraboloid(((-0.3, 0.3), (-0.3, 0.3)), 1.667), (-0.1, -0.1), (0.8, 0.4)),
    "splines": (translated_surface(_wave(0), _wave(1)), None, (0.7, 0.7)),
    "grid": (_hills(), None, (0.7, 0.7)),
    "extrusion": (extruded_surface(_wave(0), (0.0, 1.0, 0.0), 0.8), (0.2, 0.2), (0.9, 0.2)),
}


class Ticks:
    """Points of the tool and what the tick before left, again and again."""

    def __init__(self, surface, middle, rate, order):
        self.evaluate = SurfaceEvaluator(surface, order)
        middle = (
            [ends.begin + 0.5 * ends.length for ends in surface.domain]
            if middle is None
            else middle
        )
        theta = np.array(middle) + 1e-3 * np.arange(COUNT)[:, None] * np.array(rate)
        _, first, second = np.moveaxis(surface.partials(theta, 1), -2, 0)
        normal = np.cross(first, second)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        points = surface.partials(theta, 0)[:, 0] + HEIGHT * normal
        last, eta, self.inputs = tuple(theta[0].tolist()), (0.0, 0.0), []
        for point in points.tolist():
            self.inputs.append((point, last, eta))
            row = self.evaluate(point, last, eta)
            assert row[5] == ProjectionStatus.OK
            last, eta = tuple(row[:2].tolist()), tuple(row[2:4].tolist())
        assert math.dist(last, theta[-1]) < 1e-9

    def __call__(self):
        for arguments in self.inputs:
            self.evaluate(*arguments)


@pytest.mark.slow(but="cylinder-2")
@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("name", SURFACES)
def test_surface_point(benchmark, name, order):
    """Time of COUNT ticks; the times in a table are COUNT times as long."""
    ticks = Ticks(*SURFACES[name], order)
    benchmark.extra_info["ticks"] = COUNT
    benchmark.pedantic(ticks, rounds=30, warmup_rounds=2)
