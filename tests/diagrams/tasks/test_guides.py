"""Guides of a scenario: creation, warnings, refusals."""

import copy
from pathlib import Path

import numpy as np
import pytest

from diagrams.scenario.virtual_fixtures import GuideParameters
from diagrams.scenario_task import make_task
from diagrams.tasks.task_drawing import drawing_of
from diagrams.warnings.part_warnings import firm_guides, stiff_fixtures
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.shapes.path_shapes import Line
from pfsc_drake.geometry.shapes.through_waypoints import Waypoints
from tests.scenarios import shipped_scenario

SCENARIOS = Path(__file__).resolve().parents[3] / "experiments" / "scenarios"


@pytest.fixture(scope="module", name="shipped")
def fixture_shipped():
    return shipped_scenario("vf_nearest_path")


@pytest.fixture(name="scenario")
def fixture_scenario(shipped):
    return copy.deepcopy(shipped)


def test_guides_are_named_and_can_be_switched_beside_the_regions(scenario):
    assert scenario.fixtures.guide_names == ["circle_1", "line_2", "waypoints_3"]
    assert scenario.switched_regions == ["plane_1", "circle_1", "line_2", "waypoints_3"]
    task = make_task(scenario, SCENARIOS)
    assert list(task.guides) == scenario.fixtures.guide_names
    assert list(task.guides.values()) == list(task.guides.values())


def test_distances_are_those_of_the_shapes(scenario):
    guides = make_task(scenario, SCENARIOS).guides
    y = np.array([[0.95, -0.12, 0.93], [0.85, -0.12, 0.9]])
    expected = [np.hypot(0.05, 0.03), 0.05]
    np.testing.assert_allclose(guides["circle_1"].distances(y), expected, atol=1e-9)
    begin, end = np.array([0.78, 0.06, 0.9]), np.array([1.02, 0.1, 0.98])
    axis = (end - begin) / np.linalg.norm(end - begin)
    across = y - begin - ((y - begin) @ axis)[:, None] * axis
    expected = np.linalg.norm(across, axis=1)
    np.testing.assert_allclose(guides["line_2"].distances(y), expected, atol=1e-9)


def test_a_drawing_shows_each_guide(scenario):
    task = make_task(scenario, SCENARIOS)
    lines = drawing_of(task).outline()[-3:]
    for line, guide in zip(lines, task.guides.values(), strict=True):
        assert np.nanmax(guide.distances(line)) < 1e-9


def test_a_file_that_is_not_there_is_named_with_its_guide(scenario):
    scenario.fixtures.guides[2] = GuideParameters(Waypoints("paths/gide.csv"))
    with pytest.raises(InputError, match=r"fixtures.guides\[2\].*gide.csv"):
        make_task(scenario, SCENARIOS)


def test_guides_need_a_guided_tool(scenario):
    scenario.controller.manifold, scenario.fixtures.regions = "path", []
    with pytest.raises(
        InputError, match=r"fixtures.guides = 3 given; .* = path; only a tool guided"
    ):
        make_task(scenario, SCENARIOS)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"stiffness": 0.5}, "stiffness = 0.5"),
        ({"reach": 1e-4}, "reach = 0.0001"),
    ],
)
def test_numbers_out_of_range_are_refused(changes, said):
    with pytest.raises(InputError, match=said):
        GuideParameters(**changes)


def test_more_than_sixteen_are_refused(scenario):
    with pytest.raises(InputError, match="guides = 17 given; allowed: 16 or fewer"):
        type(scenario.fixtures)(guides=[GuideParameters(Line())] * 17)


def test_weak_hands_and_stiff_guides_are_reported(scenario):
    task = make_task(scenario, SCENARIOS)
    assert firm_guides(task.guides, [45.0]) == []
    said = firm_guides(task.guides, [20.0])
    assert len(said) == 3
    assert "fixtures.guides[0] (circle_1): 34.3 N are needed to leave it" in said[0]
    assert stiff_fixtures(scenario.fixtures, task) == []
    scenario.fixtures.guides[1].stiffness = 1e5
    scenario.compliance.tangential.damping.value = 20.0
    (warning,) = stiff_fixtures(scenario.fixtures, make_task(scenario, SCENARIOS))
    assert warning.startswith("fixtures.guides[1].stiffness = 100000 N/m: compliance")
