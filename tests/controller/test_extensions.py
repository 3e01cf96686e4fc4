"""Extensions of a user's controller: a force sensor behind the tool, a payload, a stop."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake import (
    ComplianceParameters,
    CoordinateImpedance,
    FollowerOptions,
    Payload,
    Profile,
    SensedForce,
    WaypointTable,
    add_path_following,
    path_from_waypoints,
)
from pfsc_drake.control.compliance.tool_compensation import ToolCompensationParameters
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.systems.plants.reactions import tool_load_from_plant
from tests.controller.test_path_following import load

GRAVITY = np.array([0.0, 0.0, -9.81])
RANGE = np.array([500.0, 400.0, 300.0, 20.0, 10.0, 30.0])
BIAS = np.array([0.5, -0.5, 0.2, 0.1, 0.05, -0.1])
PUSH = np.array([12.0, -7.0, 5.0, 0.0, 0.0, 0.0])
NONE = np.zeros(6)
SOFT = CoordinateImpedance(Profile(3.0), Profile(60.0), Profile(500.0))


class Bench:
    """A follower whose tool hangs on a sensor, stepped at rest."""

    def __init__(self, **options):
        plant = load(DiagramBuilder(), "comau_racer_1_4")
        points = np.array([[0.9, y, 0.8] for y in np.linspace(-0.3, 0.3, 7)])
        path = path_from_waypoints(WaypointTable(points), smoothness=3)
        tool = plant.GetFrameByName("tool_point")
        self.load = tool_load_from_plant(plant, plant.GetJointByName("weld_tool"), tool)
        sensor = SensedForce(self.load, RANGE, ToolCompensationParameters(taring_time=0.05))
        extensions = [sensor, *options.pop("extensions", ())]
        self.follower = add_path_following(
            DiagramBuilder(),
            plant,
            "tool_point",
            path,
            "rigid",
            options=FollowerOptions(
                compliance=ComplianceParameters(transversal=SOFT), extensions=extensions, **options
            ),
        )
        pose = np.array(pose_function(self.follower.robot)(self.follower.start_posture)).ravel()
        self.y_t, self.R_e = pose[:3], pose[3:].reshape(3, 3)
        self.stepper = self.follower.stepper()

    def reading(self, push=NONE, payload=0.0, p_TC=NONE[:3]):
        """Return what a sensor reads: the weights behind it, a push at the tool point, a bias."""
        R_WS = self.R_e @ self.load.R_ST.T
        force = (self.load.mass + payload) * GRAVITY + push[:3]
        # moments about the sensor, world axes
        tool = R_WS @ self.load.p_ST
        moment = np.cross(R_WS @ self.load.p_SC, self.load.mass * GRAVITY)
        moment += np.cross(tool + self.R_e @ p_TC, payload * GRAVITY)
        moment += np.cross(tool, push[:3]) + push[3:]
        return np.concatenate([R_WS.T @ force, R_WS.T @ moment]) + BIAS

    def rest(self, samples, reading, **inputs):
        """Return the outputs of the last of some samples."""
        state = self.follower.start_state
        for _ in range(samples):
            told = self.stepper.step(plant_state=state, measured_wrench=reading, **inputs)
        return told


def test_the_weight_of_the_tool_and_the_bias_are_taken_off():
    bench = Bench()
    rest = bench.rest(200, bench.reading())
    assert np.abs(rest["manifold_force"]).max() < 1e-9
    pushed = bench.rest(1, bench.reading(PUSH))
    place = bench.follower.task.projected_manifold
    axes = place.axes(pushed["manifold_point"]).full()
    across = axes[:, 1:3].T @ PUSH[:3]
    np.testing.assert_allclose(pushed["manifold_force"][1:3], across, atol=1e-9)


def test_a_payload_is_taken_off_while_it_is_held():
    center, mass = np.array([0.02, -0.01, 0.1]), 1.7
    bench = Bench(extensions=[Payload(mass, center, GRAVITY)])
    bench.rest(200, bench.reading(), held=0.0)
    held = bench.reading(payload=mass, p_TC=center)
    assert np.abs(bench.rest(1, held, held=1.0)["manifold_force"]).max() < 1e-9
    fallen = bench.rest(1, bench.reading(), held=1.0)["manifold_force"]
    assert np.abs(fallen[1:3]).max() > 0.5 * mass * 9.81


def test_a_sensor_that_is_lost_stops_the_robot():
    bench = Bench()
    assert bench.rest(200, bench.reading())["fault"] == Fault.NONE
    lost = bench.reading()
    lost[2] = np.nan
    assert bench.rest(3, lost)["fault"] != Fault.NONE


@pytest.mark.slow(but="1.0")
@pytest.mark.parametrize("request_value", [1.0, -0.5])
def test_a_request_stops_the_robot(request_value):
    bench = Bench(stop_request=True)
    reading = bench.reading()
    assert bench.rest(2, reading, stop_request=0.0)["fault"] == Fault.NONE
    assert bench.rest(1, reading, stop_request=request_value)["fault"] == Fault.STOP_REQUESTED


def test_an_option_that_is_not_connected_is_refused():
    bench = Bench(override=True)
    context = bench.follower.CreateDefaultContext()
    follower = bench.follower
    follower.GetInputPort("plant_state").FixValue(context, follower.start_state)
    follower.GetInputPort("measured_wrench").FixValue(context, bench.reading())
    with pytest.raises(RuntimeError, match=r"override.* not connected"):
        follower.GetOutputPort("reference").Eval(context)
    follower.GetInputPort("override").FixValue(context, [1.0])
    assert np.isfinite(follower.GetOutputPort("reference").Eval(context)).all()
