"""How fast scenarios run: block by block, as one function, and their plants alone.

The last is what the same plant reaches when the torques of the run are replayed: a controller that
takes no time. It is told twice: of the plant alone, and of the plant in its world, with the
friction of its joints, the forces on it and what its force sensor feels at each tick, where it
moves as in the run to the last bit. All in
one process, in turns and in processor time, as the machine's pace changes from hour to hour; a
fixed piece of work tells it.

    python -m tests.benchmarks.paces [scenario ..]
"""

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from diagrams.builder import build_station
from diagrams.robots.arm import add_arm
from diagrams.robots.plant_friction import add_friction
from diagrams.scenario import Scenario
from diagrams.station import Station
from diagrams.station_options import StationOptions
from experiments.scenario_file import SCENARIO_DIRECTORY
from experiments.simulation import configure
from pfsc_drake.systems.plants.applied_wrenches import LinkPushes
from pfsc_drake.systems.plants.reactions import JointReaction
from tests.scenarios import shipped_scenario

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
    """Return simulated over processor time of a simulation, the second tenth of it and after."""
    simulator = start()
    simulator.AdvanceTo(0.1 * DURATION)
    begin = time.process_time()
    simulator.AdvanceTo(DURATION)
    return 0.9 * DURATION / (time.process_time() - begin)


def of_station(settings: Scenario, station: Station) -> Simulator:
    """Return a simulator of a station at its start."""
    simulator = Simulator(station.diagram)
    configure(simulator, _SCHEME, settings.controller.sampling_time)
    station.set_start(simulator.get_mutable_context())
    return simulator


def replayed(settings: Scenario, station: Station) -> dict[str, Callable[[], Simulator]]:
    """Run a station, and return what simulates its plant under the same torques, by column.

    The plant ``alone``, and in its ``world``: with the joints' friction and the forces of the run.

    Raises:
        RuntimeError: If in its world it does not move as in the run.
    """
    simulator = of_station(settings, station)
    simulator.AdvanceTo(DURATION)
    times, log = station.log.read(simulator.get_context())
    torque = log.get("drive_torque", log["law"][:, station.law.layout.drive])
    starts = {
        "alone": _replay(settings, station, times, torque, None),
        "world": _replay(settings, station, times, torque, log),
    }
    middle = len(times) // 2
    again = starts["world"]()
    again.AdvanceTo(times[middle])
    x = (
        again.get_context()
        .get_continuous_state_vector()
        .CopyToVector()[: len(station.initial_state)]
    )
    if not np.array_equal(station.part.coordinates.rows @ x, log["joint_state"][middle]):
        raise RuntimeError("the replay does not move as the run did")
    return starts


def _replay(
    settings: Scenario,
    station: Station,
    times: np.ndarray,
    torque: np.ndarray,
    world: dict[str, np.ndarray] | None,
) -> Callable[[], Simulator]:
    builder, period = DiagramBuilder(), settings.controller.sampling_time
    part = add_arm(builder, StationOptions(settings, SCENARIO_DIRECTORY).nominal_model_source)

    def told(values: np.ndarray, ahead: float = 0.0) -> OutputPort:
        begins = times[: len(values)] - ahead
        values = PiecewisePolynomial.ZeroOrderHold(begins, values.T)
        return builder.AddSystem(TrajectorySource(values)).get_output_port()

    def sampled(values: np.ndarray) -> OutputPort:
        hold = builder.AddSystem(ZeroOrderHold(period, values.shape[1]))
        builder.Connect(told(values, period / 2.0), hold.get_input_port())
        return hold.get_output_port()

    if world is None:
        part.connect_drives(builder, told(torque))
    else:
        part.connect_drives(builder, sampled(torque))
        joint_state = part.joint_state(builder)
        add_friction(
            builder, part, joint_state, StationOptions(settings, SCENARIO_DIRECTORY).friction
        )
        # the log shows at a tick what has acted until then
        forces = {k: sampled(world[k][1:]) for k in ("wrench_ext", "push_wrench") if k in world}
        if "push_wrench" in forces:
            (known,) = (s for s in station.diagram.GetSystems() if isinstance(s, LinkPushes))
            pushes = builder.AddSystem(LinkPushes(part.robot, known.places))
            builder.Connect(forces["push_wrench"], pushes.GetInputPort("wrenches"))
            builder.Connect(joint_state, pushes.GetInputPort("joint_state"))
            part.connect_pushes(builder, pushes, forces.get("wrench_ext"), joint_state)
        elif forces:
            part.connect_wrench(builder, forces["wrench_ext"], joint_state)
        if settings.needs_sensor:
            states = {"joint_state": joint_state, "true_joint_state": joint_state}
            mount = part.sensor_mount(builder, settings.sensor.joint, states | forces)
            reaction = mount.reaction
            if mount.index is not None:
                joint = builder.AddSystem(JointReaction(mount.index))
                builder.Connect(reaction, joint.get_input_port())
                reaction = joint.get_output_port()
            felt = builder.AddSystem(ZeroOrderHold(period, reaction.size()))
            builder.Connect(reaction, felt.get_input_port())
    diagram: Diagram = builder.Build()

    def start() -> Simulator:
        alone = Simulator(diagram)
        configure(alone, _SCHEME, period)
        part.set_state(part.plant.GetMyMutableContextFromRoot(alone.get_mutable_context()), x)
        return alone

    x = station.initial_state
    return start


def machine() -> float:
    """Return the time of a fixed piece of work in Python and numpy [ms]."""
    begin = time.process_time()
    matrix, total = np.eye(6) + 0.1, 0.0
    for k in range(20_000):
        total += float(matrix[k % 6] @ matrix[0])
    return 1e3 * (time.process_time() - begin)


def compare(name: str) -> dict[str, float]:
    """Return the medians of a scenario's paces."""
    settings = shipped_scenario(name)
    stations: dict[str, Station] = {}
    for key, fused in (("systems", False), ("fused", True)):
        settings.simulation.fused = fused
        stations[key] = build_station(settings, SCENARIO_DIRECTORY, like=stations.get("systems"))
    starts = {
        key: lambda station=station: of_station(settings, station)
        for key, station in stations.items()
    }
    starts |= replayed(settings, stations["fused"])
    found: dict[str, list[float]] = {}
    for _ in range(ROUNDS):
        for key, start in starts.items():
            found.setdefault(key, []).append(pace(start))
    return {key: statistics.median(values) for key, values in found.items()}


def main() -> None:
    """Print the table."""
    print(f"machine: {machine():.1f} ms for a fixed piece of work")
    columns = ("systems", "fused", "world", "alone")
    print(f"{'times real time':24s}" + "".join(f"{key:>9s}" for key in columns), end="")
    print("   share of world, of alone (goal)")
    for name in sys.argv[1:] or GOALS:
        medians = compare(name)
        shares = [medians["fused"] / medians[key] for key in ("world", "alone")]
        goal = f" ({GOALS[name]:.2f})" if name in GOALS else ""
        row = "".join(f"{medians[key]:9.2f}" for key in columns)
        print(f"{name:24s}{row}   {shares[0]:.2f}  {shares[1]:.2f}{goal}", flush=True)


if __name__ == "__main__":
    main()
