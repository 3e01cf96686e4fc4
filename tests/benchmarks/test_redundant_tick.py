"""Time of one controller tick of seven elastic axes on their way, by what their posture does.

Run with ``pytest tests/benchmarks --benchmark-enable``; otherwise every benchmark runs once.
"""

import itertools
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import PostureParameters
from experiments.integration import choose_integration
from experiments.simulation import configure
from tests.scenarios import shipped_scenario

POSTURES = {
    "reference": PostureParameters(),
    "elbow": PostureParameters(task="elbow"),
    "inertia": PostureParameters(weight="inertia"),
    "limits": PostureParameters(task="limits", weight="range"),
}
SPAN, COUNT = 0.45, 64


@pytest.mark.slow
@pytest.mark.parametrize("posture", POSTURES)
def test_tick_of_seven_elastic_axes(benchmark, posture):
    """Observers and supervision included, on the states of successive ticks at 1 m/s."""
    scenario = shipped_scenario("pfc_elastic_7r")
    scenario.controller.posture = POSTURES[posture]
    scenario.reference.dwell = 0.02
    station = build_station(scenario, Path())
    simulator = Simulator(station.diagram)
    integration = choose_integration(station, scenario.simulation, 0.02)
    configure(simulator, integration.scheme, integration.step)
    root, period = simulator.get_mutable_context(), station.controller.period
    station.set_start(root)
    instants = []
    for k in range(COUNT):
        simulator.AdvanceTo(SPAN + k * period)
        instants.append(root.Clone())
    contexts = itertools.cycle(instants)

    def fresh():
        """Return the station at one of the instants, with nothing computed yet."""
        root.SetTimeStateAndParametersFrom(next(contexts))
        return (station.blocks, root), {}

    torque = benchmark.pedantic(
        station.controller.drive, setup=fresh, rounds=2000, warmup_rounds=50
    )
    assert np.isfinite(torque).all()
    assert station.fault(root) is None
