"""Paths of a scenario."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.scenario import (
    BentLemniscate,
    Circle,
    Keyframe,
    Line,
    OrientationParameters,
    PathParameters,
    Waypoints,
)
from diagrams.tasks.task_geometry import followed_angles, make_path, require_orientation
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import shape_report
from pfsc_drake.geometry.paths.path_warnings import path_warnings
from pfsc_drake.geometry.shapes.tool_orientation import SurfaceOrientationParameters

# an arc of a helix, radius 0.3 m, with the tool tilted more and more
ANGLE = np.linspace(0.0, 2.0, 9)
POSITIONS = np.stack([0.3 * np.cos(ANGLE), 0.3 * np.sin(ANGLE), 0.1 * ANGLE], axis=1)
ZYX = np.stack([0.1 * ANGLE, 0.2 * ANGLE, np.full(9, 0.3)], axis=1)


def write_csv(folder, columns, rows, name="points.csv"):
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows.tolist())]
    (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return name


def make(shape, keyframes=(), law="elastic", folder=None, convention="zyx", task="full"):
    orientation = OrientationParameters(convention, list(keyframes), task)
    return make_path(PathParameters(shape, orientation), law, folder)


def positions(path, theta):
    return path.position.derivatives(theta, 0)[:, 0]


def test_line():
    path = make(Line([0.1, 0.2, 0.3], [0.1, 0.2, 0.9]))
    assert not path.closed
    assert path.length == pytest.approx(0.6, abs=1e-12)
    expected = [[0.1, 0.2, 0.3 + s] for s in (0.0, 0.25, 0.6)]
    np.testing.assert_allclose([path.pose(s)[0] for s in (0.0, 0.25, 0.6)], expected, atol=1e-12)


def test_circle():
    shape = Circle([0.5, 0.1, 1.0], 0.2, axis_u=[0.0, 2.0, 0.0], axis_v=[0.0, 1.0, 3.0])
    path = make(shape)
    assert path.closed
    assert path.length == pytest.approx(2.0 * math.pi * 0.2, abs=1e-10)
    theta = np.linspace(0.0, 6.0, 7)
    y, z = np.cos(theta), np.sin(theta)
    expected = [0.5, 0.1, 1.0] + 0.2 * np.stack([0.0 * y, y, z], axis=1)
    np.testing.assert_allclose(positions(path, theta), expected, atol=1e-14)


def test_bent_lemniscate():
    path = make(BentLemniscate())
    assert path.closed
    theta = np.linspace(0.0, 6.0, 13)
    c, s = np.cos(theta), np.sin(theta)
    expected = np.stack([0.7 + 0.25 * c, 0.2 + 0.25 * s * c, 1.103 + 0.1 * s**2], axis=1)
    np.testing.assert_allclose(positions(path, theta), expected, atol=1e-14)
    chords = np.diff(positions(path, np.linspace(0.0, 2.0 * math.pi, 200_001)), axis=0)
    assert path.length == pytest.approx(np.linalg.norm(chords, axis=1).sum(), rel=1e-8)


@pytest.mark.parametrize("parametrization", ["chord", "centripetal"])
def test_waypoints_are_visited(tmp_path, parametrization):
    folder = tmp_path / "mine"
    folder.mkdir()
    file = write_csv(folder, ["x", "y", "z"], POSITIONS)
    shape = Waypoints(f"mine/{file}", parametrization=parametrization)
    path = make(shape, folder=tmp_path)
    assert not path.closed
    assert path.orientation is None
    distance = [np.linalg.norm(positions(path, [path.nearest(p)]) - p)
                for p in POSITIONS]  # fmt: skip
    assert max(distance) < 1e-12
    # a helix between its waypoints, too
    radius = np.linalg.norm(positions(path, np.linspace(*path.position.domain, 100))[:, :2], axis=1)
    np.testing.assert_allclose(radius, 0.3, atol=1e-4)


def test_closed_waypoints(tmp_path):
    angle = np.arange(8) * math.pi / 4
    points = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    write_csv(tmp_path, ["x", "y", "z"], points)
    path = make(Waypoints("points.csv", closed=True), folder=tmp_path)
    assert path.closed
    assert path.length == pytest.approx(2.0 * math.pi, rel=1e-3)


@pytest.mark.parametrize(
    ("law", "smoothness"), [("rigid", 3), ("visco_elastic", 4), ("elastic", 5)]
)
def test_splines_are_as_smooth_as_the_law_needs(tmp_path, law, smoothness):
    write_csv(tmp_path, ["x", "y", "z"], POSITIONS)
    assert RELATIVE_DEGREE[law] + 1 == smoothness
    path = make(Waypoints("points.csv"), law=law, folder=tmp_path)
    assert path.position.smoothness == smoothness
    smoother = make(Waypoints("points.csv", smoothness=6), law=law, folder=tmp_path)
    assert smoother.position.smoothness == 6
    with pytest.raises(InputError) as caught:
        make(Waypoints("points.csv", smoothness=2), law=law, folder=tmp_path)
    for part in ("C^2", f"C^{smoothness}", f"'{law}'", "theta = "):
        assert part in str(caught.value)


def test_no_keyframes_no_orientation():
    assert make(Line()).orientation is None


def test_one_keyframe_is_kept_everywhere():
    path = make(BentLemniscate(), [Keyframe(0.4, [30.0, 20.0, 10.0])])
    expected = Rotation.from_euler("ZYX", [30.0, 20.0, 10.0], degrees=True).as_matrix()
    for theta in (-1.0, 0.0, 2.0, 9.0):
        np.testing.assert_allclose(path.orientation.rotation_matrix(theta), expected, atol=1e-14)


@pytest.mark.parametrize(("convention", "axes"), [("zyx", "ZYX"), ("zyz", "ZYZ")])
def test_keyframes_are_visited(convention, axes):
    thetas = [0.0, 0.2, 0.5, 0.6, 1.0]
    angles = np.array([[10.0, 40, -20], [60, 50, 0], [90, 70, 30], [80, 60, 90], [20, 50, 120]])
    keyframes = [Keyframe(t, a.tolist()) for t, a in zip(thetas, angles, strict=True)]
    path = make(Line([0, 0, 0], [0, 3, 0]), keyframes, convention=convention)
    expected = Rotation.from_euler(axes, angles, degrees=True).as_matrix()
    reached = [path.pose(3.0 * t)[1] for t in thetas]  # theta is a fraction of the domain
    np.testing.assert_allclose(reached, expected, atol=1e-12)


def test_on_a_closed_path_the_first_keyframe_stands_for_the_end():
    angles = [[170.0, 0.0, 0.0], [190.0, 20.0, 0.0], [200.0, 0.0, 20.0], [180.0, -10.0, 0.0]]
    keyframes = [Keyframe(0.25 * i, a) for i, a in enumerate(angles)]
    path = make(Circle(), keyframes)
    expected = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    reached = path.orientation.rotation_matrix(0.5 * math.pi * np.arange(9))
    np.testing.assert_allclose(reached, expected[[0, 1, 2, 3, 0, 1, 2, 3, 0]], atol=1e-12)
    # smooth over the seam, as the law needs
    before, after = (path.orientation.derivatives(x, 4) for x in (-1e-9, 1e-9))
    np.testing.assert_allclose(before, after, atol=1e-5)


@pytest.mark.parametrize("thetas", [(0.1, 0.5, 1.0), (0.0, 0.5, 0.9)])
def test_keyframes_must_cover_an_open_path(thetas):
    keyframes = [Keyframe(t, [0.0, 0.0, 10.0 * t]) for t in thetas]
    with pytest.raises(InputError) as caught:
        make(Line(), keyframes)
    assert f"{thetas[0]:g} to {thetas[-1]:g}; allowed: from 0 to 1" in str(caught.value)


def test_keyframes_must_increase():
    keyframes = [Keyframe(t, [0.0, 0.0, 10.0 * t]) for t in (0.0, 0.6, 0.5, 1.0)]
    with pytest.raises(InputError, match="strictly increase"):
        make(Line(), keyframes)


def test_orientation_of_waypoints_or_keyframes(tmp_path):
    columns = ["x", "y", "z", "zyx_1", "zyx_2", "zyx_3"]
    write_csv(tmp_path, columns, np.hstack([POSITIONS, ZYX]))
    path = make(Waypoints("points.csv"), folder=tmp_path)
    thetas = [path.nearest(p) for p in POSITIONS]
    expected = Rotation.from_euler("ZYX", ZYX).as_matrix()
    np.testing.assert_allclose(path.orientation.rotation_matrix(thetas), expected, atol=1e-9)
    keyframe = Keyframe(0.0, [90.0, 0.0, 0.0])
    with pytest.raises(InputError, match=r"keyframes: 1 given, and points\.csv has columns .* too"):
        make(Waypoints("points.csv"), [keyframe], folder=tmp_path)
    write_csv(tmp_path, columns[:3], POSITIONS)
    other = make(Waypoints("points.csv"), [keyframe], folder=tmp_path)
    expected = Rotation.from_euler("ZYX", [90, 0, 0], degrees=True).as_matrix()
    np.testing.assert_allclose(other.orientation.rotation_matrix(0.2), expected, atol=1e-14)
    np.testing.assert_array_equal(other.position.breakpoints, path.position.breakpoints)
    np.testing.assert_array_equal(other.waypoints.positions, POSITIONS)


@pytest.mark.parametrize(("law", "smoothness"), [("rigid", 3), ("elastic", 5)])
def test_a_tolerance_smooths_noisy_waypoints(tmp_path, law, smoothness):
    angle = np.linspace(0.0, 2.0, 600)
    helix = np.stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.1 * angle], axis=1)
    zyx = np.rad2deg(np.stack([0.1 * angle, 0.2 * angle, 0.0 * angle], axis=1))
    rng = np.random.default_rng(1)
    noise = np.array([2e-4] * 3 + [0.05] * 3)
    rows = np.hstack([helix, zyx]) + noise * rng.normal(size=(600, 6))
    columns = ["x", "y", "z", "zyx_deg_1", "zyx_deg_2", "zyx_deg_3"]
    write_csv(tmp_path, columns, rows)
    shape = Waypoints("points.csv", tolerance=1e-3, tolerance_deg=0.3)
    path = make(shape, law=law, folder=tmp_path)
    assert path.position.smoothness == smoothness
    at_points = positions(path, path.waypoints.parameters)
    assert np.linalg.norm(at_points - rows[:, :3], axis=1).max() <= 1e-3
    turned = Rotation.from_matrix(path.orientation.rotation_matrix(path.waypoints.parameters))
    taught = Rotation.from_euler("ZYX", rows[:, 3:], degrees=True)
    assert np.rad2deg((turned.inv() * taught).magnitude()).max() <= 0.3
    shape = shape_report(path)
    # of a helix: (r^2 + h^2) / r
    assert shape.smallest_radius == pytest.approx(0.1 / 0.3, rel=0.1)


def test_corners_are_rounded(tmp_path):
    corners = np.array([[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0], [0.0, 0.1, 0.0]])
    zyx = np.array([[0.0, 0, 0], [30, 0, 0], [90, 0, 0], [0, 0, 0]])
    columns = ["x", "y", "z", "zyx_deg_1", "zyx_deg_2", "zyx_deg_3"]
    write_csv(tmp_path, columns, np.hstack([corners, zyx]))
    path = make(Waypoints("points.csv", closed=True, corner_distance=0.02), folder=tmp_path)
    assert (path.position.smoothness, path.orientation.smoothness) == (5, 5)
    middles = [0.1, 0.25, 0.4, 0.55]
    np.testing.assert_allclose(
        positions(path, middles), (corners + np.roll(corners, -1, 0)) / 2, atol=1e-14
    )
    turn = Rotation.from_matrix(path.orientation.rotation_matrix(middles)).as_euler("ZYX", True)
    np.testing.assert_allclose(turn[:, 0], [15.0, 60.0, 45.0, 0.0], atol=1e-9)
    assert shape_report(path).distance_from_polygon < 0.01


@pytest.mark.parametrize(
    ("keys", "parts"),
    [
        ({"tolerance": -1.0}, ("tolerance = -1.0", "0, or 1e-07 to 10000 m")),
        ({"tolerance": math.nan}, ("tolerance = nan",)),
        ({"tolerance_deg": 0.0}, ("tolerance_deg = 0.0", "90 deg")),
        ({"tolerance": 1e-3, "corner_distance": 0.1}, ("corner_distance = 0.1", "tolerance")),
        ({"corner_distance": 1e300}, ("corner_distance = 1e+300",)),
    ],
)
def test_options_of_waypoints(keys, parts):
    with pytest.raises(InputError) as caught:
        Waypoints("points.csv", **keys)
    assert all(part in str(caught.value) for part in parts)


@pytest.mark.parametrize("key", ["tolerance", "corner_distance"])
def test_a_column_theta_leaves_no_choice(tmp_path, key):
    rows = np.hstack([ANGLE[:, None], POSITIONS])
    write_csv(tmp_path, ["theta", "x", "y", "z"], rows)
    with pytest.raises(InputError, match=f"column theta; path.shape.{key} makes its own"):
        make(Waypoints("points.csv", **{key: 1e-3}), folder=tmp_path)


@pytest.mark.parametrize(
    ("make_shape", "part"),
    [
        (lambda: Circle(radius=1e300), "radius = 1e+300; allowed: 0.0001 to 10000 m"),
        (lambda: Circle(radius=1e-300), "radius = 1e-300"),
        (lambda: Circle(center=[1e300, 0, 0]), "center = [1e+300, 0, 0]"),
        (lambda: Line([0, 0, 0], [0, 0, 1e-300]), "distance of start and end = 1e-300"),
        (lambda: Line([-1e300, 0, 0], [0, 0, 1.0]), "start = [-1e+300, 0, 0]"),
        (lambda: OrientationParameters("zyx", [Keyframe(0, [1e300, 0, 0])]), "at most 3600 deg"),
        (lambda: OrientationParameters("zyx", [Keyframe(30.0)]), "theta = 30.0; allowed: 0 to 1"),
    ],
)
def test_lengths_and_angles_beyond_all_robots(make_shape, part):
    with pytest.raises(InputError) as caught:
        make_shape()
    assert part in str(caught.value)


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 0.05, 179.95, 180.0])
def test_axes_of_a_circle_that_span_no_plane(tilt):
    axis = [1e200 * math.cos(math.radians(tilt)), 1e200 * math.sin(math.radians(tilt)), 0.0]
    angle = min(tilt, 180.0 - tilt)
    with pytest.raises(InputError, match=r"deg between them; at least 0\.1 deg") as caught:
        make(Circle(axis_u=[1.0, 0.0, 0.0], axis_v=axis))
    assert float(str(caught.value).split(" deg")[0].split()[-1]) == pytest.approx(angle, abs=1e-6)


@pytest.mark.filterwarnings("error")
def test_axes_of_a_circle_may_have_any_length():
    path = make(Circle(axis_u=[0.0, 1e300, 0.0], axis_v=[0.0, 1e-300, 1e-300]))
    assert path.length == pytest.approx(0.3 * math.pi)


@pytest.mark.parametrize(
    ("num_joints", "task", "said"),
    [
        (
            2,
            "full",
            r"path: 2 joints for 6 outputs \(position and .*\); allowed: 3 joints or more$",
        ),
        (3, "full", r"3 joints for 6 outputs.*; allowed: [a-z.]+task: none \(position only\)$"),
        (4, "full", r"4 joints for 6 outputs [^_]*task: yaw \(.*\) or none \(position only\)$"),
        (
            5,
            "full",
            r"5 joints for 6 outputs.*task: tool_axis \(.*\) or yaw \(.*\) or none \(.*\)$",
        ),
        (
            4,
            "tool_axis",
            r"4 joints for 5 outputs \(.* direction of .*task: yaw \(.*\) or none \(.*\)$",
        ),
        (2, "none", r"path: 2 joints for 3 outputs \(position only\); allowed: 3 joints or more$"),
    ],
)
def test_too_few_joints_for_the_path(num_joints, task, said):
    path = make(Line(), [Keyframe()], task=task)
    with pytest.raises(InputError, match=said):
        require_orientation(path, task, num_joints)
    for enough in (6, 7):
        require_orientation(path, task, enough)


@pytest.mark.parametrize("num_joints", [4, 5, 6, 7])
def test_no_orientation_is_lost_unknowingly(num_joints):
    path = make(Line())
    require_orientation(path, "none", num_joints)
    require_orientation(path, "full", 3)
    with pytest.raises(InputError) as caught:
        require_orientation(path, "full", num_joints)
    parts = ["give the orientation too: path.orientation.keyframes: [{angles_deg", "task: none"]
    if num_joints != 6:
        parts.append(f"hold {num_joints - 3}")
    assert all(part in str(caught.value) for part in parts)


def test_what_is_no_task_is_dropped(tmp_path):
    columns = ["x", "y", "z", "zyx_1", "zyx_2", "zyx_3"]
    write_csv(tmp_path, columns, np.hstack([POSITIONS, ZYX]))
    path = make(Waypoints("points.csv"), folder=tmp_path, task="none")
    assert path.orientation is None
    np.testing.assert_array_equal(path.waypoints.positions, POSITIONS)
    # which nothing needs to be smooth
    fast = [Keyframe(0.0, [0.0, 0.0, 0.0]), Keyframe(1.0, [90.0, 0.0, 0.0])]
    assert make(Line(), fast, task="none").orientation is None
    assert make(Line(), fast, task="tool_axis").orientation is not None
    with pytest.raises(InputError, match=r"tool_axis: the path has no orientation; give the"):
        make(Line(), task="tool_axis")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"task": "axis"}, "task = axis; allowed: full, tool_axis, yaw, none"),
        ({"tool_axis": [0.0, 0.0, 0.0]}, "tool_axis = [0.0, 0.0, 0.0]; allowed: 3 numbers, not"),
        ({"tool_axis": [0.0, 1.0]}, "tool_axis = [0.0, 1.0]; allowed: 3 numbers, not all"),
        ({"tool_axis": [0.0, 1.0, math.inf]}, "tool_axis = [0.0, 1.0, inf]"),
    ],
)
def test_tasks_of_the_orientation(keys, said):
    with pytest.raises(InputError) as caught:
        OrientationParameters(**keys)
    assert said in str(caught.value)


def test_the_axis_alone_where_it_alone_matters():
    axes = followed_angles(OrientationParameters(tool_axis=[1.0, 0.0, 0.0]))
    assert axes == {"euler": None, "tool_axis": None, "yaw_axis": None}
    for task, other in {"tool_axis": "yaw", "yaw": "tool_axis"}.items():
        name, none = f"{task.removesuffix('_axis')}_axis", f"{other.removesuffix('_axis')}_axis"
        axes = followed_angles(OrientationParameters(task=task, **{name: [0.0, -3e200, 4e200]}))
        np.testing.assert_allclose(axes[name], [0.0, -0.6, 0.8], rtol=1e-15)
        assert axes[none] is None


def test_too_few_points_may_be_corners(tmp_path):
    file = write_csv(tmp_path, "xyz", POSITIONS[:4])
    with pytest.raises(InputError, match=rf"{file}, or write path\.shape\.corner_distance"):
        make(Waypoints(file), law="rigid", folder=tmp_path)
    make(Waypoints(file, corner_distance=0.01), law="rigid", folder=tmp_path)


@pytest.mark.slow
def test_noise_in_millimetres_is_one_of_the_unit(tmp_path):
    rng = np.random.default_rng(0)
    line = np.linspace([300.0, 0.0, 0.0], [500.0, 0.0, 0.0], 300)
    file = write_csv(tmp_path, "xyz", line + rng.normal(0.0, 0.2, line.shape))
    with pytest.raises(InputError, match=r"tolerance = 0\.001 m.*if they are in mm write unit: mm"):
        make(Waypoints(file, tolerance=1e-3), law="rigid", folder=tmp_path)


def test_euler_angles_of_the_tool_are_of_the_scenarios_convention():
    said = OrientationParameters("zyz", jacobian="analytic")
    assert followed_angles(said) == {"euler": "zyz", "tool_axis": None, "yaw_axis": None}
    surface = SurfaceOrientationParameters(kind="given", jacobian="analytic")
    assert followed_angles(surface)["euler"] == "zyx"


@pytest.mark.parametrize("task", ["tool_axis", "yaw", "none"])
def test_the_analytic_jacobian_is_one_of_the_whole_orientation(task):
    with pytest.raises(InputError, match=rf"jacobian = analytic.*geometric with task: {task}"):
        OrientationParameters(task=task, jacobian="analytic")
    if task != "none":
        with pytest.raises(InputError, match=rf"jacobian = analytic.*with task: {task}"):
            SurfaceOrientationParameters(kind="given", task=task, jacobian="analytic")


def test_the_analytic_jacobian_needs_an_orientation():
    with pytest.raises(InputError, match="jacobian = exact; allowed: geometric, analytic"):
        OrientationParameters(jacobian="exact")
    with pytest.raises(InputError, match=r"jacobian = analytic.*geometric with kind: none"):
        SurfaceOrientationParameters(jacobian="analytic")
    parameters = PathParameters(Circle(), OrientationParameters(jacobian="analytic"))
    with pytest.raises(InputError, match=r"jacobian = analytic: the path has no orientation; give"):
        make_path(parameters, "rigid", None)


def test_yaw_alone_turns_the_tilt_of_a_keyframe(tmp_path):
    """About the axis of the task, which is not the vertical."""
    write_csv(tmp_path, ["x", "y", "z", "yaw"], np.hstack([POSITIONS, ANGLE[:, None]]))
    axis, tilt = np.array([0.0, 0.6, 0.8]), Keyframe(0.0, [20.0, 0.0, 170.0])
    orientation = OrientationParameters("zyx", [tilt], "yaw", yaw_axis=(2.0 * axis).tolist())
    parameters = PathParameters(Waypoints("points.csv"), orientation)
    path = make_path(parameters, "rigid", tmp_path)
    found = path.orientation.rotation_matrix(path.waypoints.parameters)
    expected = Rotation.from_rotvec(ANGLE[:, None] * axis) * Rotation.from_euler(
        "ZYX", tilt.angles_deg, degrees=True
    )
    np.testing.assert_allclose(found, expected.as_matrix(), atol=1e-9)
    with pytest.raises(InputError, match=r"points\.csv: column yaw alone, with .*task = full"):
        make(Waypoints("points.csv"), folder=tmp_path)
    with pytest.raises(InputError, match=r"keyframes: 2 given, and points\.csv has"):
        make(Waypoints("points.csv"), [tilt, tilt], folder=tmp_path, task="yaw")


def test_units_and_notes_of_a_waypoint_file(tmp_path):
    write_csv(tmp_path, ["x", "y", "z", "stamp"], np.hstack([1e3 * POSITIONS, ANGLE[:, None]]))
    path = make(Waypoints("points.csv", unit="mm"), folder=tmp_path, task="none")
    np.testing.assert_allclose(path.waypoints.positions, POSITIONS, atol=1e-15)
    (note,) = path.notes
    assert "points.csv: column 'stamp' ignored" in note
    assert note in path_warnings(path, shape_report(path))


def test_two_waypoints_are_a_line(tmp_path):
    write_csv(tmp_path, ["x", "y", "z"], POSITIONS[[0, 3]])
    said = r"points\.csv: waypoints: 2 distinct .*: !Line \{start: \[0\.3, 0\.0, 0\.0\], end: \["
    with pytest.raises(InputError, match=said):
        make(Waypoints("points.csv"), folder=tmp_path)


def test_rows_that_coincide_are_counted_from_one_and_the_file_is_named(tmp_path):
    rows = np.hstack([POSITIONS, ZYX])
    rows[4, :3] = rows[3, :3]
    write_csv(tmp_path, ["x", "y", "z", "zyx_1", "zyx_2", "zyx_3"], rows)
    with pytest.raises(InputError, match=r"points\.csv: waypoints: 4 and 5 coincide"):
        make(Waypoints("points.csv"), folder=tmp_path)
