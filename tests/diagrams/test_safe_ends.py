"""End of runs after a fault: the simulation continues until the robot is at rest."""

from dataclasses import replace

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, GainParameters, LawGains
from experiments.scenario_file import find_scenario
from experiments.simulation import simulate
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.control.compliance.measured_wrench import SensorFault
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

SCENARIOS = find_scenario("pfc_compliant_6r").parent
AFTER = 0.7


@pytest.fixture
def soft(load_scenario):
    """Three axes with soft elastic joints on their way at 1.5 m/s."""
    settings = load_scenario("pfc_elastic_3r")
    settings.reference.dwell, settings.start.offset = 0.05, [0.0, 0.0]
    return settings


@pytest.fixture
def seven(load_scenario):
    """Return seven light axes with elastic joints, or rigid ones, on their way."""

    def make(name="pfc_elastic_7r"):
        settings = load_scenario(name)
        settings.reference.dwell, settings.start.transition = 0.05, 0.0
        settings.start.offset, settings.start.rotation_deg = [0.0, 0.0], [0.0, 0.0, 0.0]
        return settings

    return make


@pytest.fixture
def six_axes(load_exact_scenario):
    settings = load_exact_scenario("pfc_compliant_6r")
    settings.reference.dwell = 0.1
    return settings


def go_on(settings, duration, after=AFTER):
    """Simulate into a fault and on; return station, result, times, and what was logged."""
    if settings.simulation.integrator == "auto":
        settings.simulation.integrator = "runge_kutta3"
    settings.simulation.fused = True
    station = build_station(settings, SCENARIOS)
    progress = [lambda *_: None]
    result = simulate(station, settings.simulation, duration, *progress, after_fault=after)
    times, log = station.log.read(result.root)
    return station, result, times, log


def check_rest(station, result, times, log, *, degrees=5.0):
    """The joints stand soon after the fault, and stay where they are."""
    assert result.fault is not None
    n = station.robot.dimension
    q, v = log["joint_state"][:, :n], log["joint_state"][:, n : 2 * n]
    fault = np.searchsorted(times, result.fault_time - 1e-9)
    stopped = times > result.fault_time + 0.6
    assert times[-1] > result.fault_time + AFTER - 1e-9
    assert np.abs(v[stopped]).max() < 0.05
    assert np.rad2deg(np.abs(q[stopped] - q[stopped][0]).max()) < 1.0
    assert np.rad2deg(np.abs(q[stopped] - q[fault]).max()) < degrees
    drive = log.get("drive_torque", log["law"][:, station.law.layout.drive])
    assert np.isfinite(drive).all()


@pytest.mark.slow(but="4-frozen")
@pytest.mark.parametrize("kind", ["nan", "frozen", "jump"])
@pytest.mark.parametrize("component", [1, 4, 7, 10])
def test_a_sensor_of_an_elastic_joint(soft, kind, component):
    failure = soft.simulation.sensor_failure
    failure.time, failure.kind, failure.component = 0.35, kind, component
    failure.size = 0.02 if component in (1, 7) else 1.0
    station, result, times, log = go_on(soft, 1.0)
    name = {1: "q_J_2", 4: "v_J_2", 7: "q_M_2", 10: "v_M_2"}[component]
    assert f": {name} at eta = " in result.fault
    assert 0.35 <= result.fault_time < 0.45
    check_rest(station, result, times, log, degrees=6.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("nan", "v_M_2"),
        ("frozen", "q_M_4"),
        ("jump", "v_J_6"),
        ("frozen", "v_J_4"),
        ("jump", "q_M_2"),
        ("frozen", "v_M_6"),
    ],
)
def test_a_sensor_of_a_light_arm_with_more_joints_than_outputs(seven, kind, name):
    settings = seven()
    failure = settings.simulation.sensor_failure
    side, joint = ["q_J", "v_J", "q_M", "v_M"].index(name[:3]), int(name[4])
    failure.time, failure.kind, failure.component = 0.35, kind, 7 * side + joint - 1
    failure.size = 0.02 if name.startswith("q") else 1.0
    station, result, times, log = go_on(settings, 1.0)
    assert f": {name} at eta = " in result.fault
    assert 0.35 <= result.fault_time < 0.46
    check_rest(station, result, times, log)


@pytest.mark.slow
def test_a_fault_while_a_hand_holds_the_elbow(seven):
    """Held with 250 N/m, the arm stands; the hand moves on for a while."""
    settings = seven("pfc_elbow_7r")
    (push,) = settings.pushes
    push.begin, push.duration = 0.1, 0.3
    settings.simulation.sensor_failure.time = 0.45
    settings.simulation.sensor_failure.component = 17
    station, result, times, log = go_on(settings, 0.6)
    assert ": q_M_4 at eta = " in result.fault
    assert np.abs(log["push_wrench"]).max() > 5.0
    check_rest(station, result, times, log)


@pytest.mark.slow
def test_lost_frames_of_a_light_arms_bus(seven):
    settings = seven("pfc_panda_7r")
    settings.controller.law = "velocity_servo"
    settings.controller.gains = {
        "velocity_servo": LawGains(*[GainParameters(poles=[-20.0]) for _ in range(4)])
    }
    settings.servo.bus_delay = 2e-3
    settings.servo.lost.begin, settings.servo.lost.end = 0.6, np.inf
    station, result, times, log = go_on(settings, 1.0)
    assert result.fault.startswith(f"velocity_servo: {Fault.BUS_LOST.explanation} at eta")
    assert 0.61 < result.fault_time < 0.62
    check_rest(station, result, times, log)


@pytest.mark.slow
def test_brakes_hold_a_joint_of_which_nothing_is_measured(six_axes):
    failure = six_axes.simulation.sensor_failure
    failure.time, failure.component, failure.whole_joint = 0.35, 1, True
    six_axes.simulation.integrator, six_axes.forces = "runge_kutta3", []
    check_rest(*go_on(six_axes, 1.0))


@pytest.mark.slow
def test_brakes_hold_an_elastic_joint_of_which_nothing_is_measured(soft):
    """By default, with friction in the drives; of a robot without brakes they are requested."""
    failure = soft.simulation.sensor_failure
    failure.time, failure.component, failure.whole_joint = 0.35, 1, True
    soft.friction.f_c = [20.0, 30.0, 10.0]
    station, result, times, log = go_on(soft, 1.0)
    first = np.searchsorted(times, result.fault_time - 1e-9)

    def moved(log):
        """Return how far each joint is from where it was at the fault [deg]."""
        q = log["joint_state"][first:, : station.robot.dimension]
        return np.rad2deg(np.abs(q - q[0]))

    # motors are clamped, and links swing on springs without damping
    assert moved(log).max() < 8.0
    requested = log["stop_category"][:, 0]
    assert requested[first - 1] == -1.0 and requested[first] == 1.0
    assert np.flatnonzero(requested == 0.0)[0] == first + 50
    soft.faults.brakes = None
    requested = go_on(soft, 1.0)[3]["stop_category"][:, 0]
    assert requested[first] == 2.0 and requested[-1] == 0.0


@pytest.mark.slow
def test_brakes_stop_servos_that_have_lost_a_joint(seven):
    settings = seven("pfc_panda_7r")
    settings.controller.law = "velocity_servo"
    settings.controller.gains = {
        "velocity_servo": LawGains(*[GainParameters(poles=[-20.0]) for _ in range(4)])
    }
    failure = settings.simulation.sensor_failure
    failure.time, failure.component, failure.whole_joint = 0.35, 2, True
    station, result, times, log = go_on(settings, 0.6)
    check_rest(station, result, times, log)
    assert log["servo_stop_category"][-1] == 0.0


@pytest.mark.slow(but="jump--100.0-0.452-has jumped as no force does")
@pytest.mark.parametrize(
    ("kind", "size", "time", "expected"),
    [
        ("nan", 0.0, 0.45, "is lost"),
        ("jump", 1e4, 0.45, "is at the end of its range"),
        ("jump", -100.0, 0.452, "has jumped as no force does"),
    ],
)
def test_a_force_sensor(six_axes, kind, size, time, expected):
    failure = six_axes.simulation.force_sensor_failure
    six_axes.forces = [ForcePulse(begin=0.2, end=9.0, ramp=0.05, frame="world", force=[0, 20, 0])]
    failure.time, failure.kind, failure.size = 0.45, kind, size
    station, result, times, log = go_on(six_axes, 1.0)
    assert result.fault.startswith(f"the force/torque sensor {expected} at eta = ")
    assert result.fault_time == pytest.approx(time)
    check_rest(station, result, times, log)


@pytest.mark.slow
@pytest.mark.parametrize(("whole", "noisy"), [(False, True), (True, True), (True, False)])
def test_a_force_sensor_that_stands_still(six_axes, whole, noisy):
    failure = six_axes.simulation.force_sensor_failure
    failure.whole_joint = whole
    six_axes.sensor.noise = six_axes.sensor.noise * noisy
    six_axes.forces = [ForcePulse(begin=0.2, end=9.0, ramp=0.05, frame="world", force=[0, 20, 0])]
    failure.time, failure.kind, failure.component = 0.45, "frozen", 1
    station, result, times, log = go_on(six_axes, 1.0)
    assert result.fault.startswith("the force/torque sensor is lost at eta = ")
    assert result.fault_time == pytest.approx(0.5, abs=2e-3)
    check_rest(station, result, times, log)


def test_a_sensor_that_is_not_tared_may_be_at_the_end_of_its_range(six_axes):
    six_axes.sensor.measurement_range = np.full(6, 1.0)
    station, result, *_ = go_on(six_axes, 0.2)
    assert result.fault is None
    fault = station.blocks.output(result.root, "controller.tool_compensation.fault")
    assert fault == SensorFault.SATURATED


@pytest.mark.slow
def test_lost_frames_of_a_bus(six_axes):
    """Short losses are bridged; the servos stop when nothing has come for 10 ms."""
    six_axes.controller.law = "velocity_servo"
    six_axes.compliance = type(six_axes.compliance)()
    six_axes.sensor = None
    six_axes.servo.bus_delay = 2e-3
    six_axes.servo.lost.begin, six_axes.servo.lost.end = 0.4, 0.409
    assert go_on(six_axes, 0.5)[1].fault is None
    six_axes.servo.lost.end = np.inf
    station, result, times, log = go_on(six_axes, 1.0)
    assert result.fault.startswith(f"velocity_servo: {Fault.BUS_LOST.explanation} at eta")
    assert 0.41 < result.fault_time < 0.42
    check_rest(station, result, times, log)


@pytest.mark.slow
def test_a_joint_at_its_limit(six_axes, monkeypatch):
    """Axis 1 sets off to more than 5 deg beside where it starts."""
    six_axes.compliance = type(six_axes.compliance)()
    six_axes.sensor, six_axes.forces = None, []
    six_axes.reference.velocity = 0.5
    start = build_station(six_axes, SCENARIOS).start_posture[0]

    def narrow(plant, tool):
        chain, coordinates = chain_from_plant(plant, tool)
        first = replace(chain.links[0], position_limits=tuple(start + np.deg2rad([-4.0, 4.0])))
        return replace(chain, links=(first, *chain.links[1:])), coordinates

    monkeypatch.setattr("diagrams.robots.arm_model.chain_from_plant", narrow)
    station, result, times, log = go_on(six_axes, 2.0)
    assert result.fault.startswith("joint 1 'joint_1' is at its limit of ")
    check_rest(station, result, times, log)


@pytest.mark.slow
def test_a_drive_at_its_limit_for_long(soft):
    soft.controller.effort_scale, soft.faults.saturation_time = 0.05, 0.02
    _, result, *_ = go_on(soft, 0.5, after=0.0)
    assert result.fault.startswith(f"{Fault.DRIVE_SATURATED.explanation}: ")


@pytest.mark.slow
def test_three_free_turns_about_the_tools_axis(six_axes):
    """The reference turns on and on, and the angles with it."""
    compliance = six_axes.compliance
    compliance.transversal = CoordinateImpedance()
    compliance.rotational = CoordinateImpedance(Profile(0.02), Profile(0.25), Profile(0.0))
    six_axes.reference.points, six_axes.faults.joint_limits = [0.3, 0.3], False
    station = build_station(six_axes, SCENARIOS)
    R_e = np.array(pose_function(station.robot)(station.start_posture)).ravel()[3:].reshape(3, 3)
    turn = ForcePulse(begin=0.2, end=3.4, ramp=0.1, frame="world", torque=2.0 * R_e[:, 2])
    six_axes.forces = [turn]
    station, result, _, log = go_on(six_axes, 2.8)
    assert result.fault is None
    m = station.law.linearization.num_outputs
    phi = log["law"][:, station.law.layout.manifold_state][:, 3:6]
    assert phi[-1, 0] > 3.0 * 2.0 * np.pi
    assert np.abs(np.diff(phi, axis=0)).max() < 0.05
    assert np.abs(phi - log["reference"].reshape(len(phi), -1, m)[:, 0, 3:6]).max() < 0.02
    drive = log["law"][:, station.law.layout.drive]
    # the sensor's noise alone takes some 40 Nm a tick of axis 1; the limits are 1800 Nm
    assert np.abs(np.diff(drive[300:], axis=0)).max() < 100.0
    assert np.abs(drive[300:]).max() < 600.0


@pytest.mark.slow
@pytest.mark.parametrize("end", [0, 1])
def test_at_the_end_of_an_open_path(load_exact_scenario, end):
    """Pushed against the end at 0.4 m/s, which is a wall; the tool turned on the way to it."""
    settings, sign = load_exact_scenario("operator_hand_6r"), 2 * end - 1
    settings.hand = None
    settings.reference.points = [[0.08, 0.08], [0.94, 0.94]][end]
    if end:
        settings.start.posture_deg = [25, 115, -40, -5, 95, -17]
    settings.forces = [
        ForcePulse(begin=0.3, end=1.0, ramp=0.05, frame="manifold", force=[sign * 25.0, 0, 0])
    ]
    station, result, _, log = go_on(settings, 1.0)
    assert result.fault is None
    eta = log["manifold_point"][:, station.task.projected_manifold.layout.eta]
    beyond = (eta - station.path.length if end else -eta)[300:, 0]
    assert beyond[-1] > -1e-3 and beyond.max() < 1e-3
    drive = log["law"][:, station.law.layout.drive]
    # rigid joints brake from one sample to the next; a reference that ends takes 1,000 Nm
    assert np.abs(np.diff(drive[350:], axis=0)).max() < 120.0
    assert np.abs(drive).max() < 400.0
