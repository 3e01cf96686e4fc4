"""Blocks as one function and one by one: the same log to the last bit, in every scenario.

The one is machine code, the others are interpreted.
"""

from contextlib import nullcontext

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from diagrams.tasks.make import make_task
from experiments.catalog.scenario_catalog import SCENARIO_DIRECTORY, find_scenario, scenario_names
from experiments.simulation import configure
from pfsc_drake.yaml.typed import load_file
from tests.deferred_code import compiled_at_once

pytestmark = pytest.mark.slow

DURATION = 0.1


def log_of(settings: Scenario, fused: bool, task) -> dict[str, np.ndarray]:
    """Return the log of a scenario's first ticks, with whether it ended in a fault."""
    settings.simulation.fused = fused
    with compiled_at_once() if fused else nullcontext():
        station = build_station(settings, SCENARIO_DIRECTORY, task=task)
        simulator = Simulator(station.diagram)
        configure(simulator, "runge_kutta3", settings.controller.sampling_time)
        root = simulator.get_mutable_context()
        station.set_start(root)
        simulator.AdvanceTo(DURATION)
    return station.log.read(root)[1] | {"stopped": np.array(station.fault(root) is not None)}


def compare(settings: Scenario) -> dict[str, np.ndarray]:
    """Refuse logs that differ, and return the fused one."""
    task = make_task(settings, SCENARIO_DIRECTORY)
    fused, one_by_one = (log_of(settings, kind, task) for kind in (True, False))
    assert fused.keys() == one_by_one.keys()
    for name, values in fused.items():
        np.testing.assert_array_equal(values, one_by_one[name], err_msg=name)
    return fused


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_logs_the_same(name):
    settings = load_file(Scenario, find_scenario(name))
    if settings.controller.manifold not in ("path", "trajectory", "surface", "space"):
        pytest.skip("no controller")
    log = compare(settings)
    assert len(log["law"]) > 50


@pytest.mark.parametrize("name", ["pfc_elastic_6r", "vf_forbidden_region"])
def test_safe_stops_are_the_same(name):
    """A sensor fails on the way: the fault, and what the drives do then."""
    settings = load_file(Scenario, find_scenario(name))
    settings.simulation.sensor_failure.time = 0.03
    settings.simulation.sensor_failure.component = 1
    assert compare(settings)["stopped"]
