"""Path following of a user's own plant: one call, a diagram, and what it refuses."""

import logging
import re
import subprocess

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import MatrixGain

import pfsc_drake
from pfsc_drake import (
    ControllerParameters,
    FollowerOptions,
    GainParameters,
    LawGains,
    StreamLimits,
    Swing,
    WaypointTable,
    add_actuators,
    add_path_following,
    path_from_waypoints,
)
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from tests.compilers import needs_gcc

POINTS = [[0.9, -0.3, 0.8], [1.0, 0.0, 0.9], [0.9, 0.3, 0.8], [0.8, 0.0, 0.75]]


@pytest.fixture(scope="module", name="path")
def fixture_path():
    return path_from_waypoints(WaypointTable(np.array(POINTS)), smoothness=6, closed=True)


def load(builder, name):
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(models_directory() / "comau_racer_1_4" / f"{name}.sdf"))
    plant.Finalize()
    return plant


def closed_loop(path, model, law, options=None, **changes):
    """Return a simulator with the robot at the start, and the follower."""
    builder = DiagramBuilder()
    plant = load(builder, model)
    follower = add_path_following(
        builder, plant, "tool_point", path, law, options=options, **changes
    )
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())
    if follower.HasInputPort("override"):
        builder.ExportInput(follower.GetInputPort("override"), "override")
    if follower.HasInputPort("goal"):
        builder.ExportInput(follower.GetInputPort("goal"), "goal")
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), follower.start_state)
    return simulator, follower


def read(simulator, follower, port):
    context = follower.GetMyContextFromRoot(simulator.get_context())
    return follower.GetOutputPort(port).Eval(context)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "law"),
    [("comau_racer_1_4", "rigid"), ("comau_racer_1_4_elastic", "elastic")],
)
def test_a_users_own_plant_follows_a_users_own_path(path, model, law):
    """The tool, by Drake's kinematics, is on the path and where the motion has it."""
    motion = rest_to_rest([0.05, 0.25], velocity=0.5, acceleration=4.0)
    simulator, follower = closed_loop(path, model, law, motion=motion)
    simulator.AdvanceTo(0.3)
    assert read(simulator, follower, "fault")[0] == Fault.NONE
    diagram, root = simulator.get_system(), simulator.get_context()
    plant = diagram.GetSystems()[0]
    pose = plant.GetFrameByName("tool_point").CalcPoseInWorld(plant.GetMyContextFromRoot(root))
    eta = motion.derivatives(np.array([0.3]), 0)[0, 0, 0]
    theta = np.array([path.arc_length.parameter(eta)])
    wanted = path.position.derivatives(theta, 0)[0, 0]
    # accelerating, a held torque lags by half a sample along the path
    np.testing.assert_allclose(pose.translation(), wanted, rtol=0, atol=3e-5)
    assert np.linalg.norm(read(simulator, follower, "manifold_state")[1:3]) < 1e-5
    assert eta > 0.1


@pytest.mark.slow
def test_a_stream_of_way_points_is_followed_and_waited_for(path):
    """The tool moves on with a new waypoint, rests at the last one, and stays on the path."""
    options = FollowerOptions(stream=StreamLimits(velocity=0.3, acceleration=3.0, bandwidth=40.0))
    simulator, follower = closed_loop(path, "comau_racer_1_4", "rigid", options)
    goal, root = simulator.get_system().GetInputPort("goal"), simulator.get_mutable_context()
    places, beside = [], []
    for time, eta in ((0.1, 0.02), (0.2, np.nan), (0.4, 0.05), (1.2, np.nan)):
        goal.FixValue(root, eta)
        simulator.AdvanceTo(time)
        eta, *xi = read(simulator, follower, "manifold_state")[:3]
        places.append(eta)
        beside.append(np.linalg.norm(xi))
    assert read(simulator, follower, "fault")[0] == Fault.NONE
    assert max(beside) < 1e-5
    assert places[0] < places[1] < 0.021 < places[2] < 0.05
    assert places[3] == pytest.approx(0.05, abs=1e-5)


def test_a_stream_has_a_speed_and_no_override(path):
    with pytest.raises(InputError, match=r"stream: given; must be None .* with an override"):
        closed_loop(
            path, "comau_racer_1_4", "rigid", FollowerOptions(stream=StreamLimits(), override=True)
        )


@pytest.mark.slow
def test_velocity_servos_are_told_velocities(path):
    builder = DiagramBuilder()
    plant = load(builder, "comau_racer_1_4")
    follower = add_path_following(builder, plant, "tool_point", path, "velocity_servo")
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    plant.get_actuation_input_port().FixValue(plant.GetMyMutableContextFromRoot(root), np.zeros(6))
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), follower.start_state)
    simulator.Initialize()
    told = read(simulator, follower, "velocity_reference")
    np.testing.assert_allclose(told, 0.0, atol=1e-9)
    assert not follower.HasOutputPort("drive_torque")


@pytest.fixture(name="undriven")
def fixture_undriven(tmp_path):
    """The model whose third joint Drake gives no actuator."""
    text = (models_directory() / "comau_racer_1_4" / "comau_racer_1_4.sdf").read_text("utf-8")
    before, after = text.split('<joint name="joint_3"')
    model = tmp_path / "undriven.sdf"
    changed = re.sub("<effort>.*?</effort>", "<effort>0</effort>", after, count=1)
    model.write_text(f'{before}<joint name="joint_3"{changed}', encoding="utf-8")
    return model


@pytest.mark.slow
def test_a_joint_without_actuator_is_named_where_torques_are_commanded(path, undriven):
    builder = DiagramBuilder()
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(undriven))
    plant.Finalize()
    with pytest.raises(InputError, match=r"joints without actuator: 'joint_3'; .*add_actuators"):
        add_path_following(builder, plant, "tool_point", path, "rigid")
    servos = add_path_following(builder, plant, "tool_point", path, "velocity_servo")
    assert servos.HasOutputPort("velocity_reference") and not servos.HasOutputPort("actuation")


@pytest.mark.slow
def test_actuators_that_are_added_drive_their_joints(path, undriven):
    """The third joint's actuator is the last of the plant then."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(undriven))
    add_actuators(plant, undriven, effort_limits={"joint_3": 800.0})
    plant.Finalize()
    follower = add_path_following(builder, plant, "tool_point", path, "rigid")
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())
    simulator = Simulator(builder.Build())
    own = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositionsAndVelocities(own, follower.start_state)
    simulator.AdvanceTo(0.1)
    drive, actuation = (read(simulator, follower, name) for name in ("drive_torque", "actuation"))
    # held since the last sample
    np.testing.assert_allclose(actuation, drive[[0, 1, 3, 4, 5, 2]], rtol=0, atol=0.2)
    assert np.abs(np.subtract.outer(drive, drive))[~np.eye(6, dtype=bool)].min() > 0.5
    assert np.linalg.norm(read(simulator, follower, "manifold_state")[1:3]) < 1e-5


@pytest.mark.slow
def test_doubts_that_a_scenario_has_are_told_and_logged_once(path, caplog):
    """Gains that are unstable on a perfect model, and nearly equal waypoints."""
    close = np.array([*POINTS[:2], POINTS[1], *POINTS[2:]])
    close[2] += [0.0, 0.24e-6, 0.0]
    close = path_from_waypoints(WaypointTable(close), smoothness=6, closed=True)
    gains = GainParameters(poles=[-300.0] * 4)
    law = LawGains(eta=gains, xi=gains, posture=gains)
    options = FollowerOptions(controller=ControllerParameters(gains={"elastic": law}))
    with caplog.at_level(logging.WARNING, "pfsc_drake"):
        _, follower = closed_loop(close, "comau_racer_1_4_elastic", "elastic", options)
    points, loop = follower.warnings
    assert "waypoints 2 and 3 are 0.24 um apart" in points
    assert "path_from_waypoints: tolerance (m)" in points and "path.shape" not in points
    assert "unstable at the start even on a perfect model" in loop
    assert [record.message for record in caplog.records] == follower.warnings


@pytest.mark.slow
def test_a_law_that_does_not_suit_the_robot_is_named(path):
    """The composite law with more damping than sampling at 1 ms allows, and with less."""
    for damping, is_named in ((0.01, True), (0.001, False)):
        chosen = ControllerParameters(boundary_layer_damping=[damping] * 6)
        options = FollowerOptions(controller=chosen)
        model = "comau_racer_1_4_elastic"
        _, follower = closed_loop(path, model, "singular_perturbation", options)
        assert any("damping of the joint torques" in w for w in follower.warnings) == is_named


@pytest.mark.slow(
    but="2-1.5-measured values of a joint contradict each other: v_J_3 and v_M_3 at eta ="
)
@pytest.mark.parametrize(
    ("row", "value", "said"),
    [
        (7, np.nan, "a measured value is not a finite number: v_J_2 and v_M_2 at eta = "),
        (2, 1.5, "measured values of a joint contradict each other: v_J_3 and v_M_3 at eta ="),
    ],
)
def test_a_fault_is_described(path, row, value, said):
    """By the measurement at the sample of the fault; a value jumps there."""
    builder = DiagramBuilder()
    plant = load(DiagramBuilder(), "comau_racer_1_4")
    follower = add_path_following(builder, plant, "tool_point", path, "rigid")
    builder.ExportInput(follower.GetInputPort("plant_state"), "state")
    simulator = Simulator(builder.Build())
    port, root = simulator.get_system().GetInputPort("state"), simulator.get_mutable_context()
    port.FixValue(root, follower.start_state)
    simulator.AdvanceTo(2.5e-3)
    wrong = follower.start_state.copy()
    wrong[row] = value
    port.FixValue(root, wrong)
    simulator.AdvanceTo(3e-3)
    own = follower.GetMyContextFromRoot(root)
    fault = follower.GetOutputPort("fault").Eval(own)
    sentence = follower.describe(fault, own)
    assert sentence.startswith(said) and sentence.endswith("t = 0.003 s")
    assert follower.describe(fault) == Fault(int(fault[0])).explanation
    with pytest.raises(InputError, match=rf"fault = 99.0; allowed: 0 to {max(Fault):d}"):
        follower.describe(99)


@pytest.mark.slow
def test_an_override_slows_the_progress_and_not_the_tool(path):
    simulator, follower = closed_loop(
        path, "comau_racer_1_4", "rigid", FollowerOptions(override=True)
    )
    override = simulator.get_system().GetInputPort("override")
    override.FixValue(simulator.get_mutable_context(), 0.5)
    simulator.AdvanceTo(1.0)
    eta, *xi = read(simulator, follower, "manifold_state")[:3]
    plan = follower.followed.motion.derivatives(np.array([0.5]), 0)[0, 0, 0]
    assert eta == pytest.approx(plan, abs=1e-5)
    assert np.linalg.norm(xi) < 1e-6


def test_it_starts_where_the_robot_is_with_a_transition(path):
    options = FollowerOptions(transition=0.5, override=False)
    simulator, follower = closed_loop(path, "comau_racer_1_4", "rigid", options)
    plant = simulator.get_system().GetSystems()[0]
    own = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(own, follower.start_posture + 0.02)
    simulator.Initialize()
    error = (
        read(simulator, follower, "manifold_state")[:6] - read(simulator, follower, "reference")[:6]
    )
    np.testing.assert_allclose(error, 0.0, atol=1e-12)
    simulator.AdvanceTo(0.8)
    assert np.linalg.norm(read(simulator, follower, "manifold_state")[1:3]) < 1e-5


@pytest.mark.slow
def test_a_path_that_oscillates_along_its_normal_is_followed(path):
    swing = Swing(coordinate=2, amplitude=0.012, frequency=2.0, begin=0.05, ramp=0.2)
    simulator, follower = closed_loop(
        path, "comau_racer_1_4", "rigid", FollowerOptions(swings=[swing])
    )
    for time in (0.6, 0.7):
        simulator.AdvanceTo(time)
        xi = read(simulator, follower, "manifold_state")[1:3]
        expected = 0.012 * np.sin(2.0 * np.pi * 2.0 * (time - 0.05))
        np.testing.assert_allclose(xi, [0.0, expected], atol=2e-4)
        assert abs(expected) > 5e-3


@pytest.mark.slow
def test_a_trajectory_is_tracked_for_comparison(path):
    """The tool comes back to where time prescribes it to be, not to the closest point."""
    options = FollowerOptions(controller=ControllerParameters(manifold="trajectory"))
    simulator, follower = closed_loop(path, "comau_racer_1_4", "rigid", options)
    plant = simulator.get_system().GetSystems()[0]
    own = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(own, follower.start_posture + 0.01)
    planned = follower.followed.motion.derivatives(np.array([0.0, 1.2]), 0)[:, 0, 0]
    distances = []
    for time, eta in zip((0.0, 1.2), planned, strict=True):
        simulator.AdvanceTo(time)
        tool = plant.GetFrameByName("tool_point").CalcPoseInWorld(own).translation()
        point = path.position.derivatives(np.array([path.arc_length.parameter(eta)]), 0)[0, 0]
        distances.append(np.linalg.norm(tool - point))
        errors = read(simulator, follower, "manifold_state")[:3]
        assert np.linalg.norm(errors) == pytest.approx(distances[-1], abs=1e-6)
    assert distances[0] > 5e-3 and distances[1] < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("state", ["observed", "from_torque"])
def test_links_are_found_where_motors_alone_are_measured(path, state):
    """The links' side of the measurement is wrong; torques are those of the springs."""
    builder = DiagramBuilder()
    plant = load(builder, "comau_racer_1_4_elastic_3r")
    chain, coordinates = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    controller = ControllerParameters(state=state, state_bandwidth=700.0)
    options = FollowerOptions(controller=controller, measures="joint_state")
    follower = add_path_following(builder, plant, "tool_point", path, "elastic", options=options)
    rows = np.array(coordinates.rows)
    motors = builder.AddSystem(MatrixGain(np.vstack([0.0 * rows[:6], rows[6:]])))
    springs = np.hstack([-np.diag(chain.K_s), -np.diag(chain.K_d)])
    sensors = builder.AddSystem(MatrixGain(np.hstack([springs, -springs]) @ rows))
    for system in (motors, sensors):
        builder.Connect(plant.get_state_output_port(), system.get_input_port())
    builder.Connect(motors.get_output_port(), follower.GetInputPort("joint_state"))
    if state == "from_torque":
        port = follower.GetInputPort("joint_torque")
        builder.Connect(sensors.get_output_port(), port)
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())
    simulator = Simulator(builder.Build())
    own = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositionsAndVelocities(own, follower.start_state)
    simulator.AdvanceTo(0.6)
    assert read(simulator, follower, "fault")[0] == Fault.NONE
    eta = follower.followed.motion.derivatives(np.array([0.6]), 0)[0, 0, 0]
    tool = plant.GetFrameByName("tool_point").CalcPoseInWorld(own).translation()
    point = path.position.derivatives(np.array([path.arc_length.parameter(eta)]), 0)[0, 0]
    assert eta > 0.03 and np.linalg.norm(tool - point) < 2e-4


@pytest.mark.slow
def test_it_steps_without_drake(path):
    """The same torques as the diagram's, from what the diagram measured."""
    simulator, follower = closed_loop(path, "comau_racer_1_4_elastic", "elastic")
    plant = simulator.get_system().GetSystems()[0]
    own = plant.GetMyContextFromRoot(simulator.get_context())
    stepper = follower.stepper()
    simulator.Initialize()
    for k in range(20):
        told = stepper.step(plant_state=plant.get_state_output_port().Eval(own))
        np.testing.assert_array_equal(
            told["drive_torque"], read(simulator, follower, "drive_torque")
        )
        simulator.AdvanceTo((k + 1) * follower.period)
    assert np.abs(told["drive_torque"]).max() > 10.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"law": "rigit"}, "law = rigit; allowed: velocity_servo, rigid"),
        ({"tool": "tcp"}, "tool = tcp: the plant has no frame of this name"),
        ({"options": FollowerOptions(measures="q")}, "measures = q; allowed: plant_state"),
        ({"options": FollowerOptions(posture=np.zeros(5))}, "posture: 5 values; .* 6 joints"),
        ({"options": FollowerOptions(bandwidth=-3.0)}, "bandwidth = -3"),
    ],
)
def test_what_is_refused(path, changes, message):
    builder = DiagramBuilder()
    plant = load(builder, "comau_racer_1_4")
    given = {"tool": "tool_point", "law": "rigid"} | changes
    with pytest.raises(InputError, match=message):
        add_path_following(builder, plant, path=path, **given)


@pytest.mark.slow
def test_a_path_out_of_reach_is_refused():
    far = path_from_waypoints(
        WaypointTable(np.array(POINTS) + np.array([3.0, 0.0, 0.0])), smoothness=6, closed=True
    )
    builder = DiagramBuilder()
    plant = load(builder, "comau_racer_1_4")
    with pytest.raises(InputError, match=r"^start: "):
        add_path_following(builder, plant, "tool_point", far, "rigid")


def test_the_door_is_open():
    for name in pfsc_drake.__all__:
        assert getattr(pfsc_drake, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'window'"):
        pfsc_drake.window  # noqa: B018


@pytest.mark.slow
@needs_gcc
def test_the_same_in_c(path, tmp_path):
    """Which repeats what the controller makes of a robot that is pushed about a little."""
    plant = load(DiagramBuilder(), "comau_racer_1_4")
    follower = add_path_following(DiagramBuilder(), plant, "tool_point", path, "rigid")
    moved = 1e-5 * np.cumsum(np.random.default_rng(3).normal(size=(30, 12)), axis=0)
    pfsc_drake.export(follower, tmp_path, {"plant_state": follower.start_state + moved})
    subprocess.run(["make", "--silent", "OPTIMIZATION=-O0", "replay"], cwd=tmp_path, check=True)
    command = ["./replay", "replay.bin", "10"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "ticks 30 differing 0 " in done.stdout
