"""What is said about regions that make no sense together."""

import math
import re

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.moving import ShiftedRegion
from pfsc_drake.geometry.regions.region_checks import (
    blocked_start,
    refuse_forbidden_start,
    refuse_same_regions,
    tangent_regions,
)
from pfsc_drake.geometry.shapes.cylinder import CylinderRegion
from pfsc_drake.geometry.shapes.paraboloid import ParaboloidRegion
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.geometry.shapes.polyhedron import PolyhedronRegion, box_corners
from pfsc_drake.geometry.shapes.sphere import SphereRegion

START = (1.094, 0.02, 1.077)
UP = (0.0, 0.0, 1.0)


class Still:
    """A motion that goes nowhere."""

    largest_rate = 0.0

    def at(self, clock):
        return 0.05


@pytest.fixture
def scene():
    """Sec. 5.2.4."""
    return {
        "regions[0]": HalfSpace((0.9, 0.0, 0.7), UP),
        "regions[1]": CylinderRegion(0.2, (0.9, 0.0, 0.7), UP, inside=True),
        "regions[2]": ParaboloidRegion(-0.2 / 0.076**2, (0.95, 0.0, 0.9), UP, inside=False),
    }


def test_the_experiment_makes_sense(scene):
    refuse_forbidden_start(scene, START)
    refuse_same_regions(scene, START)
    assert tangent_regions(scene, START) == []


def test_a_start_in_a_forbidden_region(scene):
    """Told with depth, and the way out of all of them."""
    with pytest.raises(InputError, match=r"start .* is in a forbidden region") as caught:
        refuse_forbidden_start(scene, (1.12, 0.0, 0.69))
    message = str(caught.value)
    assert "10 mm deep in that of regions[0], 20 mm deep in that of regions[1];" in message
    place = re.search(r"; \[(.*)\] m is admissible, (.*) mm away", message)
    found = [float(value) for value in place[1].split(",")]
    assert all(region.distance(*found)[0] > -1e-5 for region in scene.values())
    away = math.dist(found, (1.12, 0.0, 0.69)) * 1e3
    assert float(place[2]) == pytest.approx(away, rel=1e-2)
    assert away == pytest.approx(math.hypot(10.0, 20.0), rel=1e-2)


def test_no_admissible_point_near(scene):
    scene["ball"] = SphereRegion(START, 3.0, inside=False)
    with pytest.raises(InputError, match="3000 mm deep in that of ball; no admissible point"):
        refuse_forbidden_start(scene, START)


def test_a_start_without_an_admissible_point_nearby():
    """Two walls that overlap admit nothing; apart by a millimetre they do."""
    floor, ceiling = HalfSpace((0, 0, 0.81), UP), HalfSpace((0, 0, 0.80), (0, 0, -1))
    walls = {"floor": floor, "ceiling": ceiling}
    (message,) = blocked_start(walls, (0, 0, 0.812))
    assert "in that of ceiling, and no admissible point" in message
    walls["ceiling"] = HalfSpace((0, 0, 0.811), (0, 0, -1))
    assert blocked_start(walls, (0, 0, 0.812)) == []
    assert blocked_start(walls, (0, 0, 0.8105)) == []


def test_moving_regions_are_where_the_clock_says():
    moving = {"wall": ShiftedRegion(HalfSpace((0, 0, 0), UP), Still(), UP)}
    refuse_forbidden_start(moving, (0.0, 0.0, 0.06))
    with pytest.raises(InputError, match="10 mm deep in that of wall"):
        refuse_forbidden_start(moving, (0.0, 0.0, 0.04), 1.0)


def test_the_same_region_twice(scene):
    scene["again"] = CylinderRegion(0.2, (0.9, 0.0, -3.0), (0, 0, -2), inside=True)
    with pytest.raises(InputError, match=re.escape("regions[1] and again: the same region")):
        refuse_same_regions(scene, START)


def test_one_boundary_with_two_sides(scene):
    scene["other"] = CylinderRegion(0.2, (0.9, 0.0, -3.0), UP, inside=False)
    with pytest.raises(InputError, match=re.escape("regions[1] and other: one boundary")):
        refuse_same_regions(scene, START)


def test_moving_regions_may_begin_at_one_point():
    regions = {
        name: ShiftedRegion(HalfSpace((0, 0, 0), UP), Still(), UP) for name in ("one", "other")
    }
    refuse_same_regions(regions, (0.0, 0.0, 1.0))
    resting = {name: HalfSpace((0, 0, 0), UP) for name in regions}
    with pytest.raises(InputError, match="one and other: the same region"):
        refuse_same_regions(resting, (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("one", "other", "angle"),
    [
        (HalfSpace((0, 0, 0), UP), SphereRegion((0.1, 0.05, 0.2), 0.2, inside=False), 180.0),
        (HalfSpace((0, 0, 0), UP), SphereRegion((0.1, 0.05, -0.01), 0.01, inside=False), 0.0),
        (HalfSpace((0, 0, 0), UP), HalfSpace((0, 0, 0), (0.0, 0.005, 1.0)), 0.29),
        (
            CylinderRegion(0.3, (0, 0, 0), UP, inside=True),
            CylinderRegion(0.1, (0.2, 0, 0), UP, inside=False),
            180.0,
        ),
    ],
    ids=["ball on the floor", "ball below it", "flat wedge", "tube in a tube"],
)
def test_boundaries_that_touch(one, other, angle):
    (sentence,) = tangent_regions({"one": one, "other": other}, (0.05, 0.02, 0.1))
    reports = re.fullmatch(
        r"one and other: boundaries touch at \[(.*)\] m, (.*) deg between their normals", sentence
    )
    place = np.array([float(value) for value in reports[1].split(",")])
    for region in (one, other):
        assert region.distance(*place)[0] == pytest.approx(0.0, abs=2e-6)
    assert float(reports[2]) == pytest.approx(angle, abs=0.1)


def test_an_obstacle_may_stand_on_the_floor():
    """There is no gap under it, however often its face and the floor are the same."""
    regions = {
        "floor": HalfSpace((0, 0, 0), UP),
        "box": PolyhedronRegion(box_corners((0.1, 0.1, 0.2), (0.05, 0.0, 0.1), None)),
    }
    assert tangent_regions(regions, (0.0, 0.0, 0.15)) == []


def test_boundaries_that_cross_or_keep_apart():
    floor = HalfSpace((0, 0, 0), UP)
    for other in (
        SphereRegion((0.1, 0.05, 0.2), 0.21, inside=False),
        SphereRegion((0.1, 0.05, 0.2), 0.19, inside=False),
        HalfSpace((0, 0, -0.1), UP),
        HalfSpace((0, 0, 0), (0.0, 0.02, 1.0)),
    ):
        assert tangent_regions({"floor": floor, "other": other}, (0.0, 0.0, 0.1)) == []


@pytest.mark.parametrize("degrees", range(0, 180, 5))
def test_a_slot_whose_normals_differ_by_rounding(degrees):
    """Opposite walls about a start half-way, one of whose normals is computed another way."""
    one = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
    start, half = np.array([0.9, 0.0, 0.9]), 0.006
    for ulps in (-1.0, 0.0, 1.0):
        other = one + ulps * np.spacing(one)
        regions = {
            "regions[0]": HalfSpace(start - half * one, one),
            "regions[1]": HalfSpace(start + half * one, -other),
        }
        assert tangent_regions(regions, start) == []
