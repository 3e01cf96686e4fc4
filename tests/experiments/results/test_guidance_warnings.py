"""What is said after a run within fixtures, from logs of a point robot."""

import math

import numpy as np
import pytest

from diagrams.scenario import Scenario
from diagrams.scenario.drives import ServoParameters
from diagrams.scenario.fixtures import FixtureParameters
from experiments.results.guidance_warnings import guidance_warnings, observed_lag
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.parameters import GuidanceParameters
from pfsc_drake.control.fixtures.program import MOST_NEAR
from pfsc_drake.control.fixtures.record import SLOT
from pfsc_drake.following.options.controller import ControllerParameters
from tests.control.fixtures.point_robot import (
    DELAY,
    LAG,
    PERIOD,
    half_space,
    lead,
    point,
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


FLOOR = half_space((0, 0, -0.03), (0, 0, 1))


@pytest.mark.parametrize("believed", [2e-3, 5e-3, 12e-3])
def test_the_lag_is_seen_whatever_was_believed(believed):
    """Also with 1 um of noise on the measured place, and where the floor holds the tool."""
    log = run([FLOOR], believed, random_hand(2), (0, 0, 0), noise=1e-6)
    assert observed_lag(log, believed) == pytest.approx(LAG, rel=0.1)
    said = guidance_warnings(log, scenario(believed))
    assert bool(said) == (believed != LAG)
    if said:
        assert f"not by {1e3 * believed:g} ms" in said[0]
        least = float(said[0].split("approach_time to ")[1].split(" s")[0])
        assert least == pytest.approx(2.0 * (LAG + DELAY), rel=0.1)


def test_a_tool_that_rests_tells_no_lag():
    log = run([FLOOR], 2e-3, lambda t, y: np.zeros(3), (0, 0, 0))
    assert observed_lag(log, 2e-3) is None
    assert guidance_warnings(log, scenario(2e-3)) == []


def test_walls_that_squeeze_are_named_with_how_deep_it_was():
    walls = [half_space((0.5, 0, 0), (1, 0, 0)), FLOOR, half_space((0, 0, -0.034), (0, 0, -1))]
    log = run(walls, LAG, lambda t, y: np.zeros(3), (1.0, 0, -0.032))
    (said,) = guidance_warnings(log, scenario(LAG))
    assert said.startswith("plane_2 and plane_3 squeezed the tool for 1.5 s from t = 0.000 s on")
    assert "up to 2 mm in one" in said
