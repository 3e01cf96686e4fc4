"""Running a path following station and collecting what it logged."""

import time
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context

from diagrams.path_following import PathFollowingStation
from diagrams.replay import RecordedMotion
from diagrams.scenario import SimulationParameters
from experiments.progress import ProgressListener
from experiments.run_log import RunLog
from pfsc_drake.control.path_law import Fault

# progress and faults are looked at this often [s]; between them nothing interrupts the loop
_CHUNK = 0.05


@dataclass
class SimulationResult:
    """What a simulation left.

    Attributes:
        root: Context of the diagram at the end.
        real_time_factor: Simulated over wall clock time.
        fault: Why it was stopped early, or None.
    """

    root: Context
    real_time_factor: float
    fault: str | None


def simulate(
    station: PathFollowingStation,
    parameters: SimulationParameters,
    duration: float,
    progress: ProgressListener,
) -> SimulationResult:
    """Simulate until the end or until the controller is in its safe state.

    Args:
        station: What to simulate.
        parameters: How.
        duration: Simulated time [s].
        progress: Told how far the run is.
    """
    simulator = Simulator(station.diagram)
    ApplySimulatorConfig(_configuration(parameters), simulator)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    controller = station.controller
    law_context = controller.GetMyContextFromRoot(root)
    wall, simulated, fault = 0.0, 0.0, None
    while simulated < duration and fault is None:
        simulated = min(simulated + _CHUNK, duration)
        begin = time.perf_counter()
        try:
            simulator.AdvanceTo(simulated)
        except RuntimeError as error:
            fault = f"simulation failed: {' '.join(str(error).split())}"
        wall += time.perf_counter() - begin
        progress(root.get_time(), "simulating")
        cause = controller.fault(law_context)
        if cause is not Fault.NONE:
            fault = cause.explanation
    return SimulationResult(root, root.get_time() / max(wall, 1e-9), fault)


def _configuration(parameters: SimulationParameters) -> SimulatorConfig:
    error_control = parameters.accuracy > 0.0
    return SimulatorConfig(
        integration_scheme=parameters.integrator,
        max_step_size=parameters.max_step,
        use_error_control=error_control,
        accuracy=parameters.accuracy if error_control else 1e-6,
    )


def collect_log(station: PathFollowingStation, root: Context) -> RunLog:
    """Return the signals of a run, named and with units as scripts expect them.

    Args:
        station: The station that was simulated.
        root: Its context at the end.
    """
    times, raw = station.log.read(root)
    log = RunLog(times)
    _add_joints(log, station, raw["joint_state"], raw["law"])
    pose, point = raw["tool_pose"], raw["path_point"]
    log.add("y_t", pose[:, :3], "m", ["x", "y", "z"])
    log.add("R_e", pose[:, 3:], "1", [f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)])
    layout = station.law.linearization.layout
    log.add("theta", point[:, layout.theta], "1")
    log.add("alpha", point[:, layout.alpha], "1")
    _add_manifold(log, station, raw["law"], raw["reference"])
    return log


def collect_motion(station: PathFollowingStation, root: Context, period: float) -> RecordedMotion:
    """Return the motion of a run at the frames of a recording, as far as it is finite.

    Args:
        station: The station that was simulated.
        root: Its context at the end.
        period: Time between frames [s].
    """
    times, raw = station.log.read(root)
    usable = np.flatnonzero(np.isfinite(raw["path_point"]).all(axis=1))
    stride = max(1, round(period / station.controller.period))
    frames = usable[::stride]
    state = raw["joint_state"][frames]
    positions = np.array([station.coordinates.plant_state(x) for x in state])
    positions = positions[:, : station.plant.num_positions()]
    return RecordedMotion(
        times[frames], positions, raw["tool_pose"][frames], raw["path_point"][frames]
    )


def _add_joints(
    log: RunLog, station: PathFollowingStation, state: np.ndarray, law: np.ndarray
) -> None:
    chain, n = station.chain, station.chain.dimension
    q_J, v_J, q_M, v_M = np.hsplit(state, 4)
    angle, rate, effort = _joint_units(station)
    axes = [str(i + 1) for i in range(n)]
    for name, values, unit in (
        ("q_J", q_J, angle),
        ("v_J", v_J, rate),
        ("q_M", q_M, angle),
        ("v_M", v_M, rate),
    ):
        log.add(name, values, unit, [f"{name}_{axis}" for axis in axes])
    drive = law[:, station.law.layout.drive]
    if station.law.linearization.relative_degree > 1:
        labels = [f"tau_d_{axis}" for axis in axes]
        log.add("tau_d", drive, effort, labels, station.law.limits)
    if chain.is_elastic:
        tau_J = chain.K_s * (q_M - q_J) + chain.K_d * (v_M - v_J)
        log.add("tau_J", tau_J, effort, [f"tau_J_{axis}" for axis in axes])


def _joint_units(station: PathFollowingStation) -> tuple[str, str, str]:
    if all(link.is_revolute for link in station.chain.links):
        return "rad", "rad/s", "Nm"
    if any(link.is_revolute for link in station.chain.links):
        return "rad or m", "rad/s or m/s", "Nm or N"
    return "m", "m/s", "N"


def _add_manifold(
    log: RunLog, station: PathFollowingStation, law: np.ndarray, reference: np.ndarray
) -> None:
    layout, linearization = station.law.layout, station.law.linearization
    m = linearization.num_outputs
    Y = law[:, layout.manifold_state].reshape(len(law), -1, m)
    Y_p = reference.reshape(len(reference), -1, m)
    parts = {"eta": slice(0, 1), "xi": slice(1, 3), "phi": slice(3, m)}
    units = {"eta": "m", "xi": "m", "phi": "rad"}
    labels = {"eta": ["eta"], "xi": ["xi_1", "xi_2"], "phi": ["phi_z", "phi_y", "phi_x"]}
    for name, part in parts.items():
        if part.start >= m:
            continue
        log.add(name, Y[:, 0, part], units[name], labels[name])
        log.add(f"{name}_p", Y_p[:, 0, part], units[name], [f"{x}_p" for x in labels[name]])
        if linearization.relative_degree > 1:
            rates = [f"{x}_dot" for x in labels[name]]
            log.add(f"{name}_dot", Y[:, 1, part], f"{units[name]}/s", rates)
    log.add("virtual_input", law[:, layout.virtual_input], f"SI/s^{linearization.relative_degree}")
    status = law[:, layout.status]
    log.add("fault", status[:, 0].astype(int), "1", [fault.name.lower() for fault in Fault])
    log.add("rcond", status[:, 1], "1")
    log.add("saturated_drives", status[:, 2].astype(int), "1")
