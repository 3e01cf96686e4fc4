"""Stepwise simulation of a station with an operator, synchronized with a clock."""

import time
from collections import deque
from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.environment.operator import PULL
from diagrams.live_view import LiveFrame, felt_force
from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.live.takes import Pen
from experiments.simulation import SimulationResult, chunk_ticks, configure
from pfsc_drake.controller.fault_description import FaultReport
from pfsc_drake.physics.operator_hand import HOLD, REQUEST_SIZE, TARGET
from pfsc_drake.robot.robot_model import pose_function

# longest time between two reads of the controls [s]
_STEP = 0.01
# largest lag of simulated time that is caught up [s]
_SLACK = 0.1
# window of the real-time factor [s]
_WINDOW = 1.0
_MOMENT = 0.03  # s


class LiveSimulation:
    """Stepwise simulation of a station.

    Args:
        station: The station, with a live operator.
        settings: Its scenario.
    """

    def __init__(self, station: Station, settings: Scenario) -> None:
        self._station, self._settings = station, settings
        self._period = station.controller.period
        self._ticks_per_step = _ticks_per_step(self._period)
        self._pose = pose_function(station.robot)
        self.restart()

    def restart(self) -> None:
        """Reset the simulation to its start."""
        station, parameters = self._station, self._settings.simulation
        self._simulator = Simulator(station.diagram)
        configure(self._simulator, parameters.integrator, parameters.max_step, parameters.accuracy)
        station.set_start(self.root)
        self._simulator.Initialize()
        self.tick, self._wall, self._pull = 0, 0.0, np.zeros(REQUEST_SIZE)
        self.fault: FaultReport | None = None

    @property
    def root(self) -> Context:
        """Context of the diagram."""
        return self._simulator.get_mutable_context()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.root.get_time())

    def set(self, controls: np.ndarray) -> None:
        """Set the operator's controls from this tick on.

        Args:
            controls: Controls of the operator's hand and switches.
        """
        assert self._station.operator is not None
        self._station.operator.fix(self.root, controls)
        self._pull = controls[PULL]

    def send_waypoints(self, pen: Pen) -> None:
        """Send drawn waypoints from this tick on.

        Args:
            pen: Source of the waypoints.
        """
        taken = self._station.blocks.output(self.root, "controller.waypoint_intake.stream")[1]
        self._station.send_waypoints(self.root, pen.message(self.tick, int(taken)))

    def step(self) -> None:
        """Advance by a step, and check for faults."""
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
            self.fault = FaultReport(failed, self.time)

    def signals(self) -> dict[str, np.ndarray]:
        """Return the current values of the logged signals."""
        return self._station.log.now(self._station.blocks, self.root)

    def frame(self, signals: dict[str, np.ndarray]) -> LiveFrame:
        """Return the current frame for drawing.

        Args:
            signals: From :meth:`signals`.
        """
        coordinates, state = self._station.part.coordinates, signals["joint_state"]
        positions = coordinates.plant_state(state)[: coordinates.num_states // 2]
        pose = np.array(self._pose(state[: self._station.robot.dimension])).ravel()
        target = self._pull[TARGET] if self._pull[HOLD] > 0.5 else None
        point, force = signals["manifold_point"], felt_force(signals)
        return LiveFrame(positions, pose, point, force, target, signals.get("led_point"))

    def result(self) -> SimulationResult:
        """Return the result so far, with a copy of the context."""
        factor = self.time / max(self._wall, 1e-9)
        sentence = None if self.fault is None else self.fault.sentence
        since = None if self.fault is None else self.fault.time
        return SimulationResult(self.root.Clone(), factor, sentence, since)


def _ticks_per_step(period: float) -> int:
    """Return the number of ticks between two reads of the controls.

    It divides the interval of a run's checks for faults, so that a replay of a session does not end
    before it.

    Args:
        period: Sampling time of the controller [s].
    """
    most = max(1, int(_STEP / period * (1.0 + 1e-9)))
    return max(n for n in range(1, most + 1) if chunk_ticks(period) % n == 0)


class RealTimeClock:
    """Synchronization of simulated time with a clock.

    A lag of up to 0.1 s, e.g. of a computer that is busy for a moment, is caught up. After a larger
    lag simulated time continues from there, slower than the clock, see :attr:`factor`.

    Args:
        clock: Returns the time [s].
        sleep: Waits [s].
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._origin = 0.0
        self._past: deque[tuple[float, float]] = deque()

    def restart(self, simulated: float) -> None:
        """Restart after a pause.

        Args:
            simulated: Current simulated time [s].
        """
        now = self._clock()
        self._origin = now - simulated
        self._past = deque([(now, simulated)])

    def wait_until(self, simulated: float) -> None:
        """Wait until the clock reaches a simulated time.

        Args:
            simulated: Current simulated time [s].
        """
        early = self._origin + simulated - self._clock()
        if early > 0.0:
            self._sleep(early)
        elif early < -_SLACK:
            self._origin -= early + _SLACK
        self._past.append((self._clock(), simulated))
        while len(self._past) > 2 and self._past[-1][0] - self._past[1][0] >= _WINDOW:
            self._past.popleft()

    def wait(self) -> None:
        """Wait for a moment during a pause of simulated time."""
        self._sleep(_MOMENT)

    @property
    def factor(self) -> float:
        """Simulated over real time during the last second."""
        (begin, first), (end, last) = self._past[0], self._past[-1]
        return (last - first) / (end - begin) if end > begin else 1.0
