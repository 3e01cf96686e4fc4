"""A station's closed loop, linearized over one sampling period."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.builder import build_station
from diagrams.integration import continuous_modes
from diagrams.linearization import OnePeriodMap
from diagrams.scenario import Scenario
from diagrams.station import Station
from diagrams.tasks.task import Task
from experiments.simulation import configure
from pfsc_drake.compiled.bound_function import compiled_when_bound
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.margins.modes import in_loop
from pfsc_drake.systems.can_fail import FailingSystem
from pfsc_drake.systems.physics.bus_delay import BusDelay

# accurate enough for eigenvalues while no mode turns by more than 1 rad per step; RK3 would damp
# such a resonance by 30 1/s at 1 ms
_SCHEME, _MOST_STEPS = "runge_kutta5", 100


class StationLoop:
    """A station and the map of one of its sampling periods.

    Args:
        settings: The scenario, without what has no slope.
        folder: Where its relative file names start.
        task: Its task, if it has been made before.

    Attributes:
        station: The station.
        map: The map.
        drives: Variables that hold what the drives are told, shape (N,).
        drives_are_servos: Whether these are velocities for servos that sample faster, not torques.
    """

    def __init__(self, settings: Scenario, folder: Path, task: Task | None = None) -> None:
        with compiled_when_bound():
            self.station: Station = build_station(settings, folder, task=task)
        diagram, period = self.station.diagram, self.station.controller.period
        self._step = self._accurate_step()
        self.map = OnePeriodMap(diagram, period, self.configure)
        self._can_fail = [s for s in diagram.GetSystems() if isinstance(s, FailingSystem)]
        self.drives, self.drives_are_servos = self._find_drives()

    def configure(self, simulator: Simulator) -> None:
        """Let a simulator integrate as the map does.

        Args:
            simulator: The simulator, not yet initialized.
        """
        configure(simulator, _SCHEME, self._step)

    def has_failed(self, root: Context) -> bool:
        """Return whether a system is in its safe state.

        Args:
            root: Context of the diagram at a tick that is not made yet.
        """
        return any(
            system.fault(system.GetMyContextFromRoot(root)) is not Fault.NONE
            for system in self._can_fail
        )

    def variables_in_loop(self, sections: list[Context]) -> np.ndarray:
        """Return the variables whose changes come back through plant and controller.

        Args:
            sections: Contexts right after a tick; what is in the loop at one of them is.
        """
        core = np.zeros(self.map.size, dtype=bool)
        core[self.map.rows(self.station.part.plant)] = True
        core[self.drives] = True
        found = core
        for section in sections:
            slope = self.map.derivative(section)
            smooth = core | ~slope.switches
            changes = slope.changes & smooth & smooth[:, None]
            found = found | in_loop(changes, core)
        return np.flatnonzero(found)

    def _accurate_step(self) -> float:
        station = self.station
        root, period = station.diagram.CreateDefaultContext(), station.controller.period
        station.set_start(root)
        if root.num_continuous_states() == 0:
            return period
        fastest = float(np.max(np.abs(continuous_modes(station.diagram, root))))
        return period / min(max(int(np.ceil(fastest * period)), 1), _MOST_STEPS)

    def _find_drives(self) -> tuple[np.ndarray, bool]:
        """Find where the loop can be broken at its own sampling time."""
        systems = {system.get_name(): system for system in self.station.diagram.GetSystems()}
        N = self.station.robot.dimension
        for system in systems.values():
            if isinstance(system, BusDelay):  # newest sample first
                return self.map.rows(system)[:N], True
        name = "velocity_hold" if "velocity_hold" in systems else "hold"
        return self.map.rows(systems[name]), name != "hold"


@dataclass(frozen=True)
class LinearLoop:
    """A loop linearized at one instant.

    Attributes:
        A: Map of one period for the variables in the loop, shape (n, n).
        holds: Where the drives' commands stand among them, shape (N,).
    """

    A: np.ndarray
    holds: np.ndarray


def linearize(loop: StationLoop, section: Context, chosen: np.ndarray) -> LinearLoop | None:
    """Linearize a loop at an instant.

    Args:
        loop: The loop.
        section: Context right after a tick.
        chosen: The variables in the loop, in increasing order.

    Returns:
        The linear loop; None if the law goes to its safe state there.
    """
    loop.map.approach(section)
    if loop.has_failed(loop.map.context):
        return None
    slope = loop.map.derivative(section, chosen)
    return LinearLoop(slope.A, np.searchsorted(chosen, loop.drives))
