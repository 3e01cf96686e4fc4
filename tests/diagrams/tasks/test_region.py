"""Regions as scenarios give them, against the surfaces that they are given by."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.scenario.region_motion import Shift, Swinging, Turn, Visiting
from diagrams.scenario.virtual_fixtures import RegionParameters
from diagrams.tasks.regions_and_guides import make_region
from diagrams.tasks.task_geometry import make_surface
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

PLACED = {"origin": [0.5, -0.2, 1.0], "axis": [2.0, 0.0, 0.3], "start": [0.3, 1.0, 0.0]}
BESIDE = 3e-3


def make(shape, admissible="", folder=Path(), **more):
    return make_region(RegionParameters(shape, admissible, **more), folder)


def csv(folder, header, rows, name="points.csv"):
    lines = [",".join(f"{value:.12g}" for value in row) for row in rows]
    (folder / name).write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return name


def beside(surface):
    """Points on both sides of a surface, within its border, and its normals, [n, 3] each."""
    ends = [
        np.linspace(e.begin + 0.1 * e.length, e.end - 0.13 * e.length, 6) for e in surface.domain
    ]
    theta = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 2)
    position, first, second = np.moveaxis(surface.partials(theta, 1), -2, 0)
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return position, normal


def assert_bounds(region, surface, sign):
    """The region begins at the surface, to the side of its normal or to the other one."""
    for position, normal in zip(*beside(surface), strict=True):
        for height in (BESIDE, -BESIDE):
            h, *n = region.distance(*(position + height * normal).tolist())
            assert h == pytest.approx(sign * height, abs=1e-9)
            assert n == pytest.approx(sign * normal, abs=1e-6)


@pytest.mark.parametrize("inward", [False, True])
@pytest.mark.parametrize("kind", [Cylinder, Cone, Sphere, Torus])
@pytest.mark.parametrize(("admissible", "sign"), [("inside", -1.0), ("outside", 1.0), ("", 1.0)])
def test_round_shapes_have_an_inside(kind, inward, admissible, sign):
    """Wherever their normals point."""
    shape = kind(**PLACED, inward=inward)
    surface = make_surface(kind(**PLACED), "rigid", Path()).surface
    assert_bounds(make(shape, admissible), surface, sign)


@pytest.mark.parametrize("coefficient", [-3.0, 3.0])
@pytest.mark.parametrize(("admissible", "sign"), [("inside", 1.0), ("outside", -1.0)])
def test_a_paraboloid(coefficient, admissible, sign):
    """Its normal points along the axis, which is inside where that is hollow."""
    shape = Paraboloid(**PLACED, coefficient=coefficient)
    surface = make_surface(shape, "rigid", Path()).surface
    assert_bounds(make(shape, admissible), surface, sign * np.sign(coefficient))


@pytest.mark.slow(but=["below--1.0", "-1.0"])
@pytest.mark.parametrize(("admissible", "sign"), [("above", 1.0), ("below", -1.0), ("", 1.0)])
def test_what_is_open_has_an_upper_side(tmp_path, admissible, sign):
    """Also beyond the ends of what is extruded or turned."""
    x = np.linspace(-0.3, 0.3, 14)
    wave = np.column_stack([x, 0.2 * x, 0.03 * np.sin(8.0 * x)])
    bell = np.column_stack([0.05 + x + 0.3, -2.0 * x**2])
    x, y = (axis.ravel() for axis in np.meshgrid(x, x, indexing="ij"))
    hills = np.column_stack([x, y, 0.02 * np.sin(8.0 * x) * np.cos(6.0 * y)])
    files = {
        "wave": csv(tmp_path, "x,y,z", wave, "wave.csv"),
        "bell": csv(tmp_path, "radius,height", bell, "bell.csv"),
        "hills": csv(tmp_path, "x,y,z", hills, "hills.csv"),
    }
    extruded = {"file": files["wave"], "direction": [0.1, 1.0, 0.2]}
    for shape, longer in [
        (Plane(**PLACED), Plane(**PLACED, first=[-2.0, 2.0])),
        (Extruded(**PLACED, **extruded), Extruded(**PLACED, **extruded, length=2.0)),
        (Revolved(**PLACED, file=files["bell"]), None),
        (Revolved(**PLACED, file=files["bell"], inward=True), None),
        (
            Fitted(**PLACED, file=files["hills"], grid=[14, 14], interpolate=True, smoothness=2),
            None,
        ),
    ]:
        surface = make_surface(longer or shape, "velocity_servo", tmp_path).surface
        assert_bounds(make(shape, admissible, tmp_path), surface, sign)


@pytest.mark.slow(but="outside-1.0-False")
@pytest.mark.parametrize(
    ("admissible", "sign", "clockwise"),
    [("inside", -1.0, False), ("outside", 1.0, True), ("outside", 1.0, False)],
)
def test_closed_profiles_and_fits_have_an_inside(tmp_path, admissible, sign, clockwise):
    t = np.linspace(0.0, 2.0 * np.pi, 17)[:-1] * (-1.0 if clockwise else 1.0)
    ring = np.column_stack([0.3 + 0.1 * np.cos(t), 0.08 * np.sin(t) + 0.02 * np.cos(2.0 * t)])
    s = np.linspace(0.0, 2.0 * np.pi, 17)[:-1][:, None]
    doughnut = np.stack(
        [ring[:, 0] * np.cos(s), ring[:, 0] * np.sin(s), ring[:, 1] + 0.0 * s], axis=-1
    ).reshape(-1, 3)
    files = {
        "ring": csv(tmp_path, "radius,height", ring, "ring.csv"),
        "oval": csv(tmp_path, "x,y,z", np.column_stack([ring, 0.1 * ring[:, 0]]), "oval.csv"),
        "doughnut": csv(tmp_path, "x,y,z", doughnut, "doughnut.csv"),
    }
    for shape in [
        Revolved(**PLACED, file=files["ring"], closed=True),
        Extruded(**PLACED, file=files["oval"], closed=True),
        Fitted(
            **PLACED,
            file=files["doughnut"],
            grid=[16, 16],
            interpolate=True,
            smoothness=2,
            closed=[True, True],
        ),
    ]:
        surface = make_surface(shape, "velocity_servo", tmp_path).surface
        assert_bounds(make(shape, admissible, tmp_path), surface, -sign if clockwise else sign)


def test_a_box_stands_where_it_is_placed():
    region = make(
        Box(origin=[0.5, -0.2, 1.0], axis=[2, 0, 0], start=[0, 1, 0], size=[0.2, 0.4, 0.6])
    )
    # its first axis is y, its third is x
    for point, h in [((0.9, -0.2, 1.0), 0.1), ((0.5, 0.0, 1.0), 0.1), ((0.5, -0.2, 1.3), 0.1)]:
        assert region.distance(*point)[0] == pytest.approx(h, abs=1e-12)


def test_regions_move():
    plane = {"origin": [0.0, 0.0, 0.2]}
    shifted = make(Plane(**plane), motion=Shift([0, 0, 2.0], Visiting([0.0, 0.1, 0.0], dwell=0.5)))
    highest = [shifted.distance_at(0.0, 0.0, 0.5, float(s))[0] for s in np.linspace(0.0, 9.0, 4001)]
    assert highest[0] == pytest.approx(0.3)
    assert min(highest) == pytest.approx(0.2, abs=1e-12)
    assert shifted.largest_speed((0, 0, 0), 1.0) == pytest.approx(0.05)
    period = 2.0 * (0.1 / 0.05 + 35.0 / 16.0 * 0.05 / 0.5) + 3.0 * 0.5
    for clock in (0.7, 2.0, 4.0):
        expected = shifted.distance_at(0.1, 0.2, 0.5, clock)
        assert shifted.distance_at(0.1, 0.2, 0.5, clock + period) == pytest.approx(expected)
    turned = make(
        Plane(), motion=Turn([0, 1, 0], [0, 0, 0], Swinging(30.0, 0.25, begin=0.0, ramp=0.5))
    )
    # a quarter of the period: the normal leans by 30 deg to x
    assert turned.distance_at(1.0, 0.0, 0.0, 1.0)[0] == pytest.approx(0.5, abs=1e-12)


def test_files_that_make_no_region(tmp_path):
    with pytest.raises(InputError, match="file: none"):
        make(Fitted())
    horseshoe = [[-0.2, 0.0, 0.0], [-0.5, 0.5, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 0.0], [0.2, 0, 0]]
    shape = Extruded(file=csv(tmp_path, "x,y,z", horseshoe))
    with pytest.raises(InputError, match=r"points.csv: profile: its ends, extended straight, meet"):
        make(shape, folder=tmp_path)
