"""The task of surface following: start, tool positions, refusals."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import SurfaceParameters
from diagrams.scenario.motion import ReferenceParameters, SecondReference, StartParameters
from diagrams.scenario_task import check_joints, make_task
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.geometry.shapes.cylinder import Cylinder
from pfsc_drake.geometry.shapes.paraboloid import Paraboloid
from pfsc_drake.geometry.shapes.plane import Plane
from pfsc_drake.geometry.shapes.profiles import Extruded
from pfsc_drake.geometry.shapes.tool_orientation import SurfaceOrientationParameters

DISH = Paraboloid(origin=[0.8, 0.0, 1.0])


@pytest.fixture(name="scenario")
def fixture_scenario(load_scenario):
    """Return six axes on a surface, with a start and a reference."""

    def make(shape=DISH, kind="none", name="sfc_elastic_6r", **start):
        settings = load_scenario(name)
        settings.surface = SurfaceParameters(shape, SurfaceOrientationParameters(kind))
        settings.start = StartParameters(**start)
        settings.reference = ReferenceParameters(places=[[0.0, 0.0], [0.1, 0.05]])
        return settings

    return make


@pytest.fixture(name="task")
def fixture_task(scenario):
    return lambda *args, **more: make_task(scenario(*args, **more), Path())


def refusal(call, *parts):
    with pytest.raises(InputError) as caught:
        call()
    for part in parts:
        assert part in str(caught.value), str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("offset", [0.0, 0.02, -0.03])
@pytest.mark.parametrize("theta", [None, [0.1, -0.05]])
def test_start_by_parameters_and_offset(task, theta, offset):
    made = task(theta=theta or [], offset=[offset, 0.0])
    begin = made.start(np.zeros(3))
    a, b = theta or [0.0, 0.0]
    normal = np.array([-2.0 * a, -2.0 * b, 1.0]) / np.sqrt(1.0 + 4.0 * (a * a + b * b))
    expected = np.array([0.8 + a, b, 1.0 + a * a + b * b]) + offset * normal
    np.testing.assert_allclose(begin.target.y_t, expected, atol=1e-12)
    np.testing.assert_allclose(begin.projection, [a, b, 0.0, 0.0], atol=1e-9)
    assert begin.target.R_e is None


def test_start_by_position_and_shift(task):
    begin = task(position=[0.8, 0.0, 0.99]).start(np.array([0.0, 0.0, 0.005]))
    np.testing.assert_allclose(begin.target.y_t, [0.8, 0.0, 0.995])
    np.testing.assert_allclose(begin.projection, 0.0, atol=1e-9)


def test_the_place_starts_where_the_reference_does(scenario):
    settings = scenario()
    settings.reference.places = [[0.3, -0.1], [0.2, 0.0]]
    begin = make_task(settings, Path()).start(np.zeros(3))
    np.testing.assert_allclose(begin.projection, [0.0, 0.0, 0.3, -0.1], atol=1e-9)


@pytest.mark.parametrize("kind", ["given", "normal"])
def test_start_of_the_orientation(scenario, kind):
    settings = scenario(kind=kind, theta=[0.1, 0.0], rotation_deg=[5.0, 0.0, 0.0])
    settings.surface.orientation.angles_deg = [0.0, 180.0, 0.0]
    R_e = make_task(settings, Path()).start(np.zeros(3)).target.R_e
    turned = zyx_to_matrix(np.deg2rad([0.0, 180.0, 0.0])) @ zyx_to_matrix(
        np.deg2rad([5.0, 0.0, 0.0])
    )
    slope = np.arctan(0.2)  # of the dish at 0.1
    frame = zyx_to_matrix(np.array([0.0, -slope, 0.0])) if kind == "normal" else np.eye(3)
    np.testing.assert_allclose(R_e, frame @ turned, atol=1e-12)


def test_starts_that_are_refused(task):
    def start(*args, **more):
        return lambda: task(*args, **more).start(np.zeros(3))

    # the dish bends with a radius of 0.5 m: towards its centre alpha grows to one
    refusal(start(offset=[0.49, 0.0]), "start", "neighbourhood", "alpha")
    refusal(start(offset=[0.6, 0.0]), "start", "nearer to one of both")
    refusal(start(position=[1.3, 0.0, 1.1]), "start", "beside the patch", "mm from its border")
    refusal(start(theta=[0.9, 0.0]), "start.theta", "theta_1", "0.9")
    pipe = Cylinder(origin=[0.8, 0.0, 1.0], radius=0.1)
    refusal(start(pipe, position=[0.8, 0.0, 1.0]), "start")


@pytest.mark.slow
def test_a_start_between_two_sheets_is_refused(task, tmp_path):
    """Of a channel with straight walls 0.1 m apart; 1 mm off its middle one wall is 4 % nearer."""
    up, around = np.linspace(0.0, 0.3, 20), np.linspace(0.0, np.pi, 12)[1:-1]
    left = np.column_stack([0.0 * up - 0.05, up])[::-1]
    bottom = np.column_stack([-0.05 * np.cos(around), -0.05 * np.sin(around)])
    right = np.column_stack([0.0 * up + 0.05, up])
    rows = [f"{x},0,{z}" for x, z in np.vstack([left, bottom, right])]
    file = tmp_path / "channel.csv"
    file.write_text("\n".join(["x,y,z", *rows]), encoding="utf-8")
    channel = Extruded(file=str(file), direction=[0.0, 1.0, 0.0], length=0.3)
    refusal(
        lambda: task(channel, position=[0.001, 0.15, 0.2]).start(np.zeros(3)),
        "start",
        "nearer to one of both",
    )
    begin = task(channel, position=[0.01, 0.15, 0.2]).start(np.zeros(3))
    np.testing.assert_allclose(begin.projection[1], 0.15, atol=1e-9)


@pytest.mark.slow(but="places1-theta_2")
@pytest.mark.parametrize(
    ("places", "where"),
    [([[0.0, 0.0], [0.25, 0.0]], "theta_1"), ([[0.0, 0.0], [0.0, -0.25]], "theta_2")],
)
def test_ways_that_leave_the_patch_are_refused(scenario, places, where):
    settings = scenario(Plane(origin=[0.8, 0.0, 1.0]))
    settings.reference.places = places
    made = make_task(settings, Path())
    refusal(lambda: list(made.tool_positions()), "leaves the surface", where, "0.2")
    settings.surface.shape = Cylinder(origin=[0.8, 0.0, 1.0], radius=0.02)
    made = make_task(settings, Path())
    if where == "theta_1":  # closed: twice around
        assert len(list(made.tool_positions())) > 10
    else:
        refusal(lambda: list(made.tool_positions()), "leaves the surface")


def test_the_way_is_that_of_the_reference(scenario):
    """On a plane the tangential coordinates are Cartesian ones."""
    settings = scenario(Plane(origin=[0.8, 0.0, 1.0]))
    points = np.array([point for point, _ in make_task(settings, Path()).tool_positions()])
    np.testing.assert_allclose(points[0], [0.8, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(points[-1], [0.9, 0.05, 1.0], atol=1e-9)


def test_references(scenario):
    settings = scenario()
    motion = make_task(settings, Path()).motion
    assert motion.dimension == 2
    end = motion.derivatives(np.array([motion.domain[1]]), 1)[0]
    np.testing.assert_allclose(end, [[0.1, 0.05], [0.0, 0.0]], atol=1e-12)
    settings.reference = ReferenceParameters(
        points=[0.0, 0.1], second=SecondReference([0.0, -0.2, 0.1], velocity=0.3)
    )
    motion = make_task(settings, Path()).motion
    t = np.linspace(*motion.domain, 2000)
    eta, velocity = np.moveaxis(motion.derivatives(t, 1), 1, 0)
    np.testing.assert_allclose(eta[-1], [0.1, 0.1], atol=1e-12)
    assert eta[:, 1].min() == pytest.approx(-0.2, abs=1e-6)
    np.testing.assert_allclose(np.abs(velocity).max(axis=0), [0.1, 0.3], rtol=1e-3)
    settings.reference = ReferenceParameters(points=[0.0, 0.1])
    refusal(lambda: make_task(settings, Path()), "reference.places", "reference.second")


def test_no_surface(scenario):
    settings = scenario()
    settings.surface = None
    refusal(lambda: make_task(settings, Path()), "surface: {shape:")


@pytest.mark.parametrize(
    ("kind", "axes", "needed"),
    [("none", "full", 3), ("given", "full", 6), ("normal", "full", 6), ("normal", "tool_axis", 5)],
)
def test_joints_too_few(scenario, kind, axes, needed):
    settings = scenario(kind=kind)
    settings.surface.orientation.task = axes
    made = make_task(settings, Path())
    check_joints(settings, made, needed)
    refusal(
        lambda: check_joints(settings, made, needed - 1),
        f"{needed - 1} joints",
        f"{needed} outputs",
    )


@pytest.mark.parametrize("kind", ["given", "normal"])
def test_a_delta_robot_refuses_orientations(load_scenario, kind):
    settings = load_scenario("sfc_delta_cylinder")
    settings.surface.orientation.kind = kind
    refusal(
        lambda: build_station(settings, Path()),
        f"surface.orientation.kind = {kind}",
        "only translates",
    )


def test_places_that_a_hand_goes_to(task):
    made = task()
    made.check_coordinates(np.array([0.1, 0.1, 0.02]), "hand.waypoints[0].position")
    refusal(
        lambda: made.check_coordinates(np.array([0.1, 0.5, 0.0]), "hand.waypoints[0].position"),
        "hand.waypoints[0].position",
        "theta within",
    )
    point, velocity = made.target(np.array([0.1, 0.0, 0.02]), np.zeros(3))
    normal = np.array([-0.2, 0.0, 1.0]) / np.sqrt(1.04)
    np.testing.assert_allclose(point, np.array([0.9, 0.0, 1.01]) + 0.02 * normal, atol=1e-12)
    np.testing.assert_array_equal(velocity, 0.0)


def test_the_ramps_of_the_visco_elastic_axes_reach_the_speeds_that_are_said(load_scenario):
    """1.5 and 1 m/s, of which a way of 0.55 m between two stops is too short for slow ramps."""
    motion = make_task(load_scenario("sfc_viscoelastic_3r"), Path()).motion
    times = np.linspace(*motion.domain, 4001)
    speeds = np.abs(motion.derivatives(times, 1)[:, 1]).max(axis=0)
    np.testing.assert_allclose(speeds, [1.5, 1.0], rtol=1e-9)
