"""A tool led through space: where it starts."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.scenario import Scenario
from diagrams.tasks.make import make_task
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_file

SCENARIOS = Path(__file__).resolve().parents[3] / "experiments" / "scenarios"


@pytest.fixture(name="scenario")
def fixture_scenario():
    return load_file(Scenario, SCENARIOS / "vf_wedge.yaml")


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
    with pytest.raises(InputError, match=r"fixtures.regions = 2 given; .* = path; only a tool led"):
        make_task(scenario, SCENARIOS)
