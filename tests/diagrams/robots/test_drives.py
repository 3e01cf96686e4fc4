"""Servos, bus, friction and encoders of a path following station."""

import re
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, GainParameters, LawGains, Scenario
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory, resolve_model
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.robot_model import gravity_function

KNOWN = load_parameters("comau_racer_1_4").friction
TICK = 1e-3


@pytest.fixture
def settings(load_scenario) -> Scenario:
    """Three rigid axes, at rest on the path."""
    settings = load_scenario("pfc_elastic_3r")
    settings.robot.model = "comau_racer_1_4_3r"
    settings.controller.law = "rigid"
    poles, slow = GainParameters(poles=[-50.0, -50.0]), GainParameters(poles=[-20.0])
    settings.controller.gains = {"rigid": LawGains(poles, poles)}
    settings.controller.gains["velocity_servo"] = LawGains(slow, slow)
    settings.start.offset = [0.0, 0.0]
    settings.reference.points, settings.reference.dwell = [0.96, 0.90], 0.05
    settings.reference.velocity, settings.reference.acceleration = 0.2, 2.0
    return settings


def build(settings):
    return build_station(settings, Path())


def run(settings, duration, max_step=TICK):
    station = build(settings)
    simulator = Simulator(station.diagram)
    configuration = SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=max_step, use_error_control=False
    )
    ApplySimulatorConfig(configuration, simulator)
    station.set_start(simulator.get_mutable_context())
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    return station, *station.log.read(simulator.get_context())


def names(station):
    return {system.get_name() for system in station.diagram.GetSystems()}


def deviation(station, signals):
    m = station.law.linearization.num_outputs
    y = signals["law"][:, station.law.layout.manifold_state][:, :m]
    return np.abs(y - signals["reference"][:, :m]).max(axis=0)


def test_nothing_is_added_unless_asked_for(settings):
    assert not names(build(settings)) & {
        "velocity_servo",
        "bus_delay",
        "joint_friction",
        "encoder_increments",
        "force_torque_sensor",
        "impedance_filter",
    }


@pytest.mark.slow
def test_velocity_servos_follow_the_path(settings):
    settings.controller.law = "velocity_servo"
    station, t, signals = run(settings, 0.4)
    assert t[-1] == pytest.approx(0.4)
    n = station.robot.dimension
    wanted = signals["law"][:, station.law.layout.drive]
    # the default bandwidth of 200 rad/s at up to 1 rad/s^2
    assert np.abs(wanted - signals["joint_state"][:, 3 * n :])[t > 0.01].max() < 0.02
    assert np.abs(wanted).max() > 0.1
    assert deviation(station, signals).max() < 1e-3
    limits = station.robot.gather("effort_limit")
    assert (np.abs(signals["drive_torque"]) <= limits).all()


def test_servos_hold_the_weight_at_the_start(settings, load_arm):
    settings.controller.law = "velocity_servo"
    station, _, signals = run(settings, 2 * TICK)
    arm = load_arm("comau_racer_1_4_3r")
    weight = arm.weight(station.initial_state[:3])
    np.testing.assert_allclose(signals["drive_torque"][0], weight, atol=1e-6)


def test_servos_without_integral_part_answer_at_once(settings, load_arm):
    """``g + K_w (v_ref - v)`` with ``K_w = J (1 - exp(-omega T)) / T``, J at the start."""
    settings.controller.law = "velocity_servo"
    settings.servo.integral_rate = 0.0
    settings.start.offset = [0.005, 0.0]
    station, _, signals = run(settings, 0.02)
    arm = load_arm("comau_racer_1_4_3r")
    arm.plant.SetPositions(arm.context, station.initial_state[:3])
    J = np.diag(arm.plant.CalcMassMatrix(arm.context))
    gain = J * (1.0 - np.exp(-settings.servo.bandwidth * TICK)) / TICK
    lag = signals["law"][:, station.law.layout.drive] - signals["joint_state"][:, 9:]
    weight = np.array([arm.weight(q) for q in signals["joint_state"][:, :3]])
    assert np.abs(gain * lag).max() > 10.0
    np.testing.assert_allclose(signals["drive_torque"], weight + gain * lag, rtol=0, atol=1e-6)


def test_servos_keep_the_scaled_limits(settings, load_arm):
    """Weaker drives than the model's: servos that start off the path use them up, no more."""
    settings.controller.law = "velocity_servo"
    settings.start.offset = [0.02, 0.0]
    full, _, signals = run(settings, 0.02)
    wanted = np.abs(signals["drive_torque"]).max(axis=0) / full.robot.gather("effort_limit")
    weight = np.abs(load_arm("comau_racer_1_4_3r").weight(full.initial_state[:3]))
    scale = 0.5 * wanted.max()
    assert np.all(weight < scale * full.robot.gather("effort_limit"))
    settings.controller.effort_scale = scale
    station, _, signals = run(settings, 0.02)
    used = np.abs(signals["drive_torque"]) / station.robot.gather("effort_limit")
    assert used.max() == pytest.approx(scale, rel=1e-12)


def test_torques_act_late_and_through_a_low_pass(settings):
    """Until the first one comes, the drives hold the weight."""
    settings.driver.delay, settings.driver.low_pass = 2 * TICK, 50.0
    settings.controller.delay = 3 * TICK
    station = build(settings)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    weight = gravity_function(station.robot)(station.start_posture).full().ravel()
    acting = []
    for k in range(60):
        simulator.AdvanceTo((k + 0.5) * TICK)
        acting.append(station.blocks.output(root, "hold.held"))
    _, signals = station.log.read(root)
    commands = signals["law"][:, station.law.layout.drive]
    assert np.abs(np.diff(commands[-20:], axis=0)).max() > 0.1
    w = 2.0 * np.pi * 50.0 * TICK
    passed = [commands[0]]
    for torque in commands[1:]:
        passed.append(passed[-1] + w / (1.0 + w) * (torque - passed[-1]))
    np.testing.assert_allclose(acting[:2], [weight, weight], rtol=1e-9)
    np.testing.assert_allclose(acting[2:], passed[:58], rtol=1e-9)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("delay", 1.5 * TICK, "driver.delay = 0.0015; allowed: a multiple of the sampling time"),
        ("delay", 2.0, "driver.delay = 2.0; allowed: .* at most 1,000 of it"),
    ],
)
def test_delays_that_cannot_be(settings, key, value, said):
    setattr(settings.driver, key, value)
    with pytest.raises(InputError, match=said):
        build(settings)


def test_a_law_knows_of_ten_ticks_at_most(settings):
    settings.controller.delay = 11 * TICK
    with pytest.raises(InputError, match=r"controller.delay = 0.011; allowed: .* at most 10"):
        build(settings)


def test_servos_have_a_bus_instead(settings):
    settings.controller.law, settings.driver.delay = "velocity_servo", TICK
    with pytest.raises(InputError, match=r"driver = .*; allowed: none with the law 'velocity_s"):
        build(settings)


def test_a_bus_delays_by_its_time(settings):
    """A velocity law that starts off the path: the first wanted velocity arrives 3 ticks late."""
    settings.controller.law = "velocity_servo"
    settings.servo.bus_delay = 3 * TICK
    simulator = Simulator((station := build(settings)).diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    delivered = []
    for tick in range(80):
        simulator.AdvanceTo((tick + 0.5) * TICK)
        delivered.append(station.blocks.output(root, "bus_delay.delivered"))
    _, signals = station.log.read(root)
    sent = signals["law"][:, station.law.layout.drive]
    assert np.abs(np.diff(sent[-20:], axis=0)).max() > 1e-5
    np.testing.assert_array_equal(delivered[3:], sent[: len(delivered) - 3])


def test_a_bus_samples_at_the_ticks_of_the_law_whatever_the_servo_does(settings):
    """Else the law would be evaluated between its ticks, with a measurement it never got."""
    settings.controller.law = "velocity_servo"
    settings.servo.bus_delay, settings.servo.period = 2 * TICK, TICK / 4
    settings.start.offset = [0.005, 0.0]
    station = build(settings)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    delivered = []
    for quarter in range(40):
        simulator.AdvanceTo((quarter + 0.5) * TICK / 4)
        delivered.append(station.blocks.output(root, "bus_delay.delivered"))
    sent = station.log.read(root)[1]["law"][:, station.law.layout.drive]
    np.testing.assert_array_equal(delivered[8:], np.repeat(sent, 4, axis=0)[:32])


@pytest.mark.slow
def test_a_faster_servo_gets_the_velocity_of_the_tick(settings):
    settings.controller.law = "velocity_servo"
    settings.servo.period = 0.25 * TICK
    station, _, signals = run(settings, 0.3)
    assert "velocity_hold" in names(station)
    assert deviation(station, signals).max() < 1e-3


@pytest.mark.slow(but="increments1")
@pytest.mark.parametrize("increments", [[], [2000.0]])
def test_friction_acts_against_the_motion(settings, increments):
    """The true one, whatever the encoders make of it."""
    settings.encoders.motor_increments = increments
    settings.encoders.difference_quotient = bool(increments)
    settings.encoders.filter_time = 0.02 if increments else 0.0
    settings.friction.f_c, settings.friction.f_v = [40.0, 100.0, 20.0], [15.0, 90.0, 40.0]
    _, _, signals = run(settings, 0.3)
    velocity = signals["joint_state"][:, 9:]
    torque = signals["friction_torque"]
    moving = np.abs(velocity) > 0.03
    assert moving.sum(axis=0).max() > 50
    expected = np.array([40.0, 100.0, 20.0]) * np.sign(velocity)
    expected += np.array([15.0, 90.0, 40.0]) * velocity
    np.testing.assert_allclose(torque[moving], expected[moving], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("step", "softness"), [(TICK / 4, 1 / 16), (TICK / 4, 1.0), (4 * TICK, 1)])
def test_stuck_joints_give_way_by_their_presliding(settings, step, softness):
    """Steps change nothing; a presliding that is given does."""
    settings.friction.f_c = [100.0, 100.0, 100.0]
    settings.reference.dwell = 1.0
    settings.forces = [ForcePulse(0.0, 1.0, np.array([0.0, 30.0, 0.0]), ramp=0.02)]
    bends = []
    for max_step in (TICK, step):
        settings.simulation.max_step = max_step
        if max_step < TICK and softness < 1.0:
            friction = build(settings).diagram.GetSubsystemByName("joint_friction")
            settings.friction.presliding = list(softness * friction.law.presliding)
        _, _, signals = run(settings, 0.1, max_step)
        bends.append(signals["joint_state"][-1, 0] - signals["joint_state"][0, 0])
    assert np.abs(signals["friction_torque"][-1, 0]) > 10.0
    assert bends[1] == pytest.approx(softness * bends[0], rel=0.05)


def test_friction_reaches_the_joints(settings):
    """It takes the power off the arm: the same drives accelerate less."""
    without, _, _ = run(settings, 0.01)
    settings.friction.f_v = [10.0, 20.0, 30.0]
    settings.friction.f_c = [0.0, 0.0, 0.0]
    station = build(settings)
    root = station.diagram.CreateDefaultContext()
    x = without.initial_state.copy()
    x[3:] = [0.3, -0.2, 0.1]
    station.part.plant.SetPositionsAndVelocities(
        station.part.plant.GetMyMutableContextFromRoot(root), x
    )
    force = station.part.plant.get_applied_generalized_force_input_port()
    applied = force.Eval(station.part.plant.GetMyContextFromRoot(root))
    np.testing.assert_allclose(applied, [-3.0, 4.0, -3.0], atol=1e-12)


def test_friction_is_that_of_the_motors(settings):
    """The links of elastic joints swing, the friction is in the drives."""
    settings.robot.model = "comau_racer_1_4_elastic_3r"
    settings.friction.f_v = [15.0, 90.0, 40.0]
    _, _, signals = run(settings, 0.2)
    _, v_J, _, v_M = np.hsplit(signals["joint_state"], 4)
    assert np.abs(v_M - v_J).max() > 1e-3
    np.testing.assert_allclose(signals["friction_torque"], v_M * [15.0, 90.0, 40.0], atol=1e-9)


def test_friction_goes_with_error_control_by_any_scheme(settings):
    settings.friction.f_v = [15.0, 90.0, 40.0]
    settings.simulation.integrator, settings.simulation.accuracy = "implicit_euler", 1e-4
    assert "joint_friction" in names(build(settings))


def test_friction_needs_rotors(settings, tmp_path):
    """A drive without inertia of its own could not stick at any step."""
    text = resolve_model("comau_racer_1_4_3r").read_text(encoding="utf-8")
    bare, count = re.subn(r"<drake:rotor_inertia>[^<]*<", "<drake:rotor_inertia>0<", text)
    assert count == 3
    (tmp_path / "bare.sdf").write_text(bare, encoding="utf-8")
    settings.robot.model = "bare.sdf"
    build_station(settings, tmp_path)
    settings.friction.f_c = [1.0, 1.0, 1.0]
    with pytest.raises(
        InputError, match=r"friction: .* rotor inertia.*joint_2.*robot\.elastic\.rotor_inertia"
    ):
        build_station(settings, tmp_path)


@pytest.mark.slow
def test_friction_of_the_robot_itself(settings):
    settings.friction.file = "comau_racer_1_4"
    by_name = run(settings, 0.1)[2]["friction_torque"]
    settings.friction.file = str(models_directory() / "comau_racer_1_4" / "parameters.yaml")
    by_path = run(settings, 0.1)[2]["friction_torque"]
    settings.friction.file = ""
    settings.friction.f_c, settings.friction.f_v = list(KNOWN.coulomb[:3]), list(KNOWN.viscous[:3])
    np.testing.assert_array_equal(by_name, run(settings, 0.1)[2]["friction_torque"])
    np.testing.assert_array_equal(by_name, by_path)
    assert np.abs(by_name).max() > 1.0


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"friction.f_c": [1.0]}, r"friction\.f_c = \[1\.0\]; allowed: 3 values"),
        ({"friction.file": "unknown"}, "unknown.*comau_racer_1_4"),
        ({"friction.f_v": [1.0] * 3, "simulation.integrator": "explicit_euler"}, "integrator"),
        ({"controller.law": "velocity_servo", "servo.bandwidth": 2000.0}, "bandwidth.*1000"),
        ({"encoders.link_increments": [1.0, 2.0]}, "link_increments"),
    ],
)
def test_what_does_not_fit(settings, changes, part):
    for key, value in changes.items():
        group, name = key.split(".")
        setattr(getattr(settings, group), name, value)
    with pytest.raises(InputError, match=part):
        build(settings)


def test_encoders_count(settings):
    settings.encoders.link_increments = [10_000.0]
    settings.encoders.motor_increments = [1e6]
    _, _, signals = run(settings, 0.2)
    q_J, v_J, q_M, _ = np.hsplit(signals["joint_state_measured"], 4)
    for q, increments in ((q_J, 1e4), (q_M, 1e6)):
        counts = q * increments / (2.0 * np.pi)
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    # exact velocities do not show increments
    assert np.abs(np.diff(q_J, axis=0)).max() > 0.0
    assert np.unique(v_J[100:]).size > 250


def test_encoders_differentiate(settings):
    settings.encoders.motor_increments = [1e8]
    settings.encoders.link_increments = [1e8]
    settings.encoders.difference_quotient = True
    _, _, signals = run(settings, 0.2)
    q_J, v_J, _, _ = np.hsplit(signals["joint_state_measured"], 4)
    np.testing.assert_allclose(v_J[1:], np.diff(q_J, axis=0) / TICK, atol=1e-9)


def test_encoders_of_a_fast_servo_differentiate_over_its_own_period(settings):
    """Else it would act on a velocity that is up to three of its periods old."""
    settings.controller.law = "velocity_servo"
    period = settings.servo.period = TICK / 4
    settings.encoders.link_increments = settings.encoders.motor_increments = [1e8]
    settings.encoders.difference_quotient = True
    station = build(settings)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    plant, measured, torques = station.part.plant, [], []
    for tick in range(400):
        simulator.AdvanceTo(tick * period)
        actuation = plant.get_actuation_input_port()
        torques.append(actuation.Eval(plant.GetMyContextFromRoot(root)))
        measured.append(station.blocks.output(root, "encoder_increments.joint_state")[6:])
    q_M, v_M = np.hsplit(np.array(measured), 2)
    assert np.abs(v_M[-1]).max() > 1e-2
    np.testing.assert_allclose(v_M[1:], np.diff(q_M, axis=0) / period, atol=1e-9)
    # and its torques act over one of its periods
    assert np.abs(np.diff(torques[300:], axis=0)).max(axis=1).min() > 0.0


def presliding(settings, step, given=()):
    settings.friction.f_c, settings.friction.f_v = [30.0, 40.0, 25.0], [3.0, 2.0, 1.0]
    settings.friction.presliding, settings.simulation.max_step = list(given), step
    friction = build(settings).diagram.GetSubsystemByName("joint_friction")
    return friction.law.presliding


def test_shorter_steps_do_not_change_friction(settings):
    np.testing.assert_array_equal(presliding(settings, 2e-4), presliding(settings, 1e-3))


def test_the_presliding_is_that_given_if_steps_integrate_it(settings):
    least = presliding(settings, 1e-3)
    given = [2.0 * least[0], 0.25 * least[1], 3.0 * least[2]]
    with pytest.raises(InputError, match=r"friction.presliding = .* of joint 2: steps of 0.001 s"):
        presliding(settings, 1e-3, given)
    np.testing.assert_array_equal(presliding(settings, 4.9e-4, given), given)
