"""Robots, tasks and environments that no shipped scenario combines."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import (
    Circle,
    ComplianceParameters,
    ForcePulse,
    HandParameters,
    HandWaypoint,
    Keyframe,
    Line,
    Scenario,
)
from diagrams.scenario.workpiece import BallParameters, NotchParameters
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.control.compliance.measured_wrench import SensorFault
from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import ToolTarget, solve_pose
from pfsc_drake.systems.plants.delta_plant import DeltaPlant
from tests.scenarios import LONG

STIFFNESS = 500.0


def soft():
    """Return a compliance that is overdamped, but settles within a few hundred milliseconds."""
    spring = CoordinateImpedance(Profile(1.0), Profile(40.0), Profile(STIFFNESS))
    return ComplianceParameters(transversal=spring)


def run(settings: Scenario, duration: float, folder=SCENARIO_DIRECTORY):
    """Return the station and its log."""
    settings.simulation.fused = duration >= LONG
    station = build_station(settings, folder)
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(duration)
    assert station.fault(simulator.get_context()) is None
    times, log = station.log.read(simulator.get_context())
    return station, times, log


@pytest.fixture
def delta(load_exact_scenario):
    """The DELTA robot without friction, resting on its path."""
    settings = load_exact_scenario("pfc_delta")
    settings.drive_friction = False
    settings.start.offset = [0.0, 0.0]
    settings.reference.dwell = 3.0
    settings.sensor.noise = np.full(6, 1e-3)
    settings.sensor.taring_time = 0.02
    return settings


@pytest.mark.slow
def test_a_delta_robot_that_touches_nothing_yields_to_its_sensor(delta):
    """The analytic plant has no joint for the load; its reaction is computed."""
    delta.robot.plant = "analytic"
    delta.compliance, force = soft(), 3.0
    delta.forces = [ForcePulse(0.1, 2.0, np.array([0.0, force, 0.0]), frame="manifold")]
    station, _, log = run(delta, 0.9)
    assert isinstance(station.part.plant, DeltaPlant)
    xi = log["law"][-1, station.law.layout.manifold_state][1]
    assert xi == pytest.approx(force / STIFFNESS, rel=0.02)
    np.testing.assert_allclose(
        log["wrench_measured"][-1, :3], log["wrench_ext"][-1, :3], rtol=0, atol=0.05
    )


@pytest.mark.slow
def test_the_sensor_of_a_delta_robot_takes_off_the_load_while_it_moves(delta):
    """What is left of a moving load of 0.7 kg is what the drives' steps leave."""
    delta.compliance, delta.reference.dwell = soft(), 0.1
    _, times, log = run(delta, 0.5)
    moving = np.abs(log["wrench_measured"][times > 0.15, :3])
    assert np.abs(np.diff(log["joint_state"][:, 3:6], axis=0)).max() > 1e-4
    assert moving.max() < 0.1


def test_a_slide_that_is_not_measured_spoils_the_compensation_but_not_what_is_borne(delta):
    """The sensor measures the load; its share can no longer be compensated."""
    delta.compliance = soft()
    delta.simulation.sensor_failure.time = 0.0505
    delta.simulation.sensor_failure.component = 1
    station = build_station(delta, SCENARIO_DIRECTORY)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.AdvanceTo(0.06)
    times, log = station.log.read(root)
    lost = times > 0.0505
    np.testing.assert_array_equal(log["sensor_fault"][:, 0] == SensorFault.LOST, lost)
    assert not log["wrench_measured"][lost].any()
    load = station.blocks.output(root, "force_torque_sensor.load")
    weight = station.robot.parameters.masses.load * 9.81
    assert np.linalg.norm(load[:3]) == pytest.approx(weight, rel=0.05)


@pytest.mark.slow
def test_a_hand_leads_a_delta_robot(delta):
    delta.compliance = soft()
    delta.compliance.tangential = CoordinateImpedance(Profile(1.0), Profile(30.0), Profile(0.0))
    there = [HandWaypoint(0.1, np.array([0.022, 0, 0])), HandWaypoint(0.8, np.array([0.09, 0, 0]))]
    delta.hand = HandParameters(there, "manifold", stiffness=300.0)
    station, _, log = run(delta, 1.0)
    eta = log["law"][-1, station.law.layout.manifold_state][0]
    assert eta == pytest.approx(0.09, abs=0.012)
    assert 1.0 < np.linalg.norm(log["wrench_ext"][:, :3], axis=1).max() < 30.0


def test_friction_of_a_delta_robot_may_be_given(delta):
    delta.drive_friction = None
    own = build_station(delta, Path("experiments/scenarios"))
    assert "friction_torque" in own.log.rows
    delta.friction.f_c, delta.friction.f_v = [1.0, 2.0, 3.0], [0.0, 0.0, 0.0]
    delta.forces = [ForcePulse(0.0, 2.0, np.array([30.0, 10.0, 0.0]))]
    _, _, log = run(delta, 0.1)
    assert np.all(np.abs(log["friction_torque"]).max(axis=0) <= [1.0, 2.0, 3.0])


def test_an_arm_has_no_friction_of_its_own(load_exact_scenario):
    settings = load_exact_scenario("pfc_compliant_6r")
    settings.drive_friction = True
    with pytest.raises(InputError, match=r"drive_friction = True; allowed: null; .*'friction'"):
        build_station(settings, SCENARIO_DIRECTORY)


@pytest.fixture
def arm_in_a_notch(load_exact_scenario):
    """A six-axis arm with a ball at its tool point, on a level line."""
    settings = load_exact_scenario("pfc_compliant_6r")
    settings.path.shape = Line([0.8, -0.15, 0.9], [0.8, 0.15, 0.9])
    settings.path.orientation.convention = "zyz"
    settings.path.orientation.keyframes = [Keyframe(0.0, [0.0, 150.0, 180.0])]
    settings.start.posture_deg = [0.0, 90.0, -30.0, 0.0, 60.0, 0.0]
    settings.reference.points, settings.reference.dwell = [0.0, 0.3], 0.05
    settings.sensor.taring_time, settings.forces = 0.02, []
    settings.notch = NotchParameters(BallParameters(distance=0.0), [0.0, 0.0, 0.0])
    settings.compliance = soft()
    return settings


@pytest.mark.slow
def test_an_arm_runs_in_a_notch(arm_in_a_notch):
    """Displaced by 4 mm, with 2 mm free: the tool yields, and the sensor feels the contact."""
    arm_in_a_notch.notch.displacement = [0.004, 0.0, 0.0]
    station, times, log = run(arm_in_a_notch, 0.6)
    pose = log["tool_pose"][:, :3]
    places = station.further_lengths(pose)["notch_position"].values
    np.testing.assert_allclose(places[0], 0.0, atol=1e-5)  # after the plant's first step
    later = times > 0.3
    assert np.linalg.norm(places, axis=1).max() < 0.0035
    force = np.linalg.norm(log["wrench_ext"][later, :3], axis=1)
    # on its way back to the taught path the ball leans on the wall
    assert force.max() > 0.5
    difference = log["wrench_measured"][later, :3] - log["wrench_ext"][later, :3]
    assert np.abs(difference).mean() < 0.3


def test_the_contacts_torque_is_about_the_true_tool_point(arm_in_a_notch):
    """Encoders of 300 increments are wrong by millimetres; contact is where it is."""
    arm_in_a_notch.encoders.link_increments = [300.0]
    station = build_station(arm_in_a_notch, SCENARIO_DIRECTORY)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    # 2 mm are free
    station.set_robot_state(root, shifted(station, np.array([0.0023, 0.0, 0.0])))
    simulator.AdvanceTo(1e-3)
    now, plant = station.log.now(station.blocks, root), station.part.plant
    context = plant.GetMyContextFromRoot(root)
    y_t = station.part.tool.CalcPoseInWorld(context).translation()
    assert np.linalg.norm(now["tool_pose"][:3] - y_t) > 1e-3
    contact = plant.get_contact_results_output_port().Eval(context).hydroelastic_contact_info(0)
    there = contact.F_Ac_W().Shift(y_t - contact.contact_surface().centroid())
    # on the tool, whichever of the two it is
    sign = np.sign(there.translational() @ now["wrench_ext"][:3])
    assert np.linalg.norm(there.translational()) > 0.1
    expected = sign * np.concatenate([there.translational(), there.rotational()])
    np.testing.assert_allclose(now["wrench_ext"], expected, rtol=0, atol=1e-12)


def shifted(station, shift):
    """Return the state of the plant at rest with the tool shifted from the start."""
    plant, part = station.part.plant, station.part
    context = plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, station.initial_state)
    X_WT = part.tool.CalcPoseInWorld(context)
    near = (part.coordinates.link_rows @ station.initial_state)[: part.robot.dimension]
    target = ToolTarget(X_WT.translation() + shift, X_WT.rotation().matrix())
    q = solve_pose(part.robot, target, near, "here")
    return part.state_at_rest(q)


def test_the_ball_of_an_arm_is_at_its_tool_point(arm_in_a_notch):
    arm_in_a_notch.notch.ball.distance = 0.1
    with pytest.raises(InputError, match=r"notch\.ball\.distance = 0\.1; allowed: 0"):
        build_station(arm_in_a_notch, SCENARIO_DIRECTORY)


def test_the_coupled_plant_has_no_contact(arm_in_a_notch):
    arm_in_a_notch.robot.model = "comau_racer_1_4_elastic"
    arm_in_a_notch.robot.rotor_coupling = "comau_racer_1_4"
    with pytest.raises(InputError, match=r"robot\.rotor_coupling .*touches a workpiece"):
        build_station(arm_in_a_notch, SCENARIO_DIRECTORY)


@pytest.mark.slow
def test_trajectory_tracking_for_a_delta_robot(delta):
    """The other task: the point moves on with time, whatever the tool does."""
    delta.controller.manifold, delta.reference.dwell = "trajectory", 0.05
    _, times, log = run(delta, 0.5)
    errors = log["law"][times > 0.3][:, slice(3, 6)]
    assert np.abs(errors).max() < 1e-4
    assert log["reference"][-1, 0] > 0.03


@pytest.mark.slow
def test_a_circle_for_a_three_axis_arm_with_a_hand(load_scenario):
    """Position only: the hand's frame and the path's coordinates without orientation."""
    settings = load_scenario("pfc_elastic_3r")
    settings.controller.law, settings.robot.model = "rigid", "comau_racer_1_4_3r"
    settings.path.shape = Circle([0.9, 0.0, 1.0], 0.1, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    settings.reference.points, settings.start.posture_deg = [0.0, 0.1], []
    settings.hand = HandParameters([HandWaypoint(0.0, np.array([0.05, 0, 0]))], "manifold")
    _, _, log = run(settings, 0.1)
    assert np.abs(log["wrench_ext"]).max() > 1.0
