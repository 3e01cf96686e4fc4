"""The DELTA station: connections, start, refusals."""

import numpy as np
import pytest
import yaml
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.drawing.recorded import RecordedMotion
from diagrams.drawing.replay import Playback, record
from diagrams.scenario import Scenario
from diagrams.tasks.task_drawing import drawing_of
from experiments.scenario_file import SCENARIO_DIRECTORY, load_scenario_data
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.yaml.typed import load_typed

FILE = SCENARIO_DIRECTORY / "pfc_delta.yaml"
NOTCH = SCENARIO_DIRECTORY / "pfc_delta_notch.yaml"
PERIOD = 0.04


def load(*changes):
    exact = ["encoders={}", "model_error={}", "start.transition=0"]
    return load_typed(Scenario, load_scenario_data(FILE, [*exact, *changes]), str(FILE))


def build(*changes):
    return build_station(load(*changes), SCENARIO_DIRECTORY)


def build_analytic(*changes):
    return build("robot.plant=analytic", *changes)


def sources(diagram):
    """Return the output port behind each input port, by names."""
    return {
        (system.get_name(), system.get_input_port(index).get_name()): (
            source.get_name(),
            source.get_output_port(port).get_name(),
        )
        for (system, index), (source, port) in diagram.connection_map().items()
    }


@pytest.mark.slow
def test_friction_is_beside_the_drives():
    behind = sources(build_analytic("simulation.fused=false").diagram)
    assert behind["plant", "actuation"] == ("hold", "held")
    assert behind["plant", "resistance"] == ("all_resistances", "sum")
    assert behind["all_resistances", "u0"] == ("joint_friction", "resistance")
    assert behind["all_resistances", "u1"] == ("brake_torque", "resistance")
    # the true velocity, whatever the encoders say
    assert behind["joint_friction", "velocity"] == ("joint_encoders", "y0")


def test_without_friction_the_held_force_drives_the_plant():
    station = build_analytic("drive_friction=false", "simulation.fused=false")
    assert sources(station.diagram)["plant", "actuation"] == ("hold", "held")
    assert "friction_torque" not in station.log.rows


def test_encoders_count_increments_of_the_slides():
    station = build("encoders.link_increments=[1000]", "encoders.motor_increments=[1000]")
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(0.01)
    _, log = station.log.read(simulator.get_context())
    true, measured = (log[name][:, :3] for name in ("joint_state", "joint_state_measured"))
    np.testing.assert_allclose(measured, np.round(true * 1e3) / 1e3, atol=1e-12)
    assert np.abs(measured - true).max() > 1e-5


@pytest.mark.slow
def test_a_push_deflects_as_the_gains_say():
    """Without integral action, e = -a_1^-1 A D^-1 J^T f: by the robot's own matrices."""
    force = np.array([3.0, -2.0, 4.0])
    station = build(
        "drive_friction=false",
        "start.offset=[0, 0]",
        "reference.dwell=2.0",
        "controller.gains.rigid.eta={coefficients: [3675, 105]}",
        "controller.gains.rigid.xi={coefficients: [7500, 150]}",
        f"forces=[{{begin: 0.1, end: 2.0, ramp: 0.05, force: {force.tolist()}}}]",
    )
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(0.8)
    _, log = station.log.read(simulator.get_context())
    np.testing.assert_allclose(log["wrench_ext"][-1], [*force, 0, 0, 0], atol=1e-12)
    q = station.initial_state[:3]
    J, masses = station.robot.jacobian_at(q), station.robot.parameters.masses
    D = masses.effective_slide * np.eye(3) + masses.effective_plate * J.T @ J
    acceleration = J @ np.linalg.solve(D, J.T @ force)
    theta = np.array([station.initial_projection[0]])
    tangent = station.path.position.derivatives(theta, 1)[0, 1]
    tangent /= np.linalg.norm(tangent)
    along = tangent * (tangent @ acceleration)
    moved = station.robot.tool_position(log["joint_state"][-1, :3]) - station.robot.tool_position(q)
    expected = along / 3675.0 + (acceleration - along) / 7500.0
    np.testing.assert_allclose(moved, expected, atol=0.02 * np.linalg.norm(expected))


def test_starts_at_rest_beside_the_path():
    station = build_analytic()
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    plant = station.part.plant.GetMyContextFromRoot(root)
    q, v = np.split(station.part.plant.GetOutputPort("state").Eval(plant), 2)
    y_t = station.part.plant.GetOutputPort("tool_position").Eval(plant)
    np.testing.assert_array_equal(v, 0.0)
    # rods of 0.5 m reach from the slides to the plate: the constraint (2.30), by itself
    geometry = station.robot.parameters.geometry
    slides = geometry.offsets - q[:, None] * geometry.rails
    np.testing.assert_allclose(np.linalg.norm(y_t - slides, axis=1), 0.5, atol=1e-12)
    # the nearest point of the path, on a fine grid
    theta = np.linspace(*station.path.position.domain, 40_001)
    distance = np.linalg.norm(station.path.position.derivatives(theta, 0)[:, 0] - y_t, axis=1)
    nearest = int(np.argmin(distance))
    assert distance[nearest] == pytest.approx(0.010, abs=1e-7)
    assert station.initial_projection[0] == pytest.approx(theta[nearest], abs=theta[1] - theta[0])


def test_the_first_force_is_weight_and_proportional_part():
    """D q'' = tau - g with J q'' = -a_xi1 xi: at rest, against the robot's own matrices."""
    station = build()
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    tau = station.controller.drive(station.blocks, root)
    q = station.initial_state[:3]
    y_t = station.robot.tool_position(q)
    theta = np.array([station.initial_projection[0]])
    offset = y_t - station.path.position.derivatives(theta, 0)[0, 0]
    J, masses = station.robot.jacobian_at(q), station.robot.parameters.masses
    D = masses.effective_slide * np.eye(3) + masses.effective_plate * J.T @ J
    gravity = np.array([0.0, 0.0, 9.81])
    rails = station.robot.parameters.geometry.rails  # a slide moves along -c_i
    weight = masses.effective_slide * rails @ gravity - masses.effective_plate * J.T @ gravity
    expected = D @ np.linalg.solve(J, -7500.0 * offset) + weight
    np.testing.assert_allclose(tau, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ("start.posture_deg=[0, 0, 0]", ["start.posture_deg", "none"]),
        ("start.rotation_deg=[1, 0, 0]", ["start.rotation_deg", "only translates"]),
        ("path.orientation.keyframes=[{theta: 0}]", ["keyframes", "only translates"]),
        ("hold_back={force: -5}", ["hold_back.force", "-5"]),
        ("robot.rotor_coupling=comau_racer_1_4", ["robot.rotor_coupling", "none for a DELTA"]),
        ("robot.joint_damping=[1, 1, 1]", ["robot.joint_damping", "none for a DELTA"]),
        ("friction={f_c: [1, 1]}", ["friction.f_c = [1.0, 1.0]; allowed: 3 values, one per joint"]),
        ("controller.law=velocity_servo", ["controller.law", "velocity_servo", "rigid"]),
        ("controller.law=elastic", ["controller.law", "elastic", "rigid"]),
        ("robot.plant=lagrange", ["plant = lagrange", "multibody, analytic"]),
        ("simulation.sensor_failure={time: 1, component: 12}", ["component", "0 to 11"]),
        ("reference.points=[0.022, 0.5]", ["reference.points", "0.5 m"]),
        ("start.offset=[0, 1]", ["start: [", "outside the workspace"]),
        ("robot.model=nowhere.yaml", ["nowhere.yaml"]),
        # a path that leaves the workspace on the way is refused before anything moves
        (
            "path.shape=!Line {start: [0, 0, 0.6], end: [0, 0, 1.0]}",
            ["path at eta = 0.", "outside the workspace"],
        ),
    ],
)
def test_refused(change, parts):
    with pytest.raises(InputError) as caught:
        build(change)
    for part in parts:
        assert part in str(caught.value)


def test_friction_of_the_analytic_plant_wants_an_integrator():
    with pytest.raises(InputError, match=r"simulation.integrator = implicit_euler .*runge_kutta3"):
        build_analytic("simulation.integrator=implicit_euler")


def test_only_the_plant_of_bodies_touches():
    settings = load_typed(Scenario, load_scenario_data(NOTCH, ["robot.plant=analytic"]), str(NOTCH))
    with pytest.raises(InputError, match=r"robot.plant = analytic.* multibody where .*touches"):
        build_station(settings, SCENARIO_DIRECTORY)


def run(*changes, duration):
    """Return slides and drive forces at every tick, of a run that starts off the path."""
    station = build("drive_friction=false", *changes)
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(duration)
    times, log = station.log.read(simulator.get_context())
    return times, log["joint_state"][:, :6]


def test_both_plants_move_alike():
    """In closed loop, 10 mm back to the path; bodies are late by about a step of the plant."""
    times, analytic = run("robot.plant=analytic", duration=0.2)
    way = np.ptp(analytic[:, :3], axis=0).max()
    assert way > 5e-3
    errors = []
    for step in (1e-3, 2.5e-4):
        t, bodies = run(f"simulation.max_step={step}", duration=0.2)
        count = min(len(t), len(times))
        errors.append(np.abs(bodies[:count, :3] - analytic[:count, :3]).max())
    assert errors[0] < 0.05 * way
    assert errors[1] < 0.4 * errors[0]


@pytest.mark.parametrize(("longest", "step"), [(1e-2, 1e-3), (1e-3, 1e-3), (7e-4, 5e-4)])
def test_ticks_are_multiples_of_the_step_of_bodies(longest, step):
    assert build(f"simulation.max_step={longest}").part.drives.step == pytest.approx(step)


def test_bodies_do_not_fall_before_the_first_tick():
    """The plant's first step is one of what the drives did before."""
    _, states = run("start.offset=[0, 0]", "reference.dwell=1", duration=0.02)
    assert np.abs(states[:, 3:]).max() < 1e-5  # m/s; 7e-3 if it fell for a millisecond


def test_a_robot_without_a_load(tmp_path):
    """Nothing is welded to its end-effector but what has no mass."""
    own = yaml.safe_load((models_directory() / "festo_expt_45" / "parameters.yaml").read_text())
    own["masses"]["load"] = 0.0
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(own))
    station = build(f"robot.model={tmp_path / 'own.yaml'}")
    plant = station.part.plant
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(
        3.0 * station.robot.parameters.masses.effective_slide
        + station.robot.parameters.masses.effective_plate
    )


def test_a_way_there_and_back_is_looked_at_as_a_whole():
    """Begin and end are within reach, the point where it turns is not."""
    line = "path.shape=!Line {start: [0, 0, 0.6], end: [0, 0, 1.0]}"
    build(line, "reference.points=[0.02, 0.03]")
    with pytest.raises(InputError, match=r"path at eta = 0\..* outside the workspace"):
        build(line, "reference.points=[0.02, 0.35, 0.03]")


def test_replay_draws_robot_and_path_upside_down():
    station = build()
    evaluator, q = station.path.evaluator(2), station.initial_state[:3]
    y_t = station.robot.tool_position(q)
    pose = np.concatenate([y_t, np.eye(3).ravel()])
    point = evaluator(y_t.tolist(), station.initial_projection[0])
    motion = RecordedMotion(
        PERIOD * np.arange(3), np.tile(q, (3, 1)), np.tile(pose, (3, 1)), np.tile(point, (3, 1))
    )
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    drawn = drawing_of(station.task)
    diagram = Playback(motion, meshcat, PERIOD).build_delta(station.robot, drawn)
    page = record(diagram, meshcat, motion.times[-1], PERIOD)
    assert "</html>" in page
    for name in ("delta_robot/slide_1", "delta_robot/rod_6", "path_following/path"):
        assert meshcat.HasPath(f"/drake/{name}")
