"""Switches of regions in a station that a person stands at."""

import copy

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.environment.operator import controls_text, idle_controls
from diagrams.scenario import Scenario
from diagrams.scenario.simulation import OperatorParameters
from diagrams.scenario_task import make_task
from diagrams.warnings.part_warnings import stiff_fixtures
from experiments.scenario_file import find_scenario
from pfsc_drake.yaml.typed import load_file


@pytest.fixture(scope="module")
def wedge():
    file = find_scenario("vf_wedge")
    return load_file(Scenario, file), file.parent


@pytest.mark.slow
def test_names_of_modes_and_regions(wedge):
    settings, folder = wedge
    station = build_station(settings, folder)
    assert station.mode_labels == ("free", "surface", "edge", "corner")
    assert settings.fixtures.names == ["plane_1", "plane_2"]
    assert [fixture.name for fixture in station.task.fixtures] == settings.fixtures.names
    assert "mode" in station.log.rows


def test_a_soft_region_that_is_too_stiff_for_the_damping(wedge):
    """The limit of 90 N s/m with lags of 1/300 s and 2 ms, for soft regions with servos only."""
    settings, folder = copy.deepcopy(wedge[0]), wedge[1]

    def warnings() -> list[str]:
        return stiff_fixtures(settings.fixtures, make_task(settings, folder))

    assert warnings() == []
    settings.fixtures.regions[1].stiffness = 3e3
    assert warnings() == []
    settings.fixtures.regions[1].stiffness = 1e6
    (said,) = warnings()
    assert "fixtures.regions[1].stiffness = 1e+06 N/m" in said and "tolerates 1.6e+05 N/m" in said
    settings.controller.law = "rigid"
    assert warnings() == []


def test_a_person_switches_a_region_off(wedge, tmp_path):
    """Pushed down with 20 N the tool rests on the lower plane until that is switched off."""
    settings, folder = wedge
    regions = settings.fixtures.names
    rows = np.array([idle_controls(regions)] * 3)
    rows[1:, 2] = -20.0
    rows[2, -len(regions)] = 0.0  # the lower plane
    file = tmp_path / "operator.csv"
    file.write_text(controls_text([0, 200, 700], rows, regions, 1e-3))
    settings = copy.deepcopy(settings)
    settings.hand, settings.friction.file = None, ""
    settings.start.position = [0.95, 0.0, 0.802]
    settings.operator = OperatorParameters(inputs=str(file))
    station = build_station(settings, folder)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    heights = []
    for time in (0.69, 0.9):
        simulator.AdvanceTo(time)
        heights.append(station.log.now(station.blocks, root)["tool_pose"][2])
    assert heights[0] == pytest.approx(0.8, abs=1e-4)
    assert heights[1] < 0.79
