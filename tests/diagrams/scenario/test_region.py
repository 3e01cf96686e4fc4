"""Regions of a scenario."""

import pytest

from diagrams.scenario.region_motion import Shift, Swinging, Turn, Visiting
from diagrams.scenario.virtual_fixtures import RegionParameters
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.shapes.cone import Cone
from pfsc_drake.geometry.shapes.cylinder import Cylinder
from pfsc_drake.geometry.shapes.fitted import Fitted
from pfsc_drake.geometry.shapes.paraboloid import Paraboloid
from pfsc_drake.geometry.shapes.plane import Plane
from pfsc_drake.geometry.shapes.polyhedron import Box
from pfsc_drake.geometry.shapes.profiles import Extruded, Revolved
from pfsc_drake.geometry.shapes.sphere import Sphere
from pfsc_drake.geometry.shapes.torus import Torus
from pfsc_drake.yaml.reading import TAG_KEY
from pfsc_drake.yaml.typed import load_typed


def _load(**data):
    return load_typed(RegionParameters, data, "here.yaml")


def test_a_region_by_default_is_above_a_plane():
    region = _load()
    assert type(region.shape) is Plane
    assert (region.inside, region.motion, region.stiffness) == (False, None, None)


def test_everything_that_can_be_said():
    region = _load(
        shape={TAG_KEY: "!Cylinder", "radius": 0.2, "origin": [0.9, 0.0, 0.7]},
        admissible="inside",
        motion={
            TAG_KEY: "!Turn",
            "axis": [0, 1, 0],
            "point": [1, 2, 3],
            "way": {TAG_KEY: "!Swinging", "amplitude": 20.0, "frequency": 0.5},
        },
        stiffness=5e3,
    )
    assert isinstance(region.shape, Cylinder)
    assert region.inside
    assert region.stiffness == 5e3
    assert region.motion == Turn([0, 1, 0], [1, 2, 3], Swinging(20.0, 0.5))
    shifted = _load(motion={TAG_KEY: "!Shift", "way": {"points": [0, 0.2], "repeat": False}})
    assert shifted.motion == Shift(way=Visiting([0, 0.2], repeat=False))


@pytest.mark.parametrize(
    ("shape", "has_inside"),
    [
        (Plane(), False),
        (Paraboloid(), True),
        (Cylinder(), True),
        (Cone(), True),
        (Sphere(), True),
        (Torus(), True),
        (Box(), True),
        (Fitted(), False),
        (Fitted(grid=[9, 9], closed=[True, False]), False),
        (Fitted(grid=[9, 9], closed=[True, True]), True),
        (Revolved(), False),
        (Revolved(closed=True), True),
        (Extruded(), False),
        (Extruded(closed=True), True),
    ],
)
def test_what_has_an_inside(shape, has_inside):
    assert shape.encloses is has_inside
    wrong = "above" if has_inside else "inside"
    with pytest.raises(InputError, match=f"admissible = {wrong}; .* !{type(shape).__name__}"):
        RegionParameters(shape, wrong)
    for word in ("", "outside" if has_inside else "above"):
        assert not RegionParameters(shape, word).inside


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            {"shape": {TAG_KEY: "!Box"}, "admissible": "inside"},
            "admissible = inside; allowed: outside of a !Box; for its inside a !Plane at each",
        ),
        (
            {"shape": {TAG_KEY: "!Sphere", "angles_deg": [0, 90]}},
            r"shape.angles_deg = \[0.0, 90.0\]; allowed: empty",
        ),
        (
            {"shape": {TAG_KEY: "!Box", "size": [0.1, 0.1, 0.0]}},
            r"size = \[0.1, 0.1, 0.0\]; allowed: 3 numbers from 0.0001 to",
        ),
        ({"stiffness": 0.0}, "stiffness = 0.0; allowed: 1 to 1e\\+06 N/m, or null"),
        (
            {"motion": {TAG_KEY: "!Shift", "direction": [0, 0, 0]}},
            r"motion\.direction = \[0.0, 0.0, 0.0\]; allowed: 3 numbers, not all zero",
        ),
        (
            {"motion": {TAG_KEY: "!Shift", "way": {"points": [0, 0.1]}}},
            r"motion\.way\.points = \[0.0, 0.1\]; allowed: the last as the first, with repeat",
        ),
        (
            {"motion": {TAG_KEY: "!Shift", "way": {"points": [0, 20, 0]}}},
            "way = 20.0; allowed: no further than 10 m",
        ),
        (
            {"motion": {TAG_KEY: "!Turn", "way": {TAG_KEY: "!Swinging", "amplitude": 400.0}}},
            "way = 400.0; allowed: no further than 360 deg",
        ),
        (
            {"motion": {TAG_KEY: "!Turn", "way": {TAG_KEY: "!Swinging", "frequency": 0.0}}},
            "frequency = 0.0; allowed: 0.0001 to 100 Hz",
        ),
    ],
)
def test_what_is_refused(data, message):
    with pytest.raises(InputError, match=message) as caught:
        _load(**data)
    assert "here.yaml" in str(caught.value)
