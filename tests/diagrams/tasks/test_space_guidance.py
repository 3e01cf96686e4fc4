"""Start of a tool that is guided through space."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.scenario.region_motion import Shift, Swinging
from diagrams.scenario.virtual_fixtures import RegionParameters
from diagrams.scenario_task import make_task
from pfsc_drake.controller.fixtures import near_expression, scheduled_regions
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.shapes.plane import Plane
from tests.scenarios import shipped_scenario

SCENARIOS = Path(__file__).resolve().parents[3] / "experiments" / "scenarios"


@pytest.fixture(name="scenario")
def fixture_scenario():
    return shipped_scenario("vf_wedge")


def test_the_start_is_turned_about_the_axes_of_the_tool(scenario):
    """ZYX angles from the orientation to keep, which is given about the world's axes (5.3)."""
    scenario.start.rotation_deg = [20.0, -10.0, 35.0]
    kept = Rotation.from_euler("ZYZ", [0.0, 45.0, 174.2704], degrees=True)
    turned = kept * Rotation.from_euler("ZYX", [20.0, -10.0, 35.0], degrees=True)
    start = make_task(scenario, SCENARIOS).start(np.array([0.0, 0.0, 1e-3]))
    np.testing.assert_allclose(start.target.R_e, turned.as_matrix(), atol=1e-6)
    x, y, z = scenario.start.position
    np.testing.assert_allclose(start.target.y_t, [x, y, z + 1e-3], rtol=1e-15)


def test_regions_need_a_tool_that_is_led(scenario):
    scenario.controller.manifold = "path"
    with pytest.raises(
        InputError, match=r"fixtures.regions = 2 given; .* = path; only a tool guided"
    ):
        make_task(scenario, SCENARIOS)


def test_distances_are_those_of_the_time_and_speeds_those_near_the_start(scenario):
    """A floor that swings, along its normal and about an axis 0.3 m beside the start."""
    plane = scenario.fixtures.regions[0]
    plane.motion = Shift([0, 0, 1], Swinging(amplitude=0.01, frequency=0.5, begin=0.0, ramp=0.01))
    task = make_task(scenario, SCENARIOS)
    clock = np.array([1.5, 2.0, 2.5])
    places = np.tile([0.9, 0.0, 0.83], (3, 1))
    expected = 0.03 - 0.01 * np.sin(np.pi * clock)
    np.testing.assert_allclose(task.distances(places, clock)[:, 0], expected, atol=1e-12)
    assert task.speeds[0] >= 0.01 * np.pi
    assert task.speeds[1] == 0.0


@pytest.mark.parametrize("looks", [0, 2])
def test_as_many_distances_are_computed_as_the_scenario_has_it(scenario, looks):
    """Five floors under the tool, all of them due at every tick."""
    scenario.fixtures.regions = [
        RegionParameters(shape=Plane(origin=[0.95, 0.0, 0.8 - 1e-4 * i])) for i in range(5)
    ]
    scenario.fixtures.distance_evaluations = looks
    x, y, z = scenario.start.position = [0.95, 0.0, 0.801]
    task = make_task(scenario, SCENARIOS)
    assert (near_expression(task) is None) == bool(looks)
    scheduled = scheduled_regions(task)
    sight = scheduled.update(scheduled.start((x, y, z), 0.0), (x, y, z), 0.0, 0.0)
    assert len(sight.evaluated) == (looks or 5)
