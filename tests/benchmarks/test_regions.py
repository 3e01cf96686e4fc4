"""Time of one distance of each kind of region, and of a tick of the schedule of many.

Run with ``pytest tests/benchmarks --benchmark-enable``; otherwise every benchmark runs once.
"""

import math

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.fixtures.schedule import DistanceSchedule
from pfsc_drake.geometry import interpolate, surface_through_grid, torus
from pfsc_drake.geometry.regions.moving import ShiftedRegion, TurningRegion
from pfsc_drake.geometry.regions.surface_region import SurfaceRegion
from pfsc_drake.geometry.shapes.cone import ConeRegion
from pfsc_drake.geometry.shapes.cylinder import CylinderRegion
from pfsc_drake.geometry.shapes.paraboloid import ParaboloidRegion
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.geometry.shapes.polyhedron import PolyhedronRegion, box_corners
from pfsc_drake.geometry.shapes.profiles import ExtrudedRegion, RevolvedRegion
from pfsc_drake.geometry.shapes.sphere import SphereRegion
from pfsc_drake.geometry.shapes.torus import TorusRegion
from tests.control.fixtures.walks import SPEED, START, TICK, Operator, admissible, reach_of, scene

COUNT = 200
ORIGIN, AXIS = (0.1, -0.2, 0.3), (0.3, 0.2, 1.0)


class Swinging:
    """A course of one sine."""

    largest_rate = 0.1

    def at(self, clock):
        return 0.02 * ca.sin(5.0 * clock)


def _hills():
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 30), np.linspace(-0.4, 0.4, 25), indexing="ij")
    points = np.stack([x, y, 0.02 * np.sin(9.0 * x) * np.cos(7.0 * y)], axis=-1)
    return surface_through_grid(points, smoothness=3)


def _blob(height=None):
    t = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
    radius = 0.2 + 0.03 * np.cos(3.0 * t)
    columns = [0.5 + radius * np.cos(t), radius * np.sin(t)]
    if height is not None:
        columns.append(np.full(16, height))
    return interpolate(np.stack(columns, axis=1), smoothness=3, closed=True)


REGIONS = {
    "half-space": lambda: HalfSpace(ORIGIN, AXIS),
    "sphere": lambda: SphereRegion(ORIGIN, 0.2, inside=False),
    "cylinder": lambda: CylinderRegion(0.2, ORIGIN, AXIS, inside=True),
    "cone": lambda: ConeRegion(0.5, ORIGIN, AXIS, inside=False),
    "torus": lambda: TorusRegion(0.3, 0.1, ORIGIN, AXIS, inside=False),
    "paraboloid": lambda: ParaboloidRegion(34.6, ORIGIN, AXIS, inside=False),
    "box": lambda: PolyhedronRegion(box_corners((0.3, 0.2, 0.1), ORIGIN, None)),
    "extruded": lambda: ExtrudedRegion(_blob(0.0), (0.1, 0.0, 1.0), inside=False),
    "revolved": lambda: RevolvedRegion(_blob(), ORIGIN, AXIS, inside=False),
    "surface, hills": lambda: SurfaceRegion(_hills(), above=True),
    "surface, torus": lambda: SurfaceRegion(torus(0.3, 0.1), above=True),
}


def _points(region, nearest, farthest):
    """Points at distances between two."""
    rng, points = np.random.default_rng(1), []
    while len(points) < COUNT:
        y = rng.uniform(-0.5, 0.5, size=3)
        h, *n = region.distance(*y.tolist())
        # down along the normal to a distance that is wanted
        if abs(h) > farthest:
            y = y - (h - rng.uniform(nearest, farthest)) * np.array(n)
        if nearest <= abs(region.distance(*y.tolist())[0]) <= farthest:
            points.append(tuple(y.tolist()))
    return points


@pytest.mark.parametrize("where", ["near", "far"])
@pytest.mark.parametrize("name", REGIONS)
def test_distance(benchmark, name, where):
    """Time of COUNT distances; the times in a table are COUNT times as long."""
    region = REGIONS[name]()
    points = _points(region, *{"near": (0.0, 0.01), "far": (0.05, 0.5)}[where])
    benchmark.extra_info["distances"] = COUNT
    benchmark.pedantic(lambda: [region.distance(*y) for y in points], rounds=20, warmup_rounds=2)


@pytest.mark.parametrize("kind", ["shifted", "turning"])
def test_distance_of_a_moving_region(benchmark, kind):
    """Time of COUNT distances of a paraboloid."""
    region = REGIONS["paraboloid"]()
    points = _points(region, 0.0, 0.01)
    moving = (
        ShiftedRegion(region, Swinging(), AXIS)
        if kind == "shifted"
        else TurningRegion(region, Swinging(), ORIGIN, (1.0, 0.0, 0.0))
    )
    benchmark.extra_info["distances"] = COUNT
    benchmark.pedantic(
        lambda: [moving.distance_at(*y, 0.3) for y in points], rounds=20, warmup_rounds=2
    )


@pytest.mark.slow(but="2")
@pytest.mark.parametrize("count", [2, 10, 50, 200])
def test_schedule(benchmark, count):
    """Time of 1000 ticks of a walk among closed forms, all distances within."""
    regions = scene(count, count // 10, seed=count)
    schedule = DistanceSchedule(regions, reach=reach_of(SPEED + 0.09), speed=0.09)
    operator, point, walk = Operator(1), np.array(START), []
    memory, evaluations = schedule.start(START), 0
    for tick in range(1000):
        walk.append((tuple(point.tolist()), TICK * tick))
        due = schedule.update(memory, *walk[-1])
        memory, evaluations = due.memory, evaluations + len(due.evaluated)
        point = point + TICK * admissible(operator.wish(), due.near)

    def ticks():
        memory = schedule.start(START)
        for point, clock in walk:
            memory = schedule.update(memory, point, clock).memory

    benchmark.extra_info["evaluations per tick"] = evaluations / len(walk)
    benchmark.pedantic(ticks, rounds=10, warmup_rounds=1)
