"""Simulation of a station, and computing time of its controller."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context

from diagrams.scenario import SimulationParameters
from diagrams.station import Station
from diagrams.tasks.streaming import ScenarioStream
from experiments.results.run_log import RunLog
from pfsc_drake.controller.tasks.space_task import SpaceTask
from reporting.progress import ProgressListener

# interval of progress reports and checks for faults [s]
_CHUNK = 0.05
_SAMPLES = 1000
_JOINT_STATE = ("q_J", "v_J", "q_M", "v_M")


@dataclass
class SimulationResult:
    """Result of a simulation.

    Attributes:
        root: Context of the diagram at the end.
        real_time_factor: Simulated over wall clock time.
        fault: Fault that stopped it early, or None.
        fault_time: Time of detection [s], or None.
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
        station: The station.
        parameters: Parameters of the simulation; ``integrator`` names a scheme.
        duration: Simulated time [s].
        progress: Progress listener.
        interrupted: Whether to stop after the current step.
        after_fault: Simulated time in the safe state after a fault [s], which may exceed the
            duration.
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
    """Return the number of ticks between two checks for faults.

    Args:
        period: Sampling time of the controller [s].
    """
    return max(1, round(_CHUNK / period))


def configure(simulator: Simulator, scheme: str, max_step: float, accuracy: float = 0.0) -> None:
    """Configure the integrator of a simulator.

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


def measure_tick(station: Station, root: Context, log: RunLog) -> np.ndarray:
    """Evaluate the controller chain, from the joint state to the drives, at logged states.

    Args:
        station: The station that was simulated.
        root: Its context, which is overwritten.
        log: Log of the run.

    Returns:
        Wall clock time of each evaluation [s].
    """
    controller, blocks = station.controller, station.blocks
    sensor, rest = _sensor(station, root), _guidance(station, root)
    names = [name if name in log else name.replace("M", "J") for name in _JOINT_STATE]
    states = np.hstack([log[name].values for name in names])
    finite = np.isfinite(states).all(axis=1) & np.isfinite(log["theta"].values[:, 0])
    finite &= log["theta"].values[:, 0] >= _known_from(station, root)
    usable = np.flatnonzero(finite[1:] & finite[:-1]) + 1
    chosen = usable[:: max(1, len(usable) // _SAMPLES)]
    plant_states = [station.part.coordinates.plant_state(x) for x in states[chosen]]
    # a projection has parameters and, where it is integrated, arc lengths
    memory = station.task.projected_manifold.layout.memory
    projections = np.hstack([log["theta"].values, log["eta"].values])[
        :, : memory.stop - memory.start
    ]
    elapsed = []
    for k, x in zip(chosen, plant_states, strict=True):
        root.SetTime(log.time[k])
        station.set_projection(root, projections[k - 1])
        station.set_robot_state(root, x)
        rest(log["y_t"].values[k - 1])
        # the controller compares measurements with the previous ones
        controller.set_last_state(blocks, root, states[k - 1])
        sensor()  # the plant's own force computation is not part of the controller's time
        begin = time.perf_counter()
        controller.drive(blocks, root)
        elapsed.append(time.perf_counter() - begin)
    return np.array(elapsed)


def _known_from(station: Station, root: Context) -> float:
    """Return the first path parameter that a streamed path still stores, -inf of another path."""
    if not isinstance(station.task, ScenarioStream):
        return -np.inf
    return float(station.blocks.output(root, "controller.waypoint_intake.path")[0]) + 1.0


def _sensor(station: Station, root: Context) -> Callable[[], object]:
    """Return a function that evaluates the joint reaction forces, if they are measured."""
    name = "joint_reaction"
    if not station.diagram.HasSubsystemNamed(name):
        return lambda: None
    joint = station.diagram.GetSubsystemByName(name)
    reaction, context = joint.get_output_port(), joint.GetMyContextFromRoot(root)
    return lambda: reaction.Eval(context)


def _guidance(station: Station, root: Context) -> Callable[[np.ndarray], None]:
    """Return a function that sets the state of guidance, if there is any, to a position."""
    task = station.task
    if not isinstance(task, SpaceTask):
        return lambda y_t: None
    rest = task.command_dynamics.start
    return lambda y_t: station.blocks.set_state(
        root, "controller.fixture_guidance.command_dynamics", np.array(rest(y_t)).ravel()
    )
