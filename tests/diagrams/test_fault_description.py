"""Fault messages of a station: from real runs, and at artificial instants."""

import re

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.builder import build_station
from diagrams.scenario import (
    Circle,
    ForcePulse,
    Keyframe,
    Line,
    OrientationParameters,
    ReferenceParameters,
    StartParameters,
)
from diagrams.scenario_task import make_task
from experiments.scenario_file import find_scenario
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.controller.fault_description import FaultInstant, FaultScene, describe
from pfsc_drake.geometry import matrix_to_zyx, zyx_to_matrix
from pfsc_drake.geometry.rotation import matrix_to_zyz, zyz_to_matrix

FOLDER = find_scenario("pfc_compliant_6r").parent


@pytest.fixture
def six_axes(load_scenario):
    """Six rigid axes, without waiting."""
    settings = load_scenario("pfc_compliant_6r")
    settings.forces, settings.reference.dwell = [], 0.02
    settings.compliance = type(settings.compliance)()
    settings.sensor = None
    return settings


def run(settings, end):
    """Simulate until the first tick after a fault, at most to an end; return station and root."""
    station = build_station(settings, FOLDER)
    simulator = Simulator(station.diagram)
    config = SimulatorConfig(
        integration_scheme="runge_kutta2", max_step_size=1e-3, use_error_control=False
    )
    ApplySimulatorConfig(config, simulator)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    while root.get_time() < end and station.controller.fault(station.blocks, root) is Fault.NONE:
        simulator.AdvanceTo(root.get_time() + 0.02)
    return station, root


@pytest.fixture
def through_the_wrist(six_axes):
    """The tool turns about its own cross axis while it goes down: q_5 from 26 to -2 deg and on."""
    six_axes.path.shape = Line([0.7878, 0.0, 1.27], [0.7767, 0.0, 0.4608])
    turn = [Keyframe(0.0, [180.0, -45.0, 0.0]), Keyframe(1.0, [0.0, -5.0, -180.0])]
    six_axes.path.orientation = OrientationParameters(keyframes=turn)
    six_axes.reference = ReferenceParameters([0.28, 0.5], velocity=0.5, acceleration=3.0, dwell=0.0)
    six_axes.start = StartParameters(posture_deg=[0, 105, -25, 0, 25, 0])
    return six_axes


@pytest.mark.slow
def test_a_wrist(through_the_wrist):
    station, root = run(through_the_wrist, 1.0)
    sentence = station.fault(root)
    _, raw = station.log.read(root)
    first = np.flatnonzero(raw["law"][:, station.law.layout.status.start])[0]
    q_5 = np.rad2deg(raw["joint_state"][first, 4])
    eta = raw["manifold_point"][first, station.task.projected_manifold.layout.eta].item()
    assert abs(q_5) < 1.0
    assert sentence == (
        f"wrist singular at eta = {eta:.4g} m, t = {1e-3 * first:.3f} s: q_5 = {q_5:.1f} deg "
        "(q_4 and q_6 can move without the tool)"
    )
    assert 0.28 < eta < 0.4


def test_coordinates_to_blame(six_axes):
    """The arm is well, the ZYX angles between path and tool are not: the second is 90 deg."""
    six_axes.path.shape = Line([0.7878, 0.0, 1.27], [0.8, 0.2, 1.2])
    tool = zyx_to_matrix(np.deg2rad([180.0, -45.0, 0.0]))
    across = tool @ zyx_to_matrix([0.0, -np.pi / 2.0, 0.0])
    angles = np.rad2deg(matrix_to_zyx(across)).tolist()
    six_axes.path.orientation = OrientationParameters(keyframes=[Keyframe(0.0, angles)])
    six_axes.reference.points = [0.0, 0.1]
    six_axes.start = StartParameters(
        rotation_deg=[0.0, 89.99, 0.0], posture_deg=[0, 110, -20, 0, 45, 0]
    )
    station, root = run(six_axes, 0.02)
    sentence = station.fault(root)
    assert sentence.startswith(Fault.SINGULAR.explanation)
    assert "phi_y = 90.0 deg" in sentence
    assert "q_" not in sentence


@pytest.mark.slow
def test_beyond_an_end(six_axes):
    """A push along the path, which the law alone resists, takes the tool over its start."""
    six_axes.reference.points, six_axes.controller.max_beyond_end = [0.004, 0.1], 2e-3
    six_axes.forces = [
        ForcePulse(begin=0.0, end=1.0, ramp=0.01, frame="manifold", force=[-2e3, 0.0, 0.0])
    ]
    station, root = run(six_axes, 0.2)
    assert station.controller.fault(station.blocks, root) is Fault.BEYOND_END
    found = re.fullmatch(
        r"the tool went beyond an end of the path at eta = (.*) m, t = 0\.\d+ s: "
        r"(.*) mm beyond its start",
        station.fault(root),
    )
    assert found is not None
    eta, beyond = map(float, found.groups())
    assert 2.0 < beyond < 3.0
    assert -3e-3 < eta < 0.0


def test_out_of_the_neighbourhood(load_scenario):
    """A ring, and a force through its middle."""
    settings = load_scenario("pfc_elastic_3r")
    settings.controller.law = "rigid"
    settings.path.shape = Circle(radius=0.05)
    settings.reference.points, settings.start.offset = [0.0, 0.1], [0.0, 0.0]
    settings.forces = [ForcePulse(begin=0.0, end=2.0, ramp=0.01, force=[0.0, -4e3, 0.0])]
    settings.faults.overspeed = np.inf
    station, root = run(settings, 1.0)
    sentence = station.fault(root)
    now, before = station.log.first_instant(
        station.blocks, root, "law", station.law.layout.status.start
    )
    y_t = now.signals["tool_pose"][:3]
    depth = 0.05 - np.linalg.norm((y_t - [0.8, 0.0, 1.0])[1:])
    assert sentence.startswith("the tool left the feasible neighbourhood of the path at eta = ")
    assert f"t = {now.time:.3f} s" in sentence
    assert now.time == pytest.approx(before.time + 1e-3)
    alpha = float(sentence.split("alpha = ")[1])
    assert alpha == pytest.approx(depth / 0.05, abs=1e-3)
    assert alpha >= 0.95
    xi = np.array(sentence.split("xi = [")[1].split("]")[0].split(", "), dtype=float)
    # the circle lies in the plane of y and z; along x the force moves nothing
    beside = np.hypot(depth, (y_t - [0.8, 0.0, 1.0])[0])
    assert np.linalg.norm(xi) * 1e-3 == pytest.approx(beside, abs=1e-4)


@pytest.mark.parametrize(("component", "name"), [(7, "v_J_2"), (23, "v_M_6"), (0, "q_J_1")])
def test_a_sensor(six_axes, component, name):
    six_axes.simulation.sensor_failure.time = 0.0105
    six_axes.simulation.sensor_failure.component = component
    station, root = run(six_axes, 0.1)
    assert station.fault(root) == (
        f"a measured value is not a finite number: {name} at eta = 0.026 m, t = 0.011 s"
    )


def test_a_sensor_that_never_worked(six_axes):
    six_axes.simulation.sensor_failure.time = 0.0
    station, root = run(six_axes, 0.0)
    # nothing is logged yet, and nobody knows where the tool is
    assert station.log.read(root)[0].size <= 1
    assert station.fault(root) == "a measured value is not a finite number: q_J_1 at t = 0.000 s"


@pytest.mark.slow
def test_a_servo(six_axes):
    six_axes.controller.law = "velocity_servo"
    six_axes.simulation.sensor_failure.time = 0.0105
    six_axes.simulation.sensor_failure.component = 7
    station, root = run(six_axes, 0.1)
    station.controller.fault = lambda *_: Fault.NONE
    sentence = station.fault(root)
    assert sentence == (
        "velocity_servo: a measured value is not a finite number: v_J_2 at eta = 0.026 m, "
        "t = 0.011 s"
    )


@pytest.mark.parametrize("unstable", [False, True])
def test_an_unstable_loop_is_not_blamed_on_sensors_alone(six_axes, unstable):
    """Measured values that part while commands swing; without, they alone are named."""
    station, root = run(six_axes, 0.02)
    now, before = station.log.first_instant(
        station.blocks, root, "law", station.law.layout.status.start
    )
    scene = FaultScene(
        station.law,
        station.robot,
        station.task.projected_manifold,
        False,
        now,
        before,
        np.eye(24)[10],
        np.array([1, 4]) if unstable else np.zeros(0, dtype=int),
    )
    sentence = describe(Fault.MEASUREMENT_IMPLAUSIBLE, scene)
    assert "measured values of a joint contradict each other: v_J_5 at eta = " in sentence
    assert ("commands of 2 and 5 oscillated" in sentence) == unstable
    assert ("an unstable loop does that with good sensors" in sentence) == unstable


def test_what_is_known_without_a_run(six_axes):
    """Forces and references that are no numbers; a projection without a result."""
    station, root = run(six_axes, 0.04)
    assert station.fault(root) is None
    now, _ = station.log.first_instant(station.blocks, root, "law", station.law.layout.status.start)

    def sentence(fault, **changes):
        changed = FaultInstant(0.5, {**now.signals, **changes})
        scene = FaultScene(
            station.law, station.robot, station.task.projected_manifold, False, changed, now
        )
        return describe(fault, scene)

    wrong = sentence(Fault.INPUT_NOT_FINITE, wrench_measured=np.full(6, np.nan))
    assert "measured force at eta = 0.026" in wrong
    wrong = sentence(Fault.INPUT_NOT_FINITE, reference=np.full(18, np.inf))
    assert "reference at eta" in wrong
    assert sentence(Fault.INPUT_NOT_FINITE).startswith(Fault.INPUT_NOT_FINITE.explanation)
    for fault in (Fault.FORCE_SENSOR_LOST, Fault.COMPLIANCE_INVALID, Fault.BUS_LOST):
        assert sentence(fault) == f"{fault.explanation} at eta = 0.026 m, t = 0.500 s"
    turned = sentence(Fault.ORIENTATION_ERROR)
    assert turned.startswith(f"{Fault.ORIENTATION_ERROR.explanation} at eta = 0.026 m")
    assert "phi_z = 0.0 deg" in turned or "phi_z = -0.0 deg" in turned
    force, asked = np.array([3.0, 12.5, 7.0, 0.0, 0.0, 0.0]), np.array([30.0])
    pressed = sentence(Fault.PRESS_FORCE_LOST, manifold_force=force, press=asked)
    assert pressed.endswith(": 12.5 N measured, 30 N desired at eta = 0.026 m, t = 0.500 s")
    point = now.signals["manifold_point"].copy()
    point[station.task.projected_manifold.layout.eta] = np.nan
    lost = sentence(Fault.PROJECTION_FAILED, manifold_point=point)
    y_t = np.round(now.signals["tool_pose"][:3], 4).tolist()
    assert lost.startswith(Fault.PROJECTION_FAILED.explanation)
    assert f"at eta = 0.026 m, t = 0.500 s: tool at {y_t} m" in lost


@pytest.mark.parametrize("fast", [0, 3])
def test_a_joint_that_runs_away_next_to_a_singular_posture(six_axes, fast):
    station, root = run(six_axes, 0.0)
    now, _ = station.log.first_instant(station.blocks, root, "law", station.law.layout.status.start)
    state = now.measured_state.copy()
    state[[4, 16]], state[[6 + fast, 18 + fast]] = np.deg2rad(2.0), np.deg2rad(600.0)
    near = FaultInstant(0.5, {**now.signals, "joint_state_measured": state})
    scene = FaultScene(
        station.law, station.robot, station.task.projected_manifold, False, near, now
    )
    sentence, name = describe(Fault.JOINT_SPEED, scene), station.robot.names[fast]
    assert sentence.startswith(f"joint {fast + 1} '{name}' moves at 600.0 deg/s of ")
    ending = "; wrist nearly singular: q_5 = 2.0 deg (q_4 and q_6 can move without the tool)"
    assert sentence.endswith(ending) == (fast == 3)


def test_a_robot_without_names(load_scenario):
    """A DELTA robot is no chain; made-up, for its reach ends before it becomes singular."""
    settings = load_scenario("pfc_delta")
    station = build_station(settings, FOLDER)
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    now, before = station.log.first_instant(
        station.blocks, root, "law", station.law.layout.status.start
    )
    assert before is None
    scene = FaultScene(
        station.law, station.robot, station.task.projected_manifold, False, now, None
    )
    sentence = describe(Fault.SINGULAR, scene)
    assert sentence.startswith(f"robot singular at eta = {settings.reference.points[0]:.4g} m")
    assert "q_1 = 0.1781 m" in sentence or "q_2 = 0.186 m" in sentence or "q_3" in sentence


@pytest.mark.slow
@pytest.mark.parametrize(("num_joints", "name"), [(5, "robot"), (6, "wrist")])
def test_a_wrist_that_aims_its_tool(through_the_wrist, num_joints, name):
    """The fourth joint turns nothing but the tool about its axis where both are in line."""
    if num_joints == 5:
        through_the_wrist.robot.fixed_joints = {"joint_6": 0.0}
    through_the_wrist.path.orientation.task = "tool_axis"
    posture = [0, 105, -25, 0, 25, 0][:num_joints]
    through_the_wrist.start = StartParameters(posture_deg=posture)
    station, root = run(through_the_wrist, 1.0)
    sentence = station.fault(root)
    assert sentence.startswith(f"{name} singular at eta = 0.")
    assert "q_5 = " in sentence and "(q_4 can move without the tool)" in sentence


@pytest.mark.slow
def test_a_tool_where_its_euler_angles_end(six_axes):
    """It starts tilted to the vertical, about the axis that the second angle turns about."""
    R_d = make_task(six_axes, FOLDER).start(np.zeros(3)).target.R_e
    first, second, third = matrix_to_zyz(R_d)
    there = zyz_to_matrix([first, np.deg2rad(0.01), third])
    six_axes.start.rotation_deg = np.rad2deg(matrix_to_zyx(R_d.T @ there)).tolist()
    six_axes.path.orientation = OrientationParameters("zyz", jacobian="analytic")
    assert np.rad2deg(second) > 15.0
    station, root = run(six_axes, 0.0)
    sentence = station.fault(root)
    assert sentence.startswith(f"{Fault.SINGULAR.explanation} at eta = 0.026 m")
    margin = re.search(r"the tool's zyz angles are (\S+) deg from their singularity", sentence)
    assert float(margin.group(1)) == pytest.approx(0.01, rel=0.1)
