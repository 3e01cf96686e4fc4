"""A shipped scenario's station that is run for a while."""

from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from experiments.results.run_signals import collect_log
from experiments.scenario_file import SCENARIO_DIRECTORY
from experiments.simulation import configure


def run_station(settings, end, like=None):
    """Return a station, its context at the end, and its log.

    Args:
        settings: The scenario.
        end: For how long [s].
        like: Station that differs in the nominal model only, if it has been built.
    """
    station = build_station(settings, SCENARIO_DIRECTORY, like=like)
    simulator = Simulator(station.diagram)
    configure(simulator, "runge_kutta5", 1e-3)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.AdvanceTo(end)
    return station, root, collect_log(station, root)
