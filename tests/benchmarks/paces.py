"""How fast scenarios run: block by block, as one function, and their plants alone.

The last is what the same plant reaches when the torques of the run are replayed: a controller that
takes no time. All three in one process, in turns, as the machine's pace changes from hour to hour;
a fixed piece of work tells it.

    python -m tests.benchmarks.paces [scenario ..]
"""

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from diagrams.builder import build_station
from diagrams.robots.arm import add_arm
from diagrams.scenario import Scenario
from diagrams.station import Station
from diagrams.tasks.make import make_task
from experiments.catalog.scenario_catalog import SCENARIO_DIRECTORY, find_scenario
from experiments.simulation import configure
from pfsc_drake.yaml.typed import load_file

# shares of the replayed torque's pace that are aimed at
GOALS = {
    "pfc_elastic_6r": 0.60,
    "pfc_compliant_6r": 0.45,
    "operator_hand_6r": 0.45,
    "vf_forbidden_region": 0.40,
    "pfc_elastic_7r": 0.45,
    "vf_seven_axes": 0.45,
}
DURATION, ROUNDS = 1.0, 3
_SCHEME = "runge_kutta3"


def pace(start: Callable[[], Simulator]) -> float:
    """Return simulated over wall clock time of a simulation, the second tenth of it and after."""
    simulator = start()
    simulator.AdvanceTo(0.1 * DURATION)
    begin = time.perf_counter()
    simulator.AdvanceTo(DURATION)
    return 0.9 * DURATION / (time.perf_counter() - begin)


def of_station(settings: Scenario, station: Station) -> Simulator:
    """Return a simulator of a station at its start."""
    simulator = Simulator(station.diagram)
    configure(simulator, _SCHEME, settings.controller.sampling_time)
    station.set_start(simulator.get_mutable_context())
    return simulator


def replayed(settings: Scenario, station: Station) -> Callable[[], Simulator]:
    """Run a station, and return what simulates its plant under the same torques."""
    simulator = of_station(settings, station)
    simulator.AdvanceTo(DURATION)
    times, log = station.log.read(simulator.get_context())
    torque = log.get("drive_torque", log["law"][:, station.law.layout.drive])
    builder = DiagramBuilder()
    part = add_arm(builder, settings, SCENARIO_DIRECTORY)
    told = TrajectorySource(PiecewisePolynomial.ZeroOrderHold(times, torque.T))
    part.connect_drives(builder, builder.AddSystem(told).get_output_port())
    diagram: Diagram = builder.Build()

    def start() -> Simulator:
        alone = Simulator(diagram)
        configure(alone, _SCHEME, settings.controller.sampling_time)
        part.place(part.plant.GetMyMutableContextFromRoot(alone.get_mutable_context()), x)
        return alone

    x = station.initial_state
    return start


def machine() -> float:
    """Return the time of a fixed piece of work in Python and numpy [ms]."""
    begin = time.perf_counter()
    matrix, total = np.eye(6) + 0.1, 0.0
    for k in range(20_000):
        total += float(matrix[k % 6] @ matrix[0])
    return 1e3 * (time.perf_counter() - begin)


def compare(name: str) -> dict[str, float]:
    """Return the medians of a scenario's paces."""
    settings = load_file(Scenario, find_scenario(name))
    task = make_task(settings, SCENARIO_DIRECTORY)
    stations = {}
    for key, fused in (("systems", False), ("fused", True)):
        settings.simulation.fused = fused
        stations[key] = build_station(settings, SCENARIO_DIRECTORY, task=task)
    starts = {
        key: lambda station=station: of_station(settings, station)
        for key, station in stations.items()
    }
    starts["replayed"] = replayed(settings, stations["fused"])
    found: dict[str, list[float]] = {}
    for _ in range(ROUNDS):
        for key, start in starts.items():
            found.setdefault(key, []).append(pace(start))
    return {key: statistics.median(values) for key, values in found.items()}


def main() -> None:
    """Print the table."""
    print(f"machine: {machine():.1f} ms for a fixed piece of work")
    print(f"{'times real time':24s} {'systems':>8s} {'fused':>8s} {'replayed':>9s}  share (goal)")
    for name in sys.argv[1:] or GOALS:
        medians = compare(name)
        share = medians["fused"] / medians["replayed"]
        before = medians["systems"] / medians["replayed"]
        goal = f" ({GOALS[name]:.2f})" if name in GOALS else ""
        print(
            f"{name:24s} {medians['systems']:8.2f} {medians['fused']:8.2f} "
            f"{medians['replayed']:9.2f}  {before:.2f} -> {share:.2f}{goal}",
            flush=True,
        )


if __name__ == "__main__":
    main()
