"""The path following station: connections, and times at which signals act."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, GainParameters, LawGains
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model

ENCODERS = ("joint_encoders", "y0")
WIRES = {
    ("plant", "state"): {("joint_encoders", "u0")},
    ENCODERS: {
        ("controller", "joint_state"),
        ("brake_torque", "joint_state"),
        ("holding_brakes", "joint_state"),
        ("log_signals", "joint_state"),
    },
    **{
        ("controller", name): {("log_signals", name)}
        for name in ("tool_pose", "manifold_point", "reference", "law")
    },
    ("controller", "stop_category"): {
        ("holding_brakes", "request_0"),
        ("log_signals", "stop_category"),
    },
    ("holding_brakes", "anchor"): {("brake_torque", "anchor")},
    ("holding_brakes", "give"): {("brake_torque", "give")},
    ("brake_torque", "resistance"): {("resistance", "u0")},
    ("resistance", "y0"): {("plant", "applied_generalized_force")},
    ("controller", "drive_torque"): {("hold", "value")},
    ("hold", "held"): {("drives", "u0")},
    ("drives", "y0"): {("plant", "actuation")},
    ("log_signals", "all"): {("log", "data")},
}
OF_CONTROLLER = {
    ("measured_state", "all"): {
        ("tool_kinematics", "joint_state"),
        ("following_controller", "joint_state"),
    },
    ("tool_kinematics", "tool_pose"): {("path_projector", "tool_pose")},
    ("path_projector", "manifold_point"): {("following_controller", "manifold_point")},
    ("reference_generator", "reference"): {("following_controller", "reference")},
}


@pytest.fixture
def settings(load_scenario):
    """The three-axis scenario with a law that is compiled fast."""
    settings = load_scenario("pfc_elastic_3r")
    settings.controller.law = "singular_perturbation"
    return settings


@pytest.fixture
def station(settings):
    return build_station(settings, Path())


def wires(diagram):
    found = {}
    for (system, index), (source, port) in diagram.connection_map().items():
        begin = (source.get_name(), source.get_output_port(port).get_name())
        end = (system.get_name(), system.get_input_port(index).get_name())
        found.setdefault(begin, set()).add(end)
    return found


def start(station):
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.Initialize()
    return simulator, simulator.get_mutable_context()


def test_a_second_station_shares_functions_and_nothing_that_changes(settings, station):
    again = build_station(settings, Path())
    assert again.law.function is station.law.function
    assert again.law is not station.law
    assert again.diagram is not station.diagram


@pytest.mark.slow
def test_a_station_that_differs_in_one_number_has_functions_of_its_own(settings, station):
    settings.controller.max_alpha = np.nextafter(settings.controller.max_alpha, 0.0)
    other = build_station(settings, Path())
    assert other.law.function is not station.law.function
    # what that number does not enter is the same
    assert other.law.linearization.function is station.law.linearization.function
    settings.model_error.mass = [np.nextafter(1.0, 2.0), 1.0, 1.0]
    heavier = build_station(settings, Path())
    assert heavier.law.linearization.function is not other.law.linearization.function


def test_wiring(station):
    assert wires(station.diagram) == WIRES
    assert wires(station.diagram.GetSubsystemByName("controller")) == OF_CONTROLLER
    assert station.diagram.get_name() == "pfc_elastic_3r"
    assert station.diagram.num_input_ports() == 0


def test_the_rigid_law_sees_the_motors_only(settings):
    """Its path point belongs to where the tool would be without deflection."""
    settings.controller.law = "rigid"
    station = build_station(settings, Path())
    _, root = start(station)
    controller = station.diagram.GetSubsystemByName("controller")
    pose = controller.GetOutputPort("tool_pose").Eval(controller.GetMyContextFromRoot(root))
    x = station.initial_state.copy()
    assert np.abs(x[1:6:2]).max() > 1e-3
    x[1:6:2] = 0.0  # the joints' deflections
    context = station.part.plant.CreateDefaultContext()
    station.part.plant.SetPositionsAndVelocities(context, x)
    tool = station.part.plant.GetFrameByName("tool_point").CalcPoseInWorld(context)
    np.testing.assert_allclose(pose[:3], tool.translation(), atol=1e-12)


def test_a_failing_sensor_is_between_encoders_and_everything_else(settings):
    settings.simulation.sensor_failure.time = 0.1
    expected = dict(WIRES)
    # brakes are a part of the robot
    brakes = {(name, "joint_state") for name in ("holding_brakes", "brake_torque")}
    readers, log = expected[ENCODERS] - brakes, brakes | {("log_signals", "joint_state")}
    found = wires(build_station(settings, Path()).diagram)
    # the log has the truth, and what was delivered beside it
    assert found[ENCODERS] == log | {("sensor_failure", "measured")}
    delivered = found[("sensor_failure", "delivered")]
    assert readers - log <= delivered
    assert delivered == readers - log
    assert found["controller", "joint_state"] == {("log_signals", "joint_state_measured")}


@pytest.mark.parametrize("component", [-1, 12])
def test_a_sensor_that_is_not_there(settings, component):
    settings.simulation.sensor_failure.time = 0.1
    settings.simulation.sensor_failure.component = component
    with pytest.raises(InputError) as caught:
        build_station(settings, Path())
    for part in ("sensor_failure.component", str(component), "0 to 11"):
        assert part in str(caught.value)


def test_encoders_measure_links_and_motors(station, load_arm):
    _, root = start(station)
    x = np.random.default_rng(3).normal(size=12)
    station.part.plant.SetPositionsAndVelocities(
        station.part.plant.GetMyMutableContextFromRoot(root), x
    )
    encoders = station.diagram.GetSubsystemByName("joint_encoders")
    measured = encoders.get_output_port().Eval(encoders.GetMyContextFromRoot(root))
    arm = load_arm("comau_racer_1_4_elastic_3r")
    arm.set_state(x)
    motor, flex = arm.angles("motor"), arm.angles("flex")
    rates = [
        [arm.plant.GetJointByName(f"{kind}_{i}").get_angular_rate(arm.context) for i in (1, 2, 3)]
        for kind in ("motor", "flex")
    ]
    expected = [*(motor + flex), *np.sum(rates, axis=0), *motor, *rates[0]]
    np.testing.assert_allclose(measured, expected, atol=1e-14)


def test_start(station):
    _, root = start(station)
    plant = station.part.plant.GetMyContextFromRoot(root)
    x = station.part.plant.GetPositionsAndVelocities(plant)
    np.testing.assert_array_equal(x, station.initial_state)
    point = station.blocks.output(root, "controller.path_projector.manifold_point")
    layout = station.task.projected_manifold.layout
    assert point[layout.theta][0] == pytest.approx(station.initial_projection[0], abs=1e-12)
    assert point[layout.eta][0] == pytest.approx(0.96, abs=1e-9)


def test_torque_is_held_from_the_tick_on(station):
    """Within an interval the plant gets what the law gave at the interval's begin."""
    simulator, root = start(station)
    held = []
    for tick in range(1, 6):
        simulator.AdvanceTo((tick + 0.5) * 1e-3)
        plant = station.part.plant.GetMyContextFromRoot(root)
        held.append(station.part.plant.get_actuation_input_port().Eval(plant))
    times, signals = station.log.read(root)
    np.testing.assert_allclose(times, np.arange(6) * 1e-3, atol=1e-12)
    drive = signals["law"][:, station.law.layout.drive]
    np.testing.assert_array_equal(held, drive[1:])
    assert np.all(np.abs(np.diff(drive, axis=0)).max(axis=1) > 1e-6)  # it does change


def test_a_force_is_held_like_the_torque(settings):
    """Between the ticks it is that of the tick before, though it swells."""
    push = ForcePulse(0.0, 1.0, np.array([10.0, 20.0, -30.0]), ramp=0.02)
    settings.forces = [push]
    station = build_station(settings, Path())
    simulator, root = start(station)
    plant = station.part.plant
    for tick in (3, 7, 12):
        simulator.AdvanceTo((tick + 0.6) * 1e-3)
        port = plant.get_applied_spatial_force_input_port()
        (force,) = port.Eval(plant.GetMyContextFromRoot(root))
        got = force.F_Bq_W.translational()
        np.testing.assert_allclose(got, push.at(tick * 1e-3).full().ravel()[:3], rtol=1e-12)


def test_log_holds_every_signal(station):
    simulator, root = start(station)
    simulator.AdvanceTo(2e-3)
    _, signals = station.log.read(root)
    layout = station.task.projected_manifold.layout
    assert {name: x.shape for name, x in signals.items()} == {
        "joint_state": (3, 12),
        "tool_pose": (3, 12),
        "manifold_point": (3, layout.size),
        "reference": (3, 9),
        "law": (3, station.law.layout.size),
        "stop_category": (3, 1),
    }
    controller = station.diagram.GetSubsystemByName("controller")
    pose = controller.GetOutputPort("tool_pose").Eval(controller.GetMyContextFromRoot(root))
    np.testing.assert_array_equal(signals["tool_pose"][-1], pose)


def test_reference_lasts_as_long_as_its_moves(settings):
    settings.reference.points = [0.96, 1.0]
    settings.reference.velocity, settings.reference.acceleration = 0.01, 1.0
    settings.reference.dwell = 0.25
    station = build_station(settings, Path())
    # two rests, cruise and two ramps that cover half of the cruise's way: 35/16 v/a each
    expected = 2 * 0.25 + 0.04 / 0.01 + 35.0 / 16.0 * 0.01 / 1.0
    assert station.reference_duration == pytest.approx(expected, abs=1e-9)


def test_a_joint_without_drive(settings, tmp_path):
    text = resolve_model("comau_racer_1_4_elastic_3r").read_text(encoding="utf-8")
    assert text.count("<effort>900</effort>") == 1
    lame = text.replace("<effort>900</effort>", "<effort>0</effort>")
    (tmp_path / "lame.sdf").write_text(lame, encoding="utf-8")
    settings.robot.model = "lame.sdf"
    with pytest.raises(InputError, match=r"robot\.model.*actuator"):
        build_station(settings, tmp_path)


@pytest.mark.slow
def test_a_law_for_velocity_servos_needs_its_own_gains(settings):
    settings.controller.law = "velocity_servo"
    with pytest.raises(InputError, match=r"controller\.gains.*velocity_servo"):
        build_station(settings, Path())
    poles = GainParameters(poles=[-3.0])
    settings.controller.gains["velocity_servo"] = LawGains(poles, poles)
    station = build_station(settings, Path())
    assert station.diagram.HasSubsystemNamed("velocity_servo")


def test_drives_go_to_their_joints_in_any_order(settings, tmp_path):
    """Actuators of a plant are in the order of the file, which need not be the chain's."""
    text = resolve_model("comau_racer_1_4_elastic_3r").read_text(encoding="utf-8")
    begin, end = (text.index(f'<joint name="motor_{i}"') for i in (1, 2))
    end = text.index("</joint>", begin) + len("</joint>")
    joint = text[begin:end]
    moved = (text[:begin] + text[end:]).replace("</model>", joint + "</model>", 1)
    (tmp_path / "moved.sdf").write_text(moved, encoding="utf-8")
    settings.robot.model = "moved.sdf"
    station = build_station(settings, tmp_path)
    plant = station.part.plant
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    order = [actuator.joint().name() for actuator in actuators]
    assert order != ["motor_1", "motor_2", "motor_3"]
    drives = station.diagram.GetSubsystemByName("drives")
    context = drives.CreateDefaultContext()
    drives.get_input_port().FixValue(context, [1.0, 2.0, 3.0])
    actuation = drives.get_output_port().Eval(context)
    expected = {"motor_1": 1.0, "motor_2": 2.0, "motor_3": 3.0}
    assert dict(zip(order, actuation, strict=True)) == expected


@pytest.mark.slow
def test_warning_only_where_joints_resonate_too_fast(settings):
    settings.controller.law = "elastic"
    assert build_station(settings, Path()).warnings == []
    settings.controller.sampling_time = 1e-2
    (warning,) = build_station(settings, Path()).warnings
    assert "rad per sampling interval" in warning
    settings.controller.law = "rigid"
    (warning,) = build_station(settings, Path()).warnings  # of joints that bend
    assert "sampling" not in warning
