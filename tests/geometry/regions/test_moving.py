"""Moving regions against regions that stand where these are, and largest speeds."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.moving import ShiftedRegion, TurningRegion
from pfsc_drake.geometry.shapes.cone import ConeRegion
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.geometry.shapes.torus import TorusRegion
from tests.geometry.regions.brute_force import gradient

ORIGIN, AXIS = np.array([0.3, -0.2, 0.7]), np.array([0.3, 0.5, -1.0])
DIRECTION = np.array([1.0, -2.0, 0.5])
PIVOT, PIVOT_AXIS = np.array([-0.1, 0.4, 0.2]), np.array([0.2, -1.0, 0.6])


class Sine:
    """Angle or way over a clock."""

    largest_rate = 0.3 * 1.7

    def at(self, clock):
        return 0.3 * ca.sin(1.7 * clock)


MAKERS = {
    "torus": lambda origin, axis: TorusRegion(0.3, 0.1, origin, axis, inside=False),
    "cone": lambda origin, axis: ConeRegion(0.6, origin, axis, inside=True),
    "plane": HalfSpace,
}


def points(count):
    return np.random.default_rng(3).uniform(-0.8, 0.8, size=(count, 3))


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("clock", [0.0, 0.4, 5.0])
def test_a_shifted_region_is_where_it_was_shifted(name, clock):
    moving = ShiftedRegion(MAKERS[name](ORIGIN, AXIS), Sine(), DIRECTION)
    way = Sine().at(clock) * DIRECTION / np.linalg.norm(DIRECTION)
    there = MAKERS[name](ORIGIN + way, AXIS)
    for y in points(20):
        assert moving.distance_at(*y, clock) == pytest.approx(there.distance(*y), abs=1e-14)


@pytest.mark.parametrize("clock", [0.0, 0.4, 5.0])
def test_a_point_that_is_placed_with_a_region_keeps_its_distance(clock):
    """What is drawn is where the distance says it is."""
    at_rest = TorusRegion(0.3, 0.1, ORIGIN, AXIS, inside=False)
    for moving in (
        ShiftedRegion(at_rest, Sine(), DIRECTION),
        TurningRegion(at_rest, Sine(), PIVOT, PIVOT_AXIS),
    ):
        rotation, way = moving.placement(clock)
        for y in points(10):
            there = rotation @ y + way
            h = moving.distance_at(*there, clock)[0]
            assert h == pytest.approx(at_rest.distance(*y)[0], abs=1e-14)


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("clock", [0.0, 0.4, 5.0])
def test_a_turning_region_is_where_it_was_turned(name, clock):
    moving = TurningRegion(MAKERS[name](ORIGIN, AXIS), Sine(), PIVOT, PIVOT_AXIS)
    unit = PIVOT_AXIS / np.linalg.norm(PIVOT_AXIS)
    turn = Rotation.from_rotvec(Sine().at(clock) * unit).as_matrix()
    there = MAKERS[name](PIVOT + turn @ (ORIGIN - PIVOT), turn @ AXIS)
    for y in points(20):
        h, *n = moving.distance_at(*y, clock)
        assert (h, *n) == pytest.approx(there.distance(*y), abs=1e-14)
        assert n == pytest.approx(gradient(lambda *p: moving.distance_at(*p, clock), y), abs=1e-7)


@pytest.mark.parametrize("kind", ["shifted", "turning"])
def test_no_distance_changes_faster_than_its_bound(kind):
    """And one somewhere changes nearly as fast."""
    centre, radius = np.array([0.2, -0.1, 0.3]), 0.5
    rng, fastest = np.random.default_rng(4), 0.0
    for way in rng.normal(size=(60, 3)):
        y = centre + radius * way / np.linalg.norm(way)
        if kind == "shifted":
            moving = ShiftedRegion(HalfSpace(ORIGIN, rng.normal(size=3)), Sine(), AXIS)
        else:
            plane = HalfSpace(ORIGIN, np.cross(PIVOT_AXIS, y - PIVOT))
            moving = TurningRegion(plane, Sine(), PIVOT, PIVOT_AXIS)
        bound = moving.largest_speed(centre, radius)
        for clock in (0.0, 0.2, 2.0):
            ahead, behind = (moving.distance_at(*y, clock + d)[0] for d in (1e-5, -1e-5))
            rate = abs(ahead - behind) / 2e-5
            assert rate <= bound * (1.0 + 1e-6)
            fastest = max(fastest, rate)
    assert fastest > 0.9 * bound


def test_no_direction():
    with pytest.raises(InputError, match="not all zero"):
        ShiftedRegion(MAKERS["plane"](ORIGIN, AXIS), Sine(), (0.0, 0.0, 0.0))
