"""A station that runs in steps, with a person at its controls."""

import time

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.drawing.live_view import LiveFrame
from diagrams.scenario import Scenario
from diagrams.station import FoundFault, Station
from diagrams.surroundings.operator import PULL
from experiments.simulation import SimulationResult, chunk_ticks, configure
from pfsc_drake.physics.live_hand import ASKED, HOLD, TARGET
from pfsc_drake.robot.robot_model import pose_function

# the longest time between two looks at the controls [s]
_STEP = 0.01


class LiveSimulation:
    """A station from its start on.

    Args:
        station: The station, with an operator whose controls nobody has recorded.
        settings: How it is simulated.
    """

    def __init__(self, station: Station, settings: Scenario) -> None:
        self._station, self._settings = station, settings
        self._period = station.controller.period
        self._ticks_per_step = _ticks_per_step(self._period)
        self._pose = pose_function(station.robot)
        self.restart()

    def restart(self) -> None:
        """Put everything back to the start."""
        station, parameters = self._station, self._settings.simulation
        self._simulator = Simulator(station.diagram)
        configure(self._simulator, parameters.integrator, parameters.max_step, parameters.accuracy)
        station.set_start(self.root)
        self._simulator.Initialize()
        self.tick, self._wall, self._pull = 0, 0.0, np.zeros(ASKED)
        self.fault: FoundFault | None = None

    @property
    def root(self) -> Context:
        """Context of the diagram."""
        return self._simulator.get_mutable_context()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.root.get_time())

    def set(self, controls: np.ndarray) -> None:
        """Set what the person does from this tick on.

        Args:
            controls: See :class:`Operator`.
        """
        assert self._station.operator is not None
        self._station.operator.fix(self.root, controls)
        self._pull = controls[PULL]

    def step(self) -> None:
        """Go on by a step, and look for faults."""
        begin = time.perf_counter()
        failed = None
        try:
            self._simulator.AdvanceTo((self.tick + self._ticks_per_step) * self._period)
            self.tick += self._ticks_per_step
        except RuntimeError as error:
            failed = f"simulation failed: {' '.join(str(error).split())}"
        self._wall += time.perf_counter() - begin
        self.fault = self._station.found_fault(self.root)
        if self.fault is None and failed is not None:
            self.fault = FoundFault(failed, self.time)

    def signals(self) -> dict[str, np.ndarray]:
        """Return what is logged, as it is now."""
        return self._station.log.now(self._station.blocks, self.root)

    def frame(self, signals: dict[str, np.ndarray]) -> LiveFrame:
        """Return what there is to see.

        Args:
            signals: From :meth:`signals`.
        """
        coordinates, state = self._station.part.coordinates, signals["joint_state"]
        positions = coordinates.plant_state(state)[: coordinates.num_states // 2]
        pose = np.array(self._pose(state[: self._station.robot.dimension])).ravel()
        target = self._pull[TARGET] if self._pull[HOLD] > 0.5 else None
        force = signals["wrench_ext"][:3]
        return LiveFrame(positions, pose, signals["manifold_point"], force, target)

    def result(self) -> SimulationResult:
        """Return what came of it so far, in a context of its own."""
        factor = self.time / max(self._wall, 1e-9)
        sentence = None if self.fault is None else self.fault.sentence
        since = None if self.fault is None else self.fault.time
        return SimulationResult(self.root.Clone(), factor, sentence, since)


def _ticks_per_step(period: float) -> int:
    """Return how many ticks there are between two looks at the controls.

    They divide those between a run's looks at faults: then a run that repeats a session does not
    end before it.

    Args:
        period: Sampling time of the controller [s].
    """
    most = max(1, int(_STEP / period * (1.0 + 1e-9)))
    return max(n for n in range(1, most + 1) if chunk_ticks(period) % n == 0)
