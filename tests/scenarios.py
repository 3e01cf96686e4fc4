"""Shipped scenarios for tests, which change them."""

from copy import deepcopy
from functools import cache

from diagrams.scenario import Scenario
from experiments.scenario_file import find_scenario
from pfsc_drake.yaml.typed import load_file

# s; to fuse a station pays where it is simulated for longer
LONG = 0.5


def shipped_scenario(name: str) -> Scenario:
    """Return a fresh copy of a shipped scenario; its file is read once per process.

    Args:
        name: Name of the scenario.
    """
    return deepcopy(_read(name))


@cache
def _read(name: str) -> Scenario:
    return load_file(Scenario, find_scenario(name))
