"""References slowed for the drives: commanded and predicted motion, unchanged references."""

import re
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import (
    GainParameters,
    Keyframe,
    LawGains,
    Line,
    OrientationParameters,
    PathParameters,
)
from diagrams.scenario_task import make_task
from experiments.scenario_file import find_scenario
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices

ARM = "pfc_elastic_3r"
FAST, DWELL = 4.0, 0.1  # m/s, s


@pytest.fixture(name="settings")
def fixture_settings(load_exact_scenario):
    """Return a function that asks three elastic axes for more speed than they have."""

    def change(velocity=FAST, acceleration=20.0, **changes):
        settings = load_exact_scenario(ARM)
        reference = settings.reference
        reference.velocity, reference.acceleration, reference.dwell = velocity, acceleration, DWELL
        reference.points = reference.points[:2]
        settings.start.offset = [0.0, 0.0]
        for key, value in changes.items():
            setattr(reference, key, value)
        return settings

    return change


def run(settings, duration=0.0):
    """Return a station, its log, and how far the tool was from its path at most [m]."""
    station = build_station(settings, Path())
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(duration or station.reference_duration)
    times, raw = station.log.read(simulator.get_context())
    across = indices(station.task.projected_manifold.coordinates, Kind.TRANSVERSAL)
    xi = raw["law"][:, station.law.layout.manifold_state][:, across]
    return station, times, raw["law"], np.linalg.norm(xi, axis=1).max()


def test_a_reference_that_is_too_fast_waits(settings):
    """Torques of the simulated plant are those expected, within the reserve, on the path."""
    station, times, law, deviation = run(settings())
    plan, layout = station.task.drive_plan, station.law.layout
    assert plan.is_slowed and len(plan.messages) == 1
    assert "slowed to" in plan.messages[0] and "of axis" in plan.messages[0]
    assert deviation < 5e-5
    torque, limits = law[:, layout.drive], station.law.limits
    share = np.abs(torque / limits).max()
    assert share < 0.75 and not law[:, layout.status][:, 2].any()
    # a torque is held for a tick, and told for its middle
    middle = times + station.controller.period / 2.0
    expected = [np.interp(middle, plan.times, tau) for tau in plan.demand[:, :3].T]
    assert np.abs(np.array(expected).T - torque).max() < 0.03 * np.abs(torque).max()
    asked, motion = make_task(settings(), Path()).motion, station.task.motion
    assert station.reference_duration == pytest.approx(
        asked.domain[1] + plan.waiting_time, abs=1e-3
    )
    # smooth enough for the law, from rest to rest, and nowhere faster than asked for
    assert motion.first_discontinuity(5) is None
    ends = np.array(motion.domain)
    values = motion.derivatives(ends, 4)[:, :, 0]
    assert np.allclose(values[:, 0], settings().reference.points, rtol=0, atol=1e-12)
    assert np.abs(values[:, 1:4]).max() < 1e-4
    speed = np.abs(motion.derivatives(np.linspace(*ends, 2000), 1)[:, 1, 0])
    fastest = np.abs(asked.derivatives(np.linspace(*asked.domain, 2000), 1)[:, 1, 0]).max()
    assert speed.max() <= fastest * (1.0 + 1e-9)


@pytest.mark.slow
def test_told_only_it_leaves_the_path(settings):
    station, _, law, deviation = run(settings(limits="warn"), 0.6)
    assert not station.task.drive_plan.is_slowed
    assert "limits: respect would slow it down" in station.task.drive_plan.messages[0]
    assert law[:, station.law.layout.status][:, 2].any() and deviation > 1e-4


def test_a_reference_that_fits_is_left_as_it_is(settings):
    """To the last bit, and nothing is said."""
    given = settings(velocity=0.8, acceleration=2.0)
    station = build_station(given, Path())
    asked = make_task(given, Path()).motion
    assert np.array_equal(station.task.motion.coefficients, asked.coefficients)
    assert np.array_equal(station.task.motion.breakpoints, asked.breakpoints)
    assert not station.task.drive_plan.is_slowed and station.task.drive_plan.messages == []


def quick(name, load_exact_scenario):
    """Return a shipped scenario whose short motion asks for more than its drives can do."""
    settings = load_exact_scenario(name)
    reference = settings.reference
    reference.dwell, reference.velocity, reference.acceleration = 0.05, 2.0, 20.0
    reference.points = [reference.points[0], reference.points[0] + 0.2]
    if reference.places:
        reference.places = [reference.places[0], [x + 0.1 for x in reference.places[0]]]
    settings.controller.effort_scale = 0.5
    return settings


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pfc_panda_7r", "sfc_elastic_6r", "pfc_viscoelastic_3r"])
def test_other_robots_laws_and_surfaces_wait_too(name, load_exact_scenario):
    station = build_station(quick(name, load_exact_scenario), find_scenario(name).parent)
    plan, n = station.task.drive_plan, station.robot.dimension
    assert plan.is_slowed
    asked, planned = (
        np.max(np.abs(demand[:, :n]) / plan.limits[:n])
        for demand in (plan.requested_demand, plan.demand)
    )
    assert planned < min(asked, 0.75)
    waited = np.trapezoid(1.0 - plan.speed_scaling, plan.times)
    assert plan.waiting_time == pytest.approx(waited) and waited > 0.0


@pytest.mark.slow
def test_velocity_servos_keep_a_reserve_of_speed(settings):
    """On the same path the joints' speeds, not torques, are what is scarce."""
    given = settings(velocity=3.0, acceleration=20.0)
    given.controller.law, given.controller.effort_scale = "velocity_servo", 5.0
    poles = GainParameters(poles=[-20.0])
    given.controller.gains = {"velocity_servo": LawGains(eta=poles, xi=poles, phi=poles)}
    plan = build_station(given, Path()).task.drive_plan
    asked, planned = (
        np.max(np.abs(demand[:, 3:]) / plan.limits[3:])
        for demand in (plan.requested_demand, plan.demand)
    )
    assert asked > 0.75 and 0.5 < planned <= 0.7
    assert "% of the speed of axis" in plan.messages[0]


@pytest.mark.slow
def test_what_seems_too_much_at_a_glance_is_looked_at_closely(load_exact_scenario):
    """Seven axes at 93 % of a joint's speed, which the coarse grid of a glance overstates."""
    settings = load_exact_scenario("pfc_elastic_7r")
    station = build_station(settings, find_scenario("pfc_elastic_7r").parent)
    assert not station.task.drive_plan.messages
    asked = make_task(settings, find_scenario("pfc_elastic_7r").parent).motion
    np.testing.assert_array_equal(station.task.motion.breakpoints, asked.breakpoints)


@pytest.fixture(name="turning")
def fixture_turning(load_exact_scenario):
    """Return a function that makes a stiff arm turn its tool evenly on a line."""

    def change(name, line, first, last):
        settings = load_exact_scenario(name)
        fractions = np.linspace(0.0, 1.0, 5)
        angles = np.linspace(first, last, 5).tolist()
        keyframes = [Keyframe(f, a) for f, a in zip(fractions.tolist(), angles, strict=True)]
        settings.path = PathParameters(line, OrientationParameters("zyx", keyframes))
        chosen, gains = settings.controller, GainParameters(poles=[-20.0, -20.0])
        chosen.law, chosen.gains = "rigid", {"rigid": LawGains(gains, gains, gains)}
        asked = settings.reference
        asked.points, asked.dwell, asked.velocity, asked.acceleration = [0.0, 0.2], 0.0, 0.2, 1.0
        settings.start.offset, settings.start.posture_deg = [0.0, 0.0], []
        return settings

    return change


@pytest.mark.slow
def test_a_wrist_that_becomes_singular_on_the_way_is_named_with_its_place(turning):
    """Against the law's own fault in a run."""
    line = Line([0.9, -0.1, 0.9], [0.9, 0.1, 0.9])
    settings = turning("pfc_comau_6r", line, [0, 50, 0], [0, 130, 0])
    settings.faults.joint_limits = False  # one is passed before
    station = build_station(settings, Path())
    (said,) = [s for s in station.warnings if "singular" in s]
    place = re.search(r"wrist singular at eta = (.*) m: q_5 = .* deg \(q_4 and q_6 can", said)
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(station.reference_duration)
    _, raw = station.log.read(simulator.get_context())
    faults = raw["law"][:, station.law.layout.status][:, 0]
    i = int(np.argmax(faults != 0.0))
    assert faults[i] in (Fault.SINGULAR, Fault.JOINT_SPEED)  # joints become fast just before
    eta = raw["manifold_point"][i, station.task.projected_manifold.layout.eta][0]
    assert eta - 1e-3 < float(place[1]) < eta + 6e-3


@pytest.mark.slow
@pytest.mark.parametrize(("last", "found"), [(240.0, 1), (60.0, 0)])
def test_a_joint_that_passes_its_limit_on_the_way_is_named_with_its_place(turning, last, found):
    """The last joint turns as the tool does, up to 166 deg."""
    line = Line([0.5, 0.0, 0.4], [0.5, 0.2, 0.4])
    settings = turning("pfc_panda_7r", line, [0, 0, 180], [last, 0, 180])
    said = [s for s in build_station(settings, Path()).warnings if "passes its limit" in s]
    assert len(said) == found
    if found:
        place = re.search(
            r"joint 7 passes its limit, q_7 = -166.0 deg, at eta = (.*) m, af", said[0]
        )
        assert 0.15 < float(place[1]) < 0.2


@pytest.mark.slow
def test_weight_above_the_reserve_is_said_and_not_waited_for(settings):
    """It is the same torque whatever the drives can do, and a little less than that in motion."""
    slow, weights = {"velocity": 0.2, "acceleration": 0.5}, []
    strong = build_station(settings(**slow), Path()).task.drive_plan
    assert not strong.messages
    demand = np.abs(strong.demand[:, :3]).max(axis=0) / strong.limits[:3]
    axis = np.argmax(demand)
    for share, words in ((0.9, "would leave the weight"), (1.25, "cannot be held there")):
        weak = settings(**slow)
        weak.controller.effort_scale = demand[axis] / share
        plan = build_station(weak, Path()).task.drive_plan
        said = next(line for line in plan.messages if line.startswith("holding still takes"))
        found = re.search(r"takes (\d+) % of the torque of axis (\d) at .* leaves 70 %", said)
        assert found and words in said and int(found[2]) == axis + 1
        assert 0.8 * share < int(found[1]) / 100.0 < share
        weights.append(int(found[1]) * weak.controller.effort_scale)
        assert strong.times[-1] <= plan.times[-1] < 1.5 * strong.times[-1]
    assert weights[0] == pytest.approx(weights[1], rel=0.015)
