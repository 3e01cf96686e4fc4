"""Surfaces as scenarios give them, against their closed forms."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.scenario import SurfaceParameters
from diagrams.tasks.task_geometry import make_surface, make_surface_manifold
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.geometry.shapes.cone import Cone
from pfsc_drake.geometry.shapes.cylinder import Cylinder
from pfsc_drake.geometry.shapes.fitted import Fitted
from pfsc_drake.geometry.shapes.paraboloid import Paraboloid
from pfsc_drake.geometry.shapes.plane import Plane
from pfsc_drake.geometry.shapes.profiles import Extruded, Revolved
from pfsc_drake.geometry.shapes.shape import ShapeInputs
from pfsc_drake.geometry.shapes.sphere import Sphere
from pfsc_drake.geometry.shapes.tool_orientation import SurfaceOrientationParameters
from pfsc_drake.geometry.shapes.torus import Torus
from tests.experiments import scanned_panel as panel

# x of the surface's axes leans to y of the world, z points along x
PLACED = {"origin": [0.5, -0.2, 1.0], "axis": [2.0, 0.0, 0.0], "start": [0.3, 1.0, 0.0]}
AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def make(shape, law="rigid", folder=Path(), progress=None):
    return make_surface(shape, law, folder, progress).surface


def local(surface, theta):
    """Return points of a surface in the axes of PLACED, shape (n, 3)."""
    return (surface.partials(np.asarray(theta), 0)[..., 0, :] - PLACED["origin"]) @ AXES


def places(surface, count=7):
    ends = [np.linspace(*side, count) for side in surface.domain]
    return np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 2)


def circle(angle, height, radius):
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)


def csv(folder, header, rows, name="points.csv"):
    lines = [",".join(f"{value:.12g}" for value in row) for row in rows]
    (folder / name).write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return name


@pytest.mark.parametrize(
    ("shape", "closed_form"),
    [
        (Plane(**PLACED), lambda a, b: np.stack([a, b, 0 * a], -1)),
        (Paraboloid(**PLACED), lambda a, b: np.stack([a, b, a**2 + b**2], -1)),
        (Cylinder(**PLACED), lambda a, b: circle(a, b, 0.1)),
        (Cone(**PLACED), lambda a, b: circle(a, np.sqrt(0.75) * b, 0.5 * b)),
        (Sphere(**PLACED), lambda a, b: circle(a, 0.2 * np.sin(b), 0.2 * np.cos(b))),
        (Torus(**PLACED), lambda a, b: circle(a, 0.1 * np.sin(b), 0.3 + 0.1 * np.cos(b))),
    ],
    ids=lambda value: type(value).__name__,
)
def test_shapes_stand_where_they_are_placed(shape, closed_form):
    surface = make(shape)
    theta = places(surface)
    np.testing.assert_allclose(local(surface, theta), closed_form(*theta.T), atol=1e-12)


@pytest.mark.parametrize("shape", [Cylinder, Cone, Sphere, Torus])
def test_inward_turns_the_normal_and_a_part_is_open(shape):
    surface = make(shape(angles_deg=[30.0, 90.0], inward=True))
    assert surface.domain[0] == pytest.approx([np.pi / 6, np.pi / 2])
    assert not surface.closed[0]
    place = [np.mean(surface.domain[0]), surface.domain[1].begin + 0.01]
    position, first, second = surface.partials(np.array(place), 1)
    away = position * [1.0, 1.0, 0.0]
    assert np.cross(first, second) @ away < 0.0


def test_a_profile_that_turns(tmp_path):
    """A parabola r = 0.1 + h^2 is a polynomial, which splines reproduce."""
    h = np.linspace(-0.2, 0.3, 12)
    name = csv(tmp_path, "height,radius", np.column_stack([h, 0.1 + h**2]))
    surface = make(Revolved(file=name, **PLACED), "elastic", tmp_path)
    assert surface.closed == (True, False)
    assert surface.smoothness == 5
    points = local(surface, places(surface))
    radius = np.hypot(points[:, 0], points[:, 1])
    np.testing.assert_allclose(radius, 0.1 + points[:, 2] ** 2, atol=2e-6)
    ring = np.column_stack([0.3 + 0.1 * np.cos(a := np.arange(24) * np.pi / 12), 0.1 * np.sin(a)])
    name = csv(tmp_path, "radius,height", ring)
    torus = make(Revolved(file=name, closed=True), "rigid", tmp_path)
    assert torus.closed == (True, True)
    points = torus.partials(places(torus), 0)[:, 0]
    tube = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.3, points[:, 2])
    np.testing.assert_allclose(tube, 0.1, atol=1e-5)


def test_a_profile_that_is_moved(tmp_path):
    x = np.linspace(-0.2, 0.2, 15)
    name = csv(tmp_path, "x,y,z", np.column_stack([x, 0 * x, 0.5 * x**2]))
    shape = Extruded(file=name, direction=[0.0, 2.0, 0.0], length=0.4, **PLACED)
    surface = make(shape, "elastic", tmp_path)
    assert surface.domain[1] == pytest.approx([0.0, 0.4])
    theta = places(surface)
    points = local(surface, theta)
    np.testing.assert_allclose(points[:, 1], theta[:, 1], atol=1e-12)
    np.testing.assert_allclose(points[:, 2], 0.5 * points[:, 0] ** 2, atol=1e-7)


@pytest.mark.parametrize("law", RELATIVE_DEGREE)
def test_scattered_points_are_placed_and_as_smooth_as_the_law_needs(tmp_path, law):
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.1, 0.1, (2, 400))
    rows = 1e3 * np.column_stack([x, y, x**2 - y**2])
    name = csv(tmp_path, "x,y,z", rows)
    said = []
    shape = Fitted(file=name, unit="mm", along=[0.0, 1.0, 0.0], visible_from=[9.0, 0, 0], **PLACED)
    made = make_surface(shape, law, tmp_path, lambda fraction, phase: said.append(phase))
    assert made.surface.smoothness == max(2, RELATIVE_DEGREE[law] + 1)
    assert any("400 points" in phase for phase in said)
    points = local(made.surface, places(made.surface, 20))
    np.testing.assert_allclose(points[:, 2], points[:, 0] ** 2 - points[:, 1] ** 2, atol=1e-4)
    assert made.fit.rms < 1e-6
    _, first, second = made.surface.partials(np.zeros(2), 1)
    assert first @ [0.0, 1.0, 0.0] > 0.95
    assert np.cross(first, second) @ [1.0, 0.0, 0.0] > 0.0


def mesh():
    """Return vertices and triangles of z = 0.5 (x^2 - y^2) on a grid, shapes (n, 3), (k, 3)."""
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, 12), np.linspace(-0.2, 0.2, 16), indexing="ij")
    vertices = np.stack([x, y, 0.5 * (x**2 - y**2)], axis=-1).reshape(-1, 3)
    corners = np.arange(12 * 16).reshape(12, 16)[:-1, :-1].reshape(-1, 1)
    return vertices, np.vstack(
        [corners + np.array(offsets) for offsets in ([0, 16, 17], [0, 17, 1])]
    )


def write_obj(file):
    vertices, faces = mesh()
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*v) for v in vertices]
    lines += ["f {} {} {}".format(*f) for f in faces + 1]
    file.write_text("\n".join(lines), encoding="utf-8")


def write_ply(file):
    vertices, faces = mesh()
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = ["{:.9g} {:.9g} {:.9g}".format(*v) for v in vertices]
    rows += ["3 {} {} {}".format(*f) for f in faces]
    file.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")


def write_stl(file):
    vertices, faces = mesh()
    data = np.zeros(len(faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    data["corners"] = vertices[faces]
    file.write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + data.tobytes())


@pytest.mark.parametrize("write", [write_obj, write_ply, write_stl])
def test_vertices_of_meshes(tmp_path, write):
    file = tmp_path / f"part.{write.__name__[-3:]}"
    write(file)
    surface = make(Fitted(file=file.name), "elastic", tmp_path)
    points = surface.partials(places(surface), 0)[:, 0]
    np.testing.assert_allclose(
        points[:, 2], 0.5 * (points[:, 0] ** 2 - points[:, 1] ** 2), atol=1e-5
    )


@pytest.mark.parametrize("more", [{"interpolate": True}, {}, {"tolerance": 5e-4}])
def test_grids_of_points(tmp_path, more):
    a, h = np.meshgrid(np.arange(24) * np.pi / 12, np.linspace(0.0, 0.3, 12), indexing="ij")
    points = circle(a, h, 0.1 + 0.1 * h).reshape(-1, 3)
    noise = 0.0 if "interpolate" in more else 1e-4
    points += noise * np.random.default_rng(1).normal(size=points.shape)
    shape = Fitted(file=csv(tmp_path, "x,y,z", points), grid=[24, 12], closed=[True, False], **more)
    made = make_surface(shape, "elastic", tmp_path)
    assert made.surface.closed == (True, False)
    assert made.surface.smoothness == 5
    found = made.surface.partials(places(made.surface, 20), 0)[:, 0]
    off = np.hypot(found[:, 0], found[:, 1]) - 0.1 - 0.1 * found[:, 2]
    assert np.sqrt(np.mean(off**2)) < (1e-6 if not noise else 1e-4)
    assert (made.fit is None) == (not noise)
    if "tolerance" in more:
        assert made.fit.largest <= 5e-4


def test_the_shipped_scan_is_that_of_its_formula():
    shipped = Path(__file__).parents[3] / "experiments/scenarios/surfaces/scanned_panel.csv"
    assert shipped.read_text(encoding="utf-8") == panel.csv_text()
    scanned = panel.distance(panel.scan() + panel.ORIGIN)
    assert np.std(scanned) == pytest.approx(panel.NOISE, rel=0.05)


def test_a_cylinder_that_points_are_heights_over(tmp_path):
    rng = np.random.default_rng(2)
    a, h = rng.uniform(0.0, 2.0 * np.pi, 900), rng.uniform(0.0, 0.3, 900)
    centre = np.array([0.1, 0.0, 0.0])
    name = csv(tmp_path, "x,y,z", circle(a, h, np.full(900, 0.1)) + centre)
    for more in ({}, {"base_axis": [0.0, 0.0, 1.0], "base_point": centre.tolist()}):
        shape = Fitted(file=name, base="cylinder", **more)
        surface = make(shape, "rigid", tmp_path)
        assert surface.closed == (True, False)
        points = surface.partials(places(surface), 0)[:, 0] - centre
        np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 0.1, atol=1e-5)


def test_what_is_not_smooth_enough_is_refused_with_what_to_write(tmp_path):
    h = np.linspace(0.0, 0.3, 12)
    name = csv(tmp_path, "radius,height", np.column_stack([0.1 + 0.1 * h, h]))
    make(Revolved(file=name, smoothness=3), "rigid", tmp_path)
    with pytest.raises(InputError) as caught:
        make(Revolved(file=name, smoothness=3), "elastic", tmp_path)
    for part in ("C^3", "C^5", "'elastic'", "smoothness: 0"):
        assert part in str(caught.value)


@pytest.mark.parametrize(("convention", "axes"), [("zyx", "ZYX"), ("zyz", "ZYZ")])
def test_orientations(convention, axes):
    angles = [20.0, 130.0, -40.0]
    expected = Rotation.from_euler(axes, angles, degrees=True).as_matrix()
    said = SurfaceOrientationParameters("given", convention, angles)
    np.testing.assert_allclose(quaternion_to_matrix(said.quaternion), expected, atol=1e-14)
    manifold = make_surface_manifold(2, SurfaceParameters(Plane(), said))
    assert manifold.is_oriented
    said = SurfaceOrientationParameters("normal", convention, angles)
    assert said.quaternion is None
    assert make_surface_manifold(2, SurfaceParameters(Plane(), said)).is_oriented


def test_kinds_of_orientation_have_as_many_coordinates():
    counts = {}
    for kind in ("none", "given", "normal"):
        for task in ("full", "tool_axis"):
            said = SurfaceOrientationParameters(kind, task=task)
            manifold = make_surface_manifold(2, SurfaceParameters(Plane(), said))
            counts[kind, task] = len(manifold.coordinates)
    assert counts == {
        ("none", "full"): 3,
        ("none", "tool_axis"): 3,
        ("given", "full"): 6,
        ("given", "tool_axis"): 5,
        ("normal", "full"): 6,
        ("normal", "tool_axis"): 5,
    }


@pytest.mark.slow
def test_a_bridged_hole_is_reported(tmp_path):
    rng = np.random.default_rng(8)
    points = np.column_stack([rng.uniform(0.0, 0.3, (1500, 2)), np.zeros(1500)])
    points += 1e-5 * rng.normal(size=points.shape)
    left = points[np.linalg.norm(points[:, :2] - [0.2, 0.1], axis=1) > 0.025]
    made = {}
    for name, rows in {"whole": points, "holed": left}.items():
        text = "\n".join(",".join(map(repr, row)) for row in rows.tolist())
        (tmp_path / f"{name}.csv").write_text(f"x,y,z\n{text}\n")
        shape = Fitted(file=f"{name}.csv", largest_hole=0.05, visible_from=[0.1, 0.1, 1.0])
        made[name] = shape.surface(ShapeInputs(tmp_path, 3)).notes
    assert made["whole"] == ()
    (note,) = made["holed"]
    assert re.search(r"holed\.csv: no point within 2[3456].* mm of \[0\.(19|2).*, 0\.(09|1)", note)


def test_the_side_of_the_normal_is_reported_by_default(tmp_path):
    """An inclined plane: upwards, along the normal."""
    rng = np.random.default_rng(3)
    flat = np.column_stack([rng.uniform(0.0, 0.3, (900, 2)), 1e-5 * rng.normal(size=900)])
    R = Rotation.from_euler("xyz", [2.6, 0.3, 0.4]).as_matrix()
    text = "\n".join(",".join(map(repr, row)) for row in (flat @ R.T).tolist())
    (tmp_path / "scan.csv").write_text(f"x,y,z\n{text}\n")
    (note,) = Fitted(file="scan.csv").surface(ShapeInputs(tmp_path, 3)).notes
    said = re.search(
        r"scan\.csv: the normal .* to \[(.*)\] in its middle, as no visible_from", note
    )
    normal = np.array([float(value) for value in said[1].split(",")])
    np.testing.assert_allclose(normal, -R[:, 2], atol=2e-3)
    assert normal[2] > 0.5
