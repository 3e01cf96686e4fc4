"""Blocks as one function and one by one: the same log to the last bit, in every scenario.

One by one they are interpreted; the one function is machine code in a scenario of each kind.
"""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.scenario_file import SCENARIO_DIRECTORY, scenario_names
from experiments.simulation import configure
from tests.deferred_code import compiled_at_once, interpreted
from tests.scenarios import shipped_scenario

pytestmark = pytest.mark.slow

DURATION = 0.1
# a law, a robot, a manifold, a task, an environment or sensors that none before has
COMPILED = {
    *("pfc_elastic_6r", "pfc_viscoelastic_3r", "pfc_panda_7r", "pfc_scara_4r", "pfc_delta_notch"),
    *("pfc_on_surface_6r", "pfc_tool_axis_6r", "pfc_stream_6r", "pfc_crossing_6r", "pfc_two_arms"),
    *("pfc_compliant_6r", "friction_observer_in_loop", "plate_mounting", "teach_by_hand_6r"),
    *("sfc_polish", "sfc_scan", "sfc_viscoelastic_3r", "ttc_comau_6r", "teleop_region"),
    *("vf_many_surfaces", "vf_moving_region", "vf_seven_axes", "vf_soft_region"),
}
Log = dict[str, np.ndarray]


def run(
    settings: Scenario, fused: bool, compiled: bool, like: Station | None = None
) -> tuple[Station, Log]:
    """Return a station, and the log of its first ticks with whether it ended in a fault."""
    settings.simulation.fused = fused
    with compiled_at_once() if compiled else interpreted():
        station = build_station(settings, SCENARIO_DIRECTORY, like=like)
        simulator = Simulator(station.diagram)
        configure(simulator, "runge_kutta3", settings.controller.sampling_time)
        root = simulator.get_mutable_context()
        station.set_start(root)
        simulator.AdvanceTo(DURATION)
    log = station.log.read(root)[1] | {"stopped": np.array(station.fault(root) is not None)}
    return station, log


def compare(settings: Scenario, compiled: bool = True) -> Log:
    """Refuse logs that differ, and return the fused one."""
    station, fused = run(settings, True, compiled)
    _, one_by_one = run(settings, False, False, station)
    assert fused.keys() == one_by_one.keys()
    for name, values in fused.items():
        np.testing.assert_array_equal(values, one_by_one[name], err_msg=name)
    return fused


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_logs_the_same(name):
    settings = shipped_scenario(name)
    if settings.controller.manifold not in ("path", "trajectory", "surface", "space"):
        pytest.skip("no controller")
    log = compare(settings, name in COMPILED)
    assert len(log["law"]) > 50


@pytest.mark.parametrize("name", ["pfc_elastic_6r", "vf_forbidden_region"])
def test_safe_stops_are_the_same(name):
    """A sensor fails on the way: the fault, and what the drives do then."""
    settings = shipped_scenario(name)
    settings.simulation.sensor_failure.time = 0.03
    settings.simulation.sensor_failure.component = 1
    assert compare(settings)["stopped"]
