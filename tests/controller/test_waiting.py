"""A controller of a user's own whose progress waits for obstacles."""

import dataclasses as dc
import json

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

import pfsc_drake
from pfsc_drake import (
    ElbowParameters,
    FollowerOptions,
    ObstacleOptions,
    ObstacleShape,
    StreamLimits,
    WatchParameters,
    WaypointTable,
    add_path_following,
    path_from_waypoints,
)
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.planning.stopping import stopping_bandwidth
from pfsc_drake.controller import waiting
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from tests.controller.test_path_following import load, read

POINTS = np.array([[0.9, y, 0.8] for y in np.linspace(-0.4, 0.4, 9)])
WATCH = WatchParameters(largest_acceleration=5.0, latency=0.02, uncertainty=0.01)
OPTIONS = FollowerOptions(obstacles=ObstacleOptions([ObstacleShape("column", 0.2)], WATCH))


@pytest.fixture(name="loop", scope="module")
def fixture_loop():
    builder = DiagramBuilder()
    plant = load(builder, "comau_racer_1_4")
    path = path_from_waypoints(WaypointTable(POINTS), smoothness=6)
    motion = rest_to_rest([0.0, 0.8], velocity=0.5, acceleration=3.0)
    follower = add_path_following(
        builder, plant, "tool_point", path, "rigid", motion=motion, options=OPTIONS
    )
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())
    diagram = builder.Build()

    def start():
        simulator = Simulator(diagram)
        root = simulator.get_mutable_context()
        state = follower.start_state
        plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), state)
        return simulator, follower.GetMyMutableContextFromRoot(root)

    return follower, start


def _told(follower, context, place):
    follower.GetInputPort("obstacles").FixValue(context, np.array([*place, 0.0, 0.0, 0.0, 0.0]))


@pytest.mark.slow
def test_it_waits_for_one_who_stands_on_its_way_and_goes_on_when_he_has_gone(loop):
    follower, start = loop
    simulator, context = start()
    _told(follower, context, [0.9, 0.45])
    simulator.AdvanceTo(1.4)
    waits = read(simulator, follower, "manifold_state")
    assert 0.05 < waits[0] < 0.45
    least, permitted, _ = read(simulator, follower, "watch")
    assert permitted < 0.5
    # the tool's capsule ends at the tool point; other links may be nearer
    assert WATCH.margin < least <= 0.45 - (-0.4 + waits[0]) - 0.2 - WATCH.arm_radius + 1e-3
    _told(follower, context, [5.0, 5.0])
    simulator.AdvanceTo(3.0)
    assert read(simulator, follower, "manifold_state")[0] == pytest.approx(0.8, abs=1e-4)


@pytest.mark.slow
def test_a_place_that_is_no_number_stops_it(loop):
    follower, start = loop
    simulator, context = start()
    _told(follower, context, [5.0, 5.0])
    simulator.AdvanceTo(0.6)
    assert read(simulator, follower, "manifold_state")[0] > 0.05
    _told(follower, context, [np.nan, 5.0])
    simulator.AdvanceTo(1.1)
    eta = read(simulator, follower, "manifold_state")[0]
    simulator.AdvanceTo(1.3)
    assert read(simulator, follower, "manifold_state")[0] == pytest.approx(eta, abs=1e-5)
    assert eta < 0.4


@pytest.mark.slow
def test_it_is_exported_as_c_with_its_obstacles(loop, tmp_path):
    follower, _ = loop
    pfsc_drake.export(follower, tmp_path)
    interface = json.loads((tmp_path / "interface.json").read_text())
    assert {"name": "obstacles", "size": 6} in [
        {key: port[key] for key in ("name", "size")} for port in interface["inputs"]
    ]


def test_friction_is_taken_off_what_drives_can_do(monkeypatch):
    """``(1 - reserve) (effort - f_c)`` where the weight is small."""
    builder = DiagramBuilder()
    plant = load(builder, "comau_racer_1_4")
    path = path_from_waypoints(WaypointTable(POINTS), smoothness=6)
    motion = rest_to_rest([0.0, 0.1], velocity=0.5, acceleration=3.0)
    made = []

    def spy(demand, trajectory, step, allowed, order):
        made.append(allowed)
        return stopping_bandwidth(demand, trajectory, step, allowed, order)

    monkeypatch.setattr(waiting, "stopping_bandwidth", spy)
    f_c = np.array([40.0, 0.0, 30.0, 10.0, 8.0, 3.0])
    options = dc.replace(OPTIONS, friction=(f_c, np.zeros(6)))
    add_path_following(builder, plant, "tool_point", path, "rigid", motion=motion, options=options)
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    expected = (1.0 - WATCH.reserve) * (chain.gather("effort_limit") - f_c)
    allowed = made[0][:, :6]
    # axes 1, 4, 5 and 6 have next to no weight
    np.testing.assert_allclose(allowed[:, [0, 3, 4, 5]] / expected[[0, 3, 4, 5]], 1.0, rtol=1e-9)


def test_what_cannot_wait_is_refused():
    builder = DiagramBuilder()
    plant = load(builder, "comau_racer_1_4")
    path = path_from_waypoints(WaypointTable(POINTS), smoothness=6)
    with pytest.raises(InputError, match=r"shapes = \[\]"):
        ObstacleOptions([])
    frame = np.array([0.0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])
    for change in ({"stream": StreamLimits()}, {"frame": frame}):
        options = dc.replace(OPTIONS, **change)
        with pytest.raises(InputError, match="obstacles = given"):
            add_path_following(builder, plant, "tool_point", path, "rigid", options=options)


@pytest.mark.slow
def test_an_elbow_avoids_obstacles_where_there_is_one():
    """The torques that push it away are in the loop; three joints leave none to spare."""
    path = path_from_waypoints(WaypointTable(POINTS), smoothness=6)
    obstacles = dc.replace(OPTIONS.obstacles, elbow=ElbowParameters(room=2.0, stiffness=400.0))
    options = dc.replace(OPTIONS, obstacles=obstacles)

    def follower(model, chosen):
        builder = DiagramBuilder()
        plant = load(builder, f"comau_racer_1_4{model}")
        return add_path_following(builder, plant, "tool_point", path, "rigid", options=chosen)

    with pytest.raises(InputError, match=r"obstacles\.elbow = given; .*without redundant joints"):
        follower("_3r", options)
    torques = []
    for made in (follower("", OPTIONS), follower("", options)):
        step = made.stepper().step
        place = [0.2, 0.6, 0.8, 0.0, 0.0, 0.0]
        for _ in range(100):
            told = step(plant_state=made.start_state, obstacles=place)
        torques.append(told["drive_torque"])
    assert np.abs(torques[1] - torques[0]).max() > 1.0
