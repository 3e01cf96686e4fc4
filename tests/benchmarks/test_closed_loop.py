"""Wall clock time of a fifth of a second of the shipped closed loops."""

from pathlib import Path

import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from experiments.integration import choose_integration
from experiments.simulation import configure
from tests.scenarios import shipped_scenario

SCENARIOS = Path(__file__).resolve().parents[2] / "experiments" / "scenarios"
SPAN = 0.2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pfc_elastic_3r", "pfc_elastic_6r"])
def test_closed_loop(benchmark, name):
    scenario = shipped_scenario(name)
    station = build_station(scenario, SCENARIOS)
    simulator = Simulator(station.diagram)
    integration = choose_integration(station, scenario.simulation, scenario.reference.dwell)
    configure(simulator, integration.scheme, integration.step)
    root = simulator.get_mutable_context()

    def restart():
        root.SetTime(0.0)
        station.set_start(root)
        simulator.Initialize()

    benchmark.pedantic(lambda: simulator.AdvanceTo(SPAN), setup=restart, rounds=5, iterations=1)
    assert root.get_time() == SPAN
    if benchmark.stats is not None:
        benchmark.extra_info["real_time_factor"] = SPAN / benchmark.stats.stats.median
