"""Audit of guidance: rules that are kept and broken, and lags that are not as assumed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from diagrams.scenario import Scenario
from diagrams.scenario.robot import ServoParameters
from diagrams.scenario.virtual_fixtures import FixtureParameters
from experiments.results.guidance_audit import GuidanceRules, audit, guidance_warnings, observed_lag
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.contact_program import MOST_NEAR, SLOTS
from pfsc_drake.control.fixtures.fixture_parameters import GuidanceParameters
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.near_regions import ScheduledRegions
from pfsc_drake.control.fixtures.record import SLOT
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.geometry.shapes.sphere import SphereRegion
from reporting.registry import METRICS
from tests.control.fixtures.point_robot import (
    DAMPING,
    DELAY,
    LAG,
    MASS,
    PERIOD,
    ball,
    half_space,
    lead,
    point,
    program,
    random_hand,
)


def run(walls, believed, hand, start, noise=0.0):
    """Log of a point behind servos of 5 ms and a bus of 2 ms."""
    guidance = ProgramGuidance(
        point(walls, believed), GuidanceParameters(), [math.inf] * len(walls)
    )
    record = lead(guidance, start, hand, 1.5)
    rows, layout = np.array([step.record for step in record.steps]), guidance.layout
    part = {name: rows[:, place] for name, place in layout.fields.items()}
    log = RunLog(PERIOD * np.arange(len(rows)))
    y = np.array(record.y)
    log.add("y_t", y, "m")
    log.add("y_t_measured", y + noise * np.random.default_rng(1).normal(size=y.shape), "m")
    log.add("velocity_command", part["velocity"], "m/s")
    log.add("rest_point", part["point"], "m")
    log.add("squeezed", part["squeezed"], "1")
    log.add("near_regions", part["near"], "", [f"{k}_{s}" for s in range(MOST_NEAR) for k in SLOT])
    names = [f"plane_{i + 1}" for i in range(len(walls))]
    log.add("region_distance", np.array([[w(p, 0.0)[0] for w in walls] for p in y]), "m", names)
    return log


def scenario(believed):
    return Scenario(
        controller=ControllerParameters(law="velocity_servo", manifold="space"),
        fixtures=FixtureParameters(servo_lag=believed),
        servo=ServoParameters(bandwidth=300.0, bus_delay=DELAY),
    )


GROUND = half_space((0, 0, -0.03), (0, 0, 1))


@pytest.mark.slow(but="0.005")
@pytest.mark.parametrize("believed", [2e-3, 5e-3, 12e-3])
def test_the_lag_is_seen_whatever_was_believed(believed):
    """Also with 1 um of noise on the measured place, and where the floor holds the tool."""
    log = run([GROUND], believed, random_hand(2), (0, 0, 0), noise=1e-6)
    assert observed_lag(log, believed) == pytest.approx(LAG, rel=0.1)
    said = guidance_warnings(log, scenario(believed))
    assert bool(said) == (believed != LAG)
    if said:
        assert f"not {1e3 * believed:g} ms" in said[0]
        least = float(said[0].split("approach_time to ")[1].split(" s")[0])
        assert least == pytest.approx(2.0 * (LAG + DELAY), rel=0.1)


def test_a_tool_that_rests_tells_no_lag():
    log = run([GROUND], 2e-3, lambda t, y: np.zeros(3), (0, 0, 0))
    assert observed_lag(log, 2e-3) is None
    assert guidance_warnings(log, scenario(2e-3)) == []


def test_walls_that_squeeze_are_named_with_how_deep_it_was():
    walls = [half_space((0.5, 0, 0), (1, 0, 0)), GROUND, half_space((0, 0, -0.034), (0, 0, -1))]
    log = run(walls, LAG, lambda t, y: np.zeros(3), (1.0, 0, -0.032))
    (said,) = guidance_warnings(log, scenario(LAG))
    assert said.startswith("plane_2 and plane_3 squeezed the tool for 1.5 s from t = 0.000 s on")
    assert "up to 2 mm inside one" in said


PROMISE = GuidanceRules(MASS, DAMPING, 2.0, 1.0)


FLOOR = half_space((0, 0, 0), (0, 0, 1), speed=0.02)


REGIONS = [FLOOR, half_space((0, 0, 0.06), (0, 0, -1)), ball((0.0, 0.0, 0.03), 0.01)]


def column(log, key):
    return np.arange(SLOTS) * len(SLOT) + SLOT.index(key)


def happened(damping=None):
    """A second between a floor that rises, a soft ceiling and a ball."""
    guidance = program(REGIONS, [math.inf, 2e3, math.inf])

    def hand(t, y):
        return np.array([-12.0, 0.0, 25.0 if t < 0.5 else -25.0])

    record = lead(guidance, (0.03, 0, 0.04), hand, 1.0, damping)
    return np.array(record.y), np.array([s.record for s in record.steps]), guidance.layout


@pytest.fixture(scope="module")
def rows():
    return happened()


def make_log(rows, regions=REGIONS):
    y_t, values, layout = rows
    log = RunLog(PERIOD * np.arange(len(values)))
    part = {name: values[:, rows].copy() for name, rows in layout.fields.items()}
    log.add("velocity_command", part["velocity"], "m/s")
    log.add("guiding_force", part["force"], "N")
    log.add("rest_point", part["point"], "m")
    log.add("near_regions", part["near"], "")
    log.add("tank", part["tank"], "J")
    log.add("free_damping", part["damping"], "N s/m")
    log.add("speed_limit", part["limit"], "m/s")
    log.add("y_t", y_t.copy(), "m")
    clock = part["clock"][:, 0] - LAG - DELAY
    pairs = zip(y_t, clock, strict=True)
    distances = [[region(y, time)[0] for region in regions] for y, time in pairs]
    log.add("region_distance", np.array(distances), "m")
    return log


def worst(log, promise=PROMISE):
    return {name: metric.value for name, metric in audit(log, promise).items()}


def test_what_is_kept_passes(rows):
    found = worst(make_log(rows))
    known = [name for name in METRICS if name.startswith("audit_")]
    assert list(found) == [name for name in known if METRICS[name].needs == ("region_distance",)]
    for name in ("stationarity", "allowance", "energy", "tank"):
        assert found[f"audit_{name}"] < 1e-9
    assert found["audit_bound"] > 0.0
    assert found["audit_missed"] == 0.0
    # and there was something to check
    slots = rows[1][:, rows[2].fields["near"]].reshape(len(rows[1]), -1, len(SLOT))
    phi, soft = slots[..., SLOT.index("phi")], slots[..., SLOT.index("stiffness")] > 0.0
    assert (phi * soft).max() > 1.0
    assert (phi * ~soft).max() > 1.0
    assert np.abs(slots[..., SLOT.index("u")]).max() > 0.01


def test_a_limit_of_speed_gives_the_hand_no_energy():
    """A hand leans on a floor that rises faster than the tool may move."""
    parameters = GuidanceParameters(largest_speed=1e-3)
    guidance = program(REGIONS, [math.inf, 2e3, math.inf], parameters=parameters)
    record = lead(guidance, (0.03, 0, 1e-3), lambda t, y: np.array([0.0, 0.0, -45.0]), 0.5)
    rows = np.array(record.y), np.array([s.record for s in record.steps]), guidance.layout
    found = worst(make_log(rows), replace(PROMISE, largest_speed=1e-3))
    assert record.y[-1][2] > record.y[0][2] + 2e-3
    for name in ("stationarity", "energy", "tank"):
        assert found[f"audit_{name}"] < 1e-9
    assert found["audit_bound"] > 0.0


def tamper_velocity(log):
    log["velocity_command"].values[500] += [0.0, 0.0, 1e-3]


def tamper_force_of_a_region(log):
    phi = log["near_regions"].values[:, column(log, "phi")]
    tick, slot = np.argwhere(phi > 1.0)[0]
    log["near_regions"].values[tick, column(log, "phi")[slot]] += 5.0


def tamper_allowance(log):
    values = log["near_regions"].values
    held = (values[:, column(log, "phi")] > 1.0) & (values[:, column(log, "stiffness")] == 0.0)
    tick, slot = np.argwhere(held)[0]
    values[tick, column(log, "beta")[slot]] -= 1e-3


def tamper_energy(log):
    """A step that speeds up by itself."""
    log["velocity_command"].values[500] *= 1.5


def tamper_tank(log):
    log["tank"].values[300:] += 1e-3


def tamper_bound(log):
    log["guiding_force"].values[:] = -80.0 * log["velocity_command"].values


def tamper_sight(log):
    """A region that was on the tool is not in the list."""
    values = log["near_regions"].values
    tick, slot = np.argwhere(values[:, column(log, "phi")] > 1.0)[-1]
    values[tick, column(log, "index")[slot]] = -1.0


@pytest.mark.parametrize(
    ("tamper", "name", "least"),
    [
        (tamper_velocity, "stationarity", 5e-4),
        (tamper_force_of_a_region, "stationarity", 1e-4),
        (tamper_allowance, "allowance", 5e-4),
        (tamper_energy, "energy", 1e-6),
        (tamper_tank, "tank", 5e-4),
        (tamper_sight, "missed", 0.5),
    ],
)
def test_what_is_broken_is_seen(rows, tamper, name, least):
    log = make_log(rows)
    tamper(log)
    assert worst(log)[f"audit_{name}"] > least


def test_what_a_person_makes_of_the_damping_is_no_secret():
    """It keeps the promise, whatever it is, and shows where none was to change it."""
    log = make_log(happened(lambda t: 15.0 if (t % 0.2) < 0.1 else 300.0))
    found = worst(log, replace(PROMISE, damping=None))
    for name in ("stationarity", "allowance", "energy", "tank"):
        assert found[f"audit_{name}"] < 1e-9
    assert found["audit_bound"] > 0.0
    assert worst(log)["audit_stationarity"] > 1e-4


def test_a_hand_that_gained_more_than_the_tank_is_seen(rows):
    log = make_log(rows)
    tamper_bound(log)
    assert worst(log)["audit_bound"] < 0.0


@pytest.mark.slow
def test_what_a_budget_has_not_looked_at_limits_the_speed_and_is_no_alarm():
    """Six balls around the tool, two distances a tick: brute force tells how near the unseen are.

    What has not been looked at is so far away that the tool, braking, cannot reach it.
    """
    angles = np.arange(6) * math.pi / 3.0
    balls = [
        SphereRegion((0.045 * math.cos(a), 0.045 * math.sin(a), 0.0), 0.02, inside=False)
        for a in angles
    ]
    around = [lambda y, clock, ball=ball: ball.distance(*y) for ball in balls]
    parameters = GuidanceParameters(largest_speed=2.0, braking=2.0)
    nearby = ScheduledRegions(balls, parameters, PERIOD, budget=2)
    guidance = ProgramGuidance(
        replace(point(REGIONS * 2), near=None), parameters, [math.inf] * len(balls)
    )
    memory = nearby.start((0.0, 0.0, 0.0), 0.0)

    def look(z):
        nonlocal memory
        sight = nearby.update(memory, tuple(z), 0.0, 0.0)
        memory = sight.memory
        rows = np.zeros((MOST_NEAR, 6))
        rows[:, 0] = -1.0
        for row, p in zip(rows, sorted(sight.near, key=lambda p: p.h), strict=False):
            row[:] = p.number, p.h, p.h_next, *p.n
        looked_at = [float(i in sight.evaluated) for i in range(len(balls))]
        return np.concatenate([rows.ravel(), [sight.speed_limit], looked_at])

    record = lead(guidance, (0, 0, 0), random_hand(3), 1.0, look=look)
    rows = np.array([step.record for step in record.steps])
    log = make_log((np.array(record.y), rows, guidance.layout), around)
    limit = log["speed_limit"].values[:, 0]
    assert limit.min() < 0.4 * limit.max()
    assert worst(log)["audit_stationarity"] < 1e-9
    for step in record.steps:
        unseen = [
            ball.distance(*step.point)[0] for i, ball in enumerate(balls) if i not in step.evaluated
        ]
        braking = parameters.braking * parameters.approach_time**2
        way = min(unseen) - step.limit * PERIOD
        free = (
            way / parameters.approach_time
            if way < braking
            else math.sqrt(2 * parameters.braking * (way - braking / 2))
        )
        assert np.linalg.norm(step.velocity) < 1e-9 or step.limit <= free + 1e-9
    log["speed_limit"].values[:] = 2.0
    assert worst(log)["audit_stationarity"] > 1e-3


def test_a_run_without_ticks_has_no_audit(rows):
    log = make_log(rows)
    log["velocity_command"].values[:] = np.nan
    assert worst(log) == {}
