"""Workpiece and ball: shapes, places, and the station that holds them."""

import dataclasses

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.environment.workpieces import notch_surface, position_in_notch
from diagrams.scenario import Scenario
from experiments.scenario_file import SCENARIO_DIRECTORY, load_scenario_data
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_typed

FILE = SCENARIO_DIRECTORY / "pfc_delta_notch.yaml"
GRAVITY, LOAD = 9.81, 0.7
UP = np.array([0.0, 0.0, -1.0])  # z_0 points down


def load(*changes):
    exact = ["encoders={}", "model_error={}", "start.transition=0"]
    return load_typed(Scenario, load_scenario_data(FILE, [*exact, *changes]), str(FILE))


@pytest.fixture(name="settings", scope="module")
def fixture_settings():
    return load()


@pytest.fixture(name="station", scope="module")
def fixture_station(settings):
    return build_station(settings, SCENARIO_DIRECTORY)


def axis_points(station, notch):
    """Return points of the notch's axis, from its definition."""
    theta = np.linspace(*station.path.position.domain, 4000)
    taught = station.path.position.derivatives(theta, 0)[:, 0]
    # down to the ball on the bottom, and up to where its centre is in the middle
    below = notch.ball.distance + notch.ball.radius - notch.radius
    return taught + np.array([0.0, 0.0, below]) + notch.displacement


@pytest.mark.slow
def test_surface_is_round_about_the_displaced_axis(settings, station):
    notch = settings.notch
    vertices, triangles = notch_surface(station.path, notch, UP)
    axis = axis_points(station, notch)
    distance = np.array([np.linalg.norm(axis - v, axis=1).min() for v in vertices])
    # nothing is nearer to the axis than the round bottom, and most points are on it
    assert distance.min() == pytest.approx(notch.radius, abs=2e-6)
    assert np.mean(np.isclose(distance, notch.radius, atol=2e-6)) > 0.7
    # facets are flat: the ball, 2 mm smaller, fits between them
    centres = vertices[triangles].mean(axis=1)
    nearest = np.array([np.linalg.norm(axis - c, axis=1).min() for c in centres])
    assert nearest.min() > notch.radius - 5e-4
    assert nearest.min() > notch.ball.radius


def test_a_notch_without_upright_walls_has_no_empty_triangles(settings, station):
    """As deep as it is round, the rim begins where the arc ends."""
    shallow = dataclasses.replace(settings.notch, depth=settings.notch.radius)
    vertices, triangles = notch_surface(station.path, shallow, UP)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-8


def test_surface_is_open_upwards(settings, station):
    vertices, triangles = notch_surface(station.path, settings.notch, UP)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    outwards = np.cross(b - a, c - a)
    # upright walls between two cross-sections of a winding path are not quite upright
    assert np.all(outwards @ UP > -0.02 * np.linalg.norm(outwards, axis=1))
    rim = (vertices @ UP).max()
    bottom = (vertices @ UP).min()
    assert rim - bottom > settings.notch.depth


def test_places_in_the_notch(settings, station):
    notch, path = settings.notch, station.path
    theta = path.arc_length.parameter(0.2)
    taught, slope = path.position.derivatives(np.array([theta]), 1)[0]
    left = np.cross(UP, slope) / np.linalg.norm(np.cross(UP, slope))
    above = np.cross(slope, left) / np.linalg.norm(slope)
    seat = taught + notch.displacement
    places = position_in_notch(path, notch, np.array([seat, seat + 1e-3 * left]), theta, UP)
    below = notch.clearance * above @ UP  # the axis is above, not normal to the path
    np.testing.assert_allclose(places, [[0.0, -below], [1e-3, -below]], atol=1e-5)
    # from the start on, whose parameter the station knows
    taught, slope = path.position.derivatives(np.array([station.initial_projection[0]]), 1)[0]
    left = np.cross(UP, slope) / np.linalg.norm(np.cross(UP, slope))
    here = taught + notch.displacement + notch.clearance * UP + 1e-3 * left
    further = station.further_lengths(here[None])["notch_position"]
    named = dict(zip(further.labels, further.values[0], strict=True))
    assert named["left"] == pytest.approx(1e-3, abs=2e-5)
    assert named["above"] == pytest.approx(0.0, abs=2e-5)


def test_starts_in_the_middle_of_the_notch_and_touches_nothing(settings, station):
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    y_t = station.robot.tool_position(station.initial_state[:3])
    place = position_in_notch(
        station.path, settings.notch, y_t[None], station.initial_projection[0], UP
    )
    np.testing.assert_allclose(place, 0.0, atol=1e-9)
    contact = station.diagram.GetSubsystemByName("contact_wrench")
    wrench = contact.GetOutputPort("wrench").Eval(contact.GetMyContextFromRoot(root))
    assert not wrench.any()


def test_the_balls_shell_is_of_its_material(settings, station):
    scene = station.diagram.GetSubsystemByName("scene_graph").model_inspector()
    tool = station.part.plant.GetBodyByName("tool")
    (ball,) = station.part.plant.GetCollisionGeometriesForBody(tool)
    properties, parameters = scene.GetProximityProperties(ball), settings.notch.ball
    for group, name, value in (
        ("material", "hunt_crossley_dissipation", parameters.dissipation),
        ("hydroelastic", "hydroelastic_modulus", parameters.modulus),
    ):
        assert properties.GetProperty(group, name) == value > 0.0


def test_sensor_carries_the_load_of_the_robot():
    station = build_station(
        load("drive_friction=false", "sensor.noise=[0, 0, 0, 0, 0, 0]"), SCENARIO_DIRECTORY
    )
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    simulator.AdvanceTo(0.018)
    load_force = station.blocks.output(root, "force_torque_sensor.load")[:3]
    # nearly at rest, before the taring ends: z_0 points down
    np.testing.assert_allclose(load_force, [0.0, 0.0, LOAD * GRAVITY], atol=0.1)


def test_robot_has_the_same_mass_as_without_a_notch(station):
    masses = station.robot.parameters.masses
    plant = station.part.plant
    carried = sum(plant.GetBodyByName(name).default_mass() for name in ("end_effector", "tool"))
    assert carried == pytest.approx(masses.effective_plate)
    assert plant.GetBodyByName("tool").default_mass() == pytest.approx(masses.load)


def test_the_gripper_hangs_from_the_plate_down_to_the_ball(settings, station):
    """Its middle is half way down, z_0 points down; so much torque is on the sensor."""
    com = station.part.plant.GetBodyByName("tool").default_com()
    np.testing.assert_allclose(com, [0.0, 0.0, settings.notch.ball.distance / 2.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ("notch.radius=0.02", ["notch.radius = 0.02", "more than ball.radius"]),
        ("notch.depth=0.01", ["notch.depth = 0.01"]),
        ("notch.width=0.03", ["notch.width = 0.03"]),
        ("notch.displacement=[0, 0]", ["notch.displacement", "3 finite numbers"]),
        ("notch.time_step=7e-4", ["notch.time_step", "whole fraction", "0.001"]),
        ("notch.time_step=0.01", ["notch.time_step = 0.01"]),
        ("notch.ball.modulus=-1", ["notch.ball.modulus = -1"]),
        ("notch.ball.friction=-0.1", ["notch.ball.friction = -0.1"]),
        ("notch.displacement=[0, 0, 0.2]", ["start: [", "outside the workspace"]),
        ("sensor.joint=elsewhere", ["sensor.joint", "elsewhere"]),
    ],
)
def test_refused(change, parts):
    with pytest.raises(InputError) as caught:
        build_station(load(change), SCENARIO_DIRECTORY)
    for part in parts:
        assert part in str(caught.value)
