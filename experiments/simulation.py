"""Running a path following station."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context

from diagrams.scenario import SimulationParameters
from diagrams.station import Station
from reporting.progress import ProgressListener

# progress and faults are looked at this often [s]; between them nothing interrupts the loop
_CHUNK = 0.05


@dataclass
class SimulationResult:
    """What a simulation left.

    Attributes:
        root: Context of the diagram at the end.
        real_time_factor: Simulated over wall clock time.
        fault: Why it was stopped early, or None.
        fault_time: When that was found [s], or None.
    """

    root: Context
    real_time_factor: float
    fault: str | None
    fault_time: float | None = None


def simulate(
    station: Station,
    parameters: SimulationParameters,
    duration: float,
    progress: ProgressListener,
    interrupted: Callable[[], bool] = lambda: False,
    after_fault: float = 0.0,
) -> SimulationResult:
    """Simulate until the end, until some time after a fault, or an interruption.

    Args:
        station: What to simulate.
        parameters: How; ``integrator`` names a scheme.
        duration: Simulated time [s].
        progress: Told how far the run is.
        interrupted: Whether to stop as soon as the step that is being made is complete.
        after_fault: How long to go on with a system in its safe state [s]; then the run may
            be longer than its duration.
    """
    simulator = Simulator(station.diagram)
    configure(simulator, parameters.integrator, parameters.max_step, parameters.accuracy)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    period = station.controller.period
    last_tick, stride = int(duration / period + 1e-6), chunk_ticks(period)
    wall, tick, fault, fault_time = 0.0, 0, None, None
    while root.get_time() < duration and not interrupted():
        tick += stride
        # ticks are products as in Drake's own schedule, so that rounding loses no last sample
        goal = tick * period if tick < last_tick else max(duration, last_tick * period)
        begin = time.perf_counter()
        try:
            simulator.AdvanceTo(goal)
        except RuntimeError as error:
            fault = station.fault(root) or f"simulation failed: {' '.join(str(error).split())}"
            duration = root.get_time()
        wall += time.perf_counter() - begin
        progress(root.get_time(), "simulating")
        if fault is None and (found := station.found_fault(root)):
            fault, fault_time = found.sentence, found.time
            duration = root.get_time() + after_fault
            last_tick = int(duration / period + 1e-6)
    return SimulationResult(root, root.get_time() / max(wall, 1e-9), fault, fault_time)


def chunk_ticks(period: float) -> int:
    """Return how many ticks are simulated between two looks at faults.

    Args:
        period: Sampling time of the controller [s].
    """
    return max(1, round(_CHUNK / period))


def configure(simulator: Simulator, scheme: str, max_step: float, accuracy: float = 0.0) -> None:
    """Let a simulator integrate.

    Args:
        simulator: The simulator, not yet initialized.
        scheme: Drake's name of the scheme.
        max_step: Its fixed, or with error control its largest step [s].
        accuracy: Accuracy of error control; 0 for fixed steps.
    """
    error_control = accuracy > 0.0
    configuration = SimulatorConfig(
        integration_scheme=scheme,
        max_step_size=max_step,
        use_error_control=error_control,
        accuracy=accuracy if error_control else 1e-6,
    )
    ApplySimulatorConfig(configuration, simulator)
