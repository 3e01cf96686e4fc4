"""Time of one tick of guidance within many regions, alone and as a whole chain in the robot's loop.

The chain is everything between the measured joint state and wrench, and the reference of the
velocity servos.
Run with ``pytest tests/benchmarks --benchmark-enable``; otherwise every benchmark runs once.
"""

import itertools
import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from experiments.integration import choose_integration
from experiments.scenario_file import find_scenario
from experiments.simulation import configure
from pfsc_drake.control.fixtures.command_dynamics import ServoDynamics
from pfsc_drake.control.fixtures.fixture_guidance import GuidedTool
from pfsc_drake.control.fixtures.fixture_parameters import Admittance, GuidanceParameters
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.near_regions import near_rows, reaches
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.geometry.shapes.sphere import SphereRegion
from pfsc_drake.yaml.typed import load_file
from tests.control.fixtures.point_robot import Guide, point
from tests.scenarios import shipped_scenario

PERIOD, REGIONS, TICKS = 1e-3, 8, 200
PULLS = {
    "free": ((0.3, 0.3, 0.3), (0.0, 0.0, 0.0)),
    "surface": ((0.3, 0.3, 0.0), (1.0, 0.0, -10.0)),
    "edge": ((0.0, 0.3, 0.0), (-10.0, 0.5, -10.0)),
    "corner": ((0.0, 0.0, 0.0), (-10.0, -10.0, -10.0)),
}


@pytest.mark.parametrize("place", PULLS)
def test_rules_alone(benchmark, place):
    """Time of 200 ticks; those in a table are 200 times as long."""
    far = np.random.default_rng(0).uniform(-0.5, 0.5, (REGIONS - 3, 3)) + np.array([0, 0, 1.2])
    regions = [HalfSpace([0, 0, 0], normal) for normal in ([0, 0, 1], [1, 0, 0], [0, 1, 0])]
    regions += [SphereRegion(centre, 0.05, inside=False) for centre in far]
    parameters = GuidanceParameters()
    tool = GuidedTool(
        point([]).motion,
        ServoDynamics(5e-3, 2e-3, PERIOD),
        Admittance(3.0, 90.0, PERIOD),
        REGIONS,
        near_rows(regions, reaches(parameters, PERIOD, [0.0] * REGIONS)),
    )
    y, force = PULLS[place]
    guide = Guide(ProgramGuidance(tool, parameters, [math.inf] * REGIONS), y)
    state = [np.array(y)]

    def ticks():
        (y,) = state
        for _ in range(TICKS):
            step = guide.step(y, np.zeros(3), force)
            y = y + PERIOD * step.velocity
        state[:] = (y,)

    benchmark.pedantic(ticks, rounds=20, warmup_rounds=2)


@pytest.mark.slow
def test_whole_chain(benchmark):
    """A hand presses the tool on the cylinder of `vf_forbidden_region`, six balls around it."""
    file = find_scenario("vf_forbidden_region")
    scenario = load_file(Scenario, file)
    balls = shipped_scenario("vf_many_surfaces").fixtures.regions[3:]
    start = np.array(scenario.start.position)
    clear = [b for b in balls if np.linalg.norm(start - b.shape.origin) > b.shape.radius + 0.05]
    scenario.fixtures.regions += clear[: REGIONS - len(scenario.fixtures.regions)]
    scenario.hand.waypoints = scenario.hand.waypoints[:1]
    scenario.hand.waypoints[0].position = start + np.array([0.03, 0.0, 0.0])
    station = build_station(scenario, file.parent)
    simulator = Simulator(station.diagram)
    integration = choose_integration(station, scenario.simulation, scenario.reference.dwell)
    configure(simulator, integration.scheme, integration.step)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.AdvanceTo(1.5)
    assert station.mode_name(int(station.log.now(station.blocks, root)["mode"][0])) == "surface"
    plant = station.part.plant
    context = plant.GetMyMutableContextFromRoot(root)
    state = plant.GetPositionsAndVelocities(context)
    nudges = itertools.cycle([0.0, 1e-9])

    def change():
        plant.SetPositionsAndVelocities(context, state + next(nudges))
        # what the world needs to make the sensors' values is not the controller's time
        station.blocks.output(root, "force_torque_sensor.measured_wrench")

    def drive():
        return station.controller.drive(station.blocks, root)

    benchmark.pedantic(drive, setup=change, rounds=500, warmup_rounds=20)
