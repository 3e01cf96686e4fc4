"""The fastest motion: as fast as Toppra on rigid joints, within limits and on the path on all."""

import numpy as np
import pytest
from pydrake.multibody.optimization import CalcGridPointsOptions, Toppra
from pydrake.systems.analysis import Simulator
from pydrake.trajectories import PiecewisePolynomial

from diagrams.builder import build_station
from diagrams.scenario import GainParameters, LawGains, ReferenceParameters
from diagrams.scenario.motion import SecondReference
from experiments.scenario_file import find_scenario
from pfsc_drake.control.law.swing import Swing
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices
from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import ToolTarget, solve_pose
from pfsc_drake.robot.serial.chain import SerialChain

ARM, DWELL, RESERVE = "pfc_elastic_3r", 0.05, 0.3
GAINS = GainParameters(coefficients=[900.0, 60.0])


@pytest.fixture(name="fastest")
def fixture_fastest(load_exact_scenario):
    """Return a function that makes a shipped scenario's first move short, and as fast as it can."""

    def change(name=ARM, way=0.15, **changes):
        settings = load_exact_scenario(name)
        reference = settings.reference
        reference.points = [reference.points[0], reference.points[0] - way]
        if reference.places:
            reference.places = [reference.places[0], [x + way for x in reference.places[0]]]
        reference.speed, reference.velocity, reference.dwell = "fastest", None, DWELL
        settings.start.offset, settings.start.rotation_deg = [0.0, 0.0], [0.0, 0.0, 0.0]
        settings.start.transition = 0.0
        for key, value in changes.items():
            setattr(reference, key, value)
        return settings

    return change


def build(settings, name=ARM):
    return build_station(settings, find_scenario(name).parent)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "way", "leads"),
    [(ARM, 0.15, False), ("pfc_elastic_7r", -0.5, False), ("pfc_scara_4r", -0.2, True)],
)
def test_limits_are_met_on_the_path(name, way, leads, fastest):
    """Torques of the simulated plant within 1 % of what was allowed, and of what was expected."""
    settings = fastest(name, way)
    settings.controller.torque_lead = leads
    station = build(settings, name)
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(station.reference_duration)
    times, raw = station.log.read(simulator.get_context())
    law, layout, plan = raw["law"], station.law.layout, station.task.drive_plan
    across = indices(station.task.projected_manifold.coordinates, Kind.TRANSVERSAL)
    assert np.linalg.norm(law[:, layout.manifold_state][:, across], axis=1).max() < 1e-5
    torque, limits = law[:, layout.drive], plan.limits[: station.robot.dimension]
    assert np.abs(torque / limits).max() < 1.01 * (1.0 - RESERVE)
    middle = times + station.controller.period / 2.0
    planned = plan.demand.T[: len(limits)]
    expected = np.array([np.interp(middle, plan.times, tau) for tau in planned]).T
    assert np.abs(expected - torque).max() < 0.02 * np.abs(torque).max()
    assert not plan.messages and plan.limiting.largest.max() < 1.006
    parts = plan.limiting.path_shares(plan.speed)
    assert sum(parts.values()) == pytest.approx(1.0) and parts["none"] < 0.8


@pytest.mark.slow
def test_it_is_faster_than_a_motion_that_is_slowed(fastest):
    """By a tenth at least, whatever was asked for: with the same reserve, and rates left alone."""
    shortest = build(fastest(torque_rate=np.inf)).reference_duration - 2.0 * DWELL
    for asked in ((1.0, 10.0), (2.0, 20.0), (4.0, 20.0), (4.0, 60.0)):
        velocity, acceleration = asked
        slowed = fastest(speed="asked", velocity=velocity, acceleration=acceleration)
        moved = build(slowed).reference_duration - 2.0 * DWELL
        assert shortest < 0.9 * moved


@pytest.mark.slow
def test_from_rest_to_rest_as_smooth_as_the_law_needs(fastest):
    motion = build(fastest(way=0.15)).task.motion
    assert motion.first_discontinuity(4) is None
    values = motion.derivatives(np.array(motion.domain), 4)[:, :, 0]
    assert values[:, 0] == pytest.approx(fastest(way=0.15).reference.points, abs=1e-12)
    scale = np.abs(motion.derivatives(motion.breakpoints, 4)).max(axis=0)[:, 0]
    assert np.all(np.abs(values[:, 1:]) < 1e-6 * scale[1:])


@pytest.mark.slow
def test_a_largest_velocity_is_kept(fastest):
    plan = build(fastest(velocity=0.3)).task.drive_plan
    assert 0.29 < plan.speed.max() < 0.302
    assert plan.limiting.path_shares(plan.speed)["velocity"] > 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "way"),
    [("sfc_elastic_6r", 0.03), ("pfc_panda_7r", -0.1), ("pfc_delta", -0.05)],
)
def test_surfaces_redundant_arms_and_other_laws(name, way, fastest):
    station = build(fastest(name, way), name)
    plan, n = station.task.drive_plan, station.robot.dimension
    assert not plan.messages and plan.limiting.largest.max() < 1.006
    assert np.all(np.abs(plan.demand[:, :n]) <= 1.006 * (1.0 - RESERVE) * plan.limits[:n])
    assert plan.limiting.path_shares(plan.speed)["none"] < 0.8
    # straight in the coordinates of what is followed
    asked = fastest(name, way).reference
    ends = asked.places or [[point] for point in asked.points]
    places = plan.motion.derivatives(plan.times, 0)[:, 0]
    begin, direction = np.array(ends[0]), np.subtract(ends[1], ends[0])
    along = (places - begin) @ direction / (direction @ direction)
    assert np.allclose(places, begin + np.outer(along, direction), rtol=0, atol=1e-10)


@pytest.mark.slow
def test_a_posture_that_moves_is_reported(fastest):
    """It stays where it is in the plan."""
    settings = fastest("pfc_panda_7r", -0.05)
    settings.controller.posture.task = "limits"
    (said,) = build(settings, "pfc_panda_7r").task.drive_plan.messages
    assert "planned for a constant posture" in said


@pytest.mark.slow
def test_as_fast_as_toppra_on_rigid_joints(fastest):
    """Drake's own optimum, whose torque may jump, is shorter, by few per cent."""
    settings = fastest("pfc_elastic_6r", -0.4, torque_rate=np.inf)
    settings.robot.model, settings.controller.law = "comau_racer_1_4", "rigid"
    settings.controller.friction.source = "none"
    settings.controller.gains = {"rigid": LawGains(eta=GAINS, xi=GAINS, phi=GAINS)}
    station = build(settings, "pfc_elastic_6r")
    planned = station.reference_duration - 2.0 * DWELL
    plan, plant = station.task.drive_plan, station.part.model
    begin, end = settings.reference.points
    places, joints = np.linspace(begin, end, 1 + round((end - begin) / 0.01)), []
    for eta in places.tolist():
        target = ToolTarget(*station.task.path.pose(eta))
        joints.append(solve_pose(station.robot, target, station.initial_state[:6], f"{eta:.4g} m"))
    path = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(places, np.transpose(joints))
    grid = Toppra.CalcGridPoints(path, CalcGridPointsOptions(min_points=1000))
    toppra = Toppra(path, plant, grid)
    effort, speed = np.split(plan.limits, 2)
    toppra.AddJointTorqueLimit(-(1.0 - RESERVE) * effort, (1.0 - RESERVE) * effort)
    toppra.AddJointVelocityLimit(-0.95 * speed, 0.95 * speed)
    least = toppra.SolvePathParameterization()
    least = least.end_time() - least.start_time()
    assert 0.995 * least < planned < 1.05 * least


def test_weights_that_drives_cannot_hold_are_named(fastest):
    settings = fastest()
    settings.controller.effort_scale = 0.05
    with pytest.raises(
        InputError, match=r"fastest: no motion fits: at rest at eta = .* axis \d needs"
    ):
        build(settings)


def test_no_fastest_motion_with_hand_guiding(fastest):
    settings = fastest()
    gains = settings.controller.gains["elastic"].eta
    gains.poles, gains.integral_pole, gains.free = [-60.0, -60.0, -250.0], 0.0, True
    with pytest.raises(InputError, match="speed = fastest; allowed: asked; a hand-guided motion"):
        build(settings)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"speed": "quick"}, "speed"),
        ({"torque_rate": 0.0}, "torque_rate"),
        ({"torque_rate": np.nan}, "torque_rate"),
        ({"velocity": -1.0}, "velocity"),
        ({"speed": "fastest", "second": SecondReference()}, "second"),
        ({"speed": "fastest", "swings": [Swing()]}, "swings"),
    ],
)
def test_what_is_refused(changes, key):
    with pytest.raises(InputError, match=key):
        ReferenceParameters(**changes)


def test_velocity_is_as_it_was_unless_given():
    assert ReferenceParameters().largest_velocity == 0.1
    assert ReferenceParameters(velocity=0.3).largest_velocity == 0.3


@pytest.mark.slow
def test_a_joint_that_passes_its_limit_is_named_beforehand(fastest, load_arm, monkeypatch):
    """Of a robot whose first axis ends within the motion."""
    settings = fastest()
    free = build(settings)
    assert not [said for said in free.warnings if "passes its limit" in said]
    reach = free.log  # the same motion, with the first axis in its log
    simulator = Simulator(free.diagram)
    free.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(free.reference_duration)
    _, raw = reach.read(simulator.get_context())
    q_1 = raw["joint_state"][:, 0]
    limit = 0.5 * (q_1[0] + q_1[-1])
    gather = SerialChain.gather

    def tight(self, name):
        values = gather(self, name)
        if name == "position_limits":
            values = np.array(values)
            values[0, int(q_1[-1] > q_1[0])] = limit
        return values

    monkeypatch.setattr(SerialChain, "gather", tight)
    settings.reference.dwell *= 1.01  # another content than before
    (said,) = [line for line in build(settings).warnings if "passes its limit" in line]
    assert said.startswith(f"joint 1 passes its limit, q_1 = {np.rad2deg(limit):.1f} deg, at eta")
