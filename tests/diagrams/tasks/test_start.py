"""The state in which a run starts, against Drake's kinematics and dynamics."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.robots.arm import MultibodyArm
from diagrams.robots.arm_model import ArmModel
from diagrams.robots.nominal_model import NominalModel
from diagrams.robots.start_posture import posture_warnings
from diagrams.scenario import Circle, Line
from diagrams.scenario_task import make_task
from pfsc_drake.errors import InputError
from pfsc_drake.robot.coordinate_text import posture_text
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.robot.robot_model import pose_function

THREE, SIX = "pfc_elastic_3r", "pfc_elastic_6r"
LINE = Line([0.8, -0.1, 1.0], [0.8, 0.3, 1.0])


def _part(arm):
    actual = ArmModel(arm.plant, arm.chain, arm.coordinates, arm.tool, [])
    nominal_model = NominalModel(arm.chain, ModelError.none(arm.chain.dimension))
    return MultibodyArm(actual, nominal_model, actual)


def target(arm, q):
    """Return the pose of a tool at joint coordinates."""
    pose = np.array(pose_function(arm.chain)(q)).ravel()
    return ToolTarget(pose[:3], pose[3:].reshape(3, 3))


@pytest.fixture
def start(load_arm):
    """Return path, theta and robot, put at the start of a scenario."""

    def put(settings):
        arm = load_arm(settings.robot.model)
        task = make_task(settings, None)
        begin = task.start(np.zeros(3))
        part = _part(arm)
        x = part.state_at_rest(part.posture(begin.target, settings.start))
        arm.set_state(x)
        return task.path, begin.projection[0], arm, x

    return put


@pytest.fixture
def on_line(load_scenario):
    """Return the three-axis scenario on a line along y, 0.05 m after its begin."""

    def load(model="comau_racer_1_4_elastic_3r"):
        settings = load_scenario(THREE)
        settings.robot.model = model
        settings.path.shape = LINE
        settings.reference.points = [0.05, 0.4]
        return settings

    return load


@pytest.mark.parametrize("model", ["comau_racer_1_4_3r", "comau_racer_1_4_elastic_3r"])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.03, 0.0), (0.0, 0.02), (-0.01, -0.04)])
def test_tool_is_beside_a_line_by_the_offset(on_line, start, model, offset):
    settings = on_line(model)
    settings.start.offset = list(offset)
    _, theta, arm, _ = start(settings)
    # e_par = y, e_perp = z (the normal next to the vertical), e_cross = y x z = x
    expected = [0.8 + offset[1], -0.05, 1.0 + offset[0]]
    np.testing.assert_allclose(arm.tool_pose()[0], expected, atol=1e-8)
    assert theta == pytest.approx(0.05, abs=1e-12)


@pytest.mark.parametrize("name", [THREE, SIX])
def test_tool_is_beside_the_lemniscate(load_scenario, start, name):
    settings = load_scenario(name)
    settings.start.offset = [0.01, -0.02]
    path, theta, arm, _ = start(settings)
    y_t, _ = arm.tool_pose()
    sigma, slope = path.position.derivatives(theta, 1)
    e_perp, e_cross = path.frame.normals(theta)
    assert slope @ (y_t - sigma) == pytest.approx(0.0, abs=1e-8)
    assert e_perp @ (y_t - sigma) == pytest.approx(0.01, abs=1e-8)
    assert e_cross @ (y_t - sigma) == pytest.approx(-0.02, abs=1e-8)
    assert path.arc_length(theta) == pytest.approx(settings.reference.points[0], abs=1e-9)


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (3.0, -2.0, 1.0)])
def test_tool_is_turned_away_by_the_rotation(load_scenario, start, angles):
    settings = load_scenario(SIX)
    settings.start.rotation_deg = list(angles)
    path, theta, arm, _ = start(settings)
    deviation = path.orientation.rotation_matrix(theta).T @ arm.tool_pose()[1]
    reached = Rotation.from_matrix(deviation).as_euler("ZYX", degrees=True)
    np.testing.assert_allclose(reached, angles, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "twin"), [(THREE, "comau_racer_1_4_3r"), (SIX, "comau_racer_1_4")]
)
def test_elastic_joints_carry_the_weight(load_scenario, load_arm, start, name, twin):
    """With the drives holding the weight nothing moves: Drake's derivatives vanish."""
    _, _, arm, x = start(load_scenario(name))
    q_J = arm.angles("motor") + arm.angles("flex")
    weight = load_arm(twin).weight(q_J)
    assert np.abs(weight).max() > 50.0
    actuation = np.zeros(arm.plant.num_actuators())
    for i, torque in enumerate(weight, start=1):
        joint = arm.plant.GetJointByName(f"motor_{i}")
        actuators = [arm.plant.get_joint_actuator(k) for k in arm.plant.GetJointActuatorIndices()]
        (actuator,) = [a for a in actuators if a.joint().index() == joint.index()]
        actuation[actuator.input_start()] = torque
    context = arm.plant.CreateDefaultContext()
    arm.plant.SetPositionsAndVelocities(context, x)
    arm.plant.get_actuation_input_port().FixValue(context, actuation)
    rates = arm.plant.EvalTimeDerivatives(context).CopyToVector()
    # accelerations; without the deflection they are beyond 1 rad/s^2
    assert np.abs(rates).max() < 1e-5


def test_rigid_joints_do_not_bend(on_line, start):
    _, _, _, x = start(on_line("comau_racer_1_4_3r"))
    assert x.shape == (6,)
    np.testing.assert_array_equal(x[3:], 0.0)


def test_posture_chooses_the_branch(load_scenario, start):
    """The wrist reaches a pose in two ways: axis 5 bent to one side or to the other."""
    settings = load_scenario(SIX)
    postures = {1.0: [25, 115, -40, -5, 95, -17], -1.0: [25, 115, -40, 175, -95, 163]}
    poses = []
    for sign, posture in postures.items():
        settings.start.posture_deg = posture
        _, _, arm, _ = start(settings)
        np.testing.assert_allclose(np.rad2deg(arm.angles("motor")), posture, atol=15.0)
        assert np.sign(arm.angles("motor")[4]) == sign
        poses.append(arm.tool_pose())
    for one, other in zip(*poses, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-7)


def test_start_without_posture(on_line, start):
    settings = on_line()
    settings.start.posture_deg = []
    _, _, arm, _ = start(settings)
    np.testing.assert_allclose(arm.tool_pose()[0], [0.8, -0.05, 1.01], atol=1e-8)
    lower, upper = arm.chain.gather("position_limits").T
    assert np.all((lower <= arm.angles("motor")) & (arm.angles("motor") <= upper))


@pytest.mark.parametrize("name", [THREE, SIX])
def test_without_posture_the_arm_starts_near_the_middle_of_its_ranges(load_scenario, start, name):
    """From near an end of them neither of these starts would be found."""
    settings = load_scenario(name)
    settings.start.posture_deg = []
    _, _, arm, _ = start(settings)
    lower, upper = arm.chain.gather("position_limits").T
    away = np.abs(arm.angles("motor") - (lower + upper) / 2.0)
    assert np.all(away < 0.9 * (upper - lower) / 2.0)


@pytest.mark.parametrize("revolutions", [-1, 1, 2])
def test_start_revolutions_later(load_scenario, start, revolutions):
    """A closed path counts its revolutions; the projection is the same."""
    settings = load_scenario(THREE)
    path, theta, arm, _ = start(settings)
    y_t, _ = arm.tool_pose()
    settings.reference.points = [0.96 + revolutions * path.length, 0.3]
    _, later, _, _ = start(settings)
    assert later == pytest.approx(theta + 2.0 * math.pi * revolutions, abs=1e-9)
    np.testing.assert_allclose(arm.tool_pose()[0], y_t, atol=1e-8)


def refused(start, settings, *parts):
    with pytest.raises(InputError) as caught:
        start(settings)
    for part in parts:
        assert part in str(caught.value)


def test_start_beyond_the_centre_of_curvature(load_scenario, start):
    """e_cross of this circle points outwards; 0.06 m inwards is beyond its centre."""
    settings = load_scenario(THREE)
    settings.path.shape = Circle(radius=0.05)
    settings.reference.points = [0.0, 0.1]
    settings.start.offset = [0.0, -0.04]  # alpha = 0.8
    start(settings)
    settings.start.offset = [0.0, -0.048]  # alpha = 0.96
    refused(start, settings, "start.offset", "-0.048", "alpha = 0.96", "below 0.95")
    settings.start.offset = [0.0, -0.06]
    refused(start, settings, "start.offset", "-0.06", "feasible neighbourhood")


@pytest.mark.slow
def test_unreachable_start(on_line, start):
    settings = on_line()
    settings.path.shape = Line([0.2, 0.0, 0.1], [0.2, 0.4, 0.1])  # inside the robot
    refused(start, settings, "start", "0.2", "unreachable", "joint limits")
    settings.path.shape = Line([5.0, 0.0, 1.0], [5.0, 0.4, 1.0])
    refused(start, settings, "start", "5.0", "unreachable", "robot reaches")


@pytest.mark.parametrize("points", [[-0.01, 0.1], [0.0, 0.41], [0.0, math.inf]])
def test_reference_beyond_the_ends_of_an_open_path(on_line, start, points):
    settings = on_line()
    settings.reference.points = points
    wrong = next(p for p in points if not 0.0 <= p <= 0.4)
    refused(start, settings, "reference.points", f"{wrong:g} m", "open", "0.4 m long")


def test_the_ends_of_an_open_path_are_allowed(on_line, start):
    settings = on_line()
    settings.reference.points = [0.4, 0.0]
    _, _, arm, _ = start(settings)
    np.testing.assert_allclose(arm.tool_pose()[0], [0.8, 0.3, 1.01], atol=1e-8)


@pytest.mark.parametrize("posture", [[1.0], [1.0, 2.0, 3.0, 4.0]])
def test_posture_of_another_robot(on_line, start, posture):
    settings = on_line()
    settings.start.posture_deg = posture
    refused(start, settings, f"start.posture_deg = {posture}; allowed: 3 values, one per joint")


def beam(name, joint):
    """Return a link of a robot, and the joint that carries it, as URDF."""
    return (
        f'<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" '
        f'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="{name}_joint" {joint}</joint>'
    )


@pytest.fixture
def on_rails(tmp_path, load_scenario):
    """A scenario of a robot with a rail, a lift and an arm of 1 m; it starts at (0, 0.6, 0.2)."""
    limit = '<limit lower="-3" upper="3" effort="100" velocity="1"/>'
    rail = f'type="prismatic"><parent link="world"/><child link="rail"/>{limit}'
    lift = f'type="prismatic"><parent link="rail"/><child link="lift"/><axis xyz="0 0 1"/>{limit}'
    arm = f'type="revolute"><parent link="lift"/><child link="arm"/><axis xyz="0 0 1"/>{limit}'
    tool = (
        '<link name="tool_point"/><joint name="t" type="fixed"><parent link="arm"/>'
        '<child link="tool_point"/><origin xyz="1 0 0"/></joint>'
    )
    file = tmp_path / "rails.urdf"
    text = '<link name="world"/>' + beam("rail", rail) + beam("lift", lift) + beam("arm", arm)
    file.write_text(f'<robot name="rails">{text}{tool}</robot>', encoding="utf-8")
    settings = load_scenario(THREE)
    settings.robot.model = str(file)
    settings.path.shape = Line([0.0, 0.6, 0.2], [0.5, 0.6, 0.2])
    settings.reference.points, settings.start.offset = [0.0, 0.4], [0.0, 0.0]
    return settings


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_slides_of_the_posture_are_in_metres(on_rails, start, side):
    """The arm reaches the point from either side; the place on the rail says from which."""
    on_rails.start.posture_deg = [0.8 * side, 0.2, 90.0 - 5.0 * side]
    _, _, arm, x = start(on_rails)
    q = (arm.coordinates.link_rows @ x)[:3]
    np.testing.assert_allclose(q, [0.8 * side, 0.2, np.arccos(-0.8 * side)], atol=1e-8)
    there = ToolTarget(arm.tool_pose()[0])
    assert posture_warnings(on_rails.start.posture_deg, arm.chain, q, there) == []
    (warning,) = posture_warnings([0.8 * side, -0.3, 90.0], arm.chain, q, there)
    assert "lift_joint most" in warning and f"q_1 = {0.8 * side:g} m" in warning


def test_a_posture_in_radians(load_scenario, start):
    settings = load_scenario(SIX)
    given = settings.start.posture_deg
    _, _, arm, x = start(settings)
    found = (arm.coordinates.link_rows @ x)[:6]
    assert posture_warnings(given, arm.chain, found, target(arm, found)) == []
    assert posture_warnings([], arm.chain, found, target(arm, found)) == []
    in_radians = np.deg2rad(given).round(2).tolist()
    (warning,) = posture_warnings(in_radians, arm.chain, found, target(arm, found))
    line = posture_text(arm.chain, found)
    assert "radians" in warning and line in warning
    assert "write [25.21, 115.2, -40.11, -5.157, 95.11, -17.19]" in warning
    assert line.startswith(f"q_1 = {np.rad2deg(found[0]):.1f} deg, q_2 = ")


def test_a_posture_far_from_any_solution(load_scenario, start):
    _, _, arm, x = start(load_scenario(SIX))
    found = (arm.coordinates.link_rows @ x)[:6]
    (warning,) = posture_warnings([25, 115, -40, -5, 95, 340], arm.chain, found, target(arm, found))
    assert "far from any solution, motor_6 most" in warning
    # small angles in degrees are no radians
    (warning,) = posture_warnings([0, 0, 0, 0, 0, 0], arm.chain, found, target(arm, found))
    assert "far from any solution" in warning


def test_a_posture_in_radians_that_leads_astray(load_scenario, start):
    """Taken for degrees, the posture leads to the other wrist; the digits still tell."""
    settings = load_scenario(SIX)
    settings.start.posture_deg = [25, 115, -40, 175, -95, 163]
    _, _, arm, x = start(settings)
    other = (arm.coordinates.link_rows @ x)[:6]
    in_radians = np.deg2rad([25, 115, -40, -5, 95, -17]).round(2).tolist()
    (warning,) = posture_warnings(in_radians, arm.chain, other, target(arm, other))
    assert "radians" in warning


@pytest.mark.parametrize("limit", ["1e16", "1e150"])
def test_without_a_posture_half_limited_joints_start_where_they_can(on_rails, start, limit):
    """The middle of -3 and infinity is nowhere; the lift may only be above 0.1 m."""
    file = Path(on_rails.robot.model)
    text = file.read_text(encoding="utf-8")
    text = text.replace('upper="3"', f'upper="{limit}"', 2)
    second = text.index("lift_joint")
    text = text[:second] + text[second:].replace('lower="-3"', 'lower="0.1"', 1)
    file.write_text(text, encoding="utf-8")
    on_rails.start.posture_deg = []
    _, _, arm, _ = start(on_rails)
    np.testing.assert_allclose(arm.tool_pose()[0], [0.0, 0.6, 0.2], atol=1e-8)


def test_a_closed_path_is_looked_at_once_however_many_rounds_there_are(load_scenario):
    settings = load_scenario(THREE)
    settings.reference.points = [0.1, 1e4]
    task = make_task(settings, None)
    points = np.array([position for position, _ in task.tool_positions()])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps.sum() == pytest.approx(task.path.length, rel=1e-4)


def test_what_is_beyond_reach_is_refused(load_arm):
    arm = load_arm("comau_racer_1_4_3r")
    part = _part(arm)
    base, reach = arm.chain.links[0].p_PF, arm.chain.reach * np.array([1.0, 0.0, 0.0])
    part.check_reach(base + 0.999 * reach, "here")
    with pytest.raises(InputError, match=r"^here: .* unreachable, .* robot reaches"):
        part.check_reach(base + 1.001 * reach, "here")


def test_no_posture_is_beyond_the_reach(load_arm):
    random = np.random.default_rng(1)
    arm = load_arm("comau_racer_1_4_3r")
    base = arm.chain.links[0].p_PF
    farthest = 0.0
    for q in random.uniform(-np.pi, np.pi, (300, 3)):
        arm.plant.SetPositions(arm.context, q)
        farthest = max(farthest, float(np.linalg.norm(arm.tool_pose()[0] - base)))
    assert 0.8 * arm.chain.reach < farthest <= arm.chain.reach
