"""Path following station: robot, projector, law, hold and log in one diagram."""

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import (
    LogVectorOutput,
    MatrixGain,
    Multiplexer,
    VectorLogSink,
    ZeroOrderHold,
)

from diagrams.parts import make_law, make_path
from diagrams.robot import add_robot, tool_frame
from diagrams.scenario import PathFollowingScenario
from diagrams.start import start_state
from pfsc_drake.control.path_law import PathLaw
from pfsc_drake.control.reference import rest_to_rest
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path
from pfsc_drake.robot.chain_from_plant import PlantCoordinates, chain_from_plant
from pfsc_drake.robot.resonance import joint_resonances
from pfsc_drake.robot.serial_chain import SerialChain
from pfsc_drake.systems.path_following_controller import PathFollowingController
from pfsc_drake.systems.path_projector import PathProjector
from pfsc_drake.systems.reference_generator import ReferenceGenerator
from pfsc_drake.systems.sensor_failure import SensorFailure
from pfsc_drake.systems.tool_kinematics import ToolKinematics

# rad per sampling interval, up to which the exact elastic law keeps its accuracy
_FASTEST_RESONANCE = 1.0


@dataclass(frozen=True)
class SignalLog:
    """Several signals in one log.

    Attributes:
        sink: The log.
        rows: Rows of each signal in the log's data.
    """

    sink: VectorLogSink
    rows: dict[str, slice]

    def read(self, root: Context) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the times [s], shape (samples,), and the signals, each (samples, size).

        Args:
            root: Context of the diagram.
        """
        log = self.sink.FindLog(root)
        data = log.data()
        return log.sample_times(), {name: data[rows].T for name, rows in self.rows.items()}


@dataclass
class PathFollowingStation:
    """A built station and what is needed to run it.

    Attributes:
        diagram: The diagram.
        plant: The robot in it.
        chain: The robot as a serial chain.
        coordinates: Where the chain's coordinates stand in the plant's state.
        path: The path.
        law: The path following law.
        projector: Projector system.
        controller: Controller system.
        log: Log of ``joint_state``, ``tool_pose``, ``path_point``, ``reference``, ``law``.
        reference_duration: Length of the reference motion [s].
        initial_state: State of the plant at the start.
        initial_theta: Path parameter at the start.
        warnings: What may not go as well as hoped, one sentence each.
    """

    diagram: Diagram
    plant: MultibodyPlant
    chain: SerialChain
    coordinates: PlantCoordinates
    path: Path
    law: PathLaw
    projector: PathProjector
    controller: PathFollowingController
    log: SignalLog
    reference_duration: float
    initial_state: np.ndarray
    initial_theta: float
    warnings: list[str]

    def set_start(self, root: Context) -> None:
        """Put the robot at the start of the scenario.

        Args:
            root: Context of the diagram.
        """
        self.plant.SetPositionsAndVelocities(
            self.plant.GetMyMutableContextFromRoot(root), self.initial_state
        )
        self.projector.set_parameter(
            self.projector.GetMyMutableContextFromRoot(root), self.initial_theta
        )


def build_path_following(scenario: PathFollowingScenario, folder: FilePath) -> PathFollowingStation:
    """Build the station of a path following scenario.

    Args:
        scenario: The scenario.
        folder: Where the scenario's relative file names start.

    Returns:
        The station; everything in the scenario that can be wrong has been checked.

    Raises:
        InputError: If the scenario cannot be built.
    """
    builder = DiagramBuilder()
    plant = add_robot(builder, scenario.robot, folder)
    chain, coordinates = chain_from_plant(plant, tool_frame(plant, scenario.robot))
    undriven = [n for n, a in zip(chain.names, coordinates.actuators, strict=True) if a < 0]
    if undriven:
        raise InputError(
            f"robot.model: {', '.join(undriven)} without actuator; every joint needs one"
        )
    period, law_name = scenario.controller.sampling_time, scenario.controller.law
    path = make_path(scenario.path, law_name, folder)
    law = make_law(scenario.controller, chain, path.orientation is not None)
    initial_state, initial_theta = start_state(scenario, path, chain, coordinates)
    linearization = law.linearization
    relative_degree = linearization.relative_degree
    reference = scenario.reference
    eta_p = rest_to_rest(
        reference.points,
        velocity=reference.velocity,
        acceleration=reference.acceleration,
        dwell=reference.dwell,
    )

    joint_state = _add_joint_state(builder, plant, chain, coordinates, scenario)
    kinematics = builder.AddNamedSystem("tool_kinematics", ToolKinematics(chain))
    projector = builder.AddNamedSystem(
        "path_projector", PathProjector(path, relative_degree, period)
    )
    controller = builder.AddNamedSystem(
        "path_following_controller", PathFollowingController(law, period)
    )
    generator = builder.AddNamedSystem(
        "reference_generator",
        ReferenceGenerator(eta_p, relative_degree, linearization.num_outputs),
    )
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(period, chain.dimension))
    drives = builder.AddNamedSystem("drives", MatrixGain(_drive_order(plant, coordinates)))

    tool_pose = kinematics.GetOutputPort("tool_pose")
    path_point = projector.GetOutputPort("path_point")
    builder.Connect(joint_state, kinematics.GetInputPort("joint_state"))
    builder.Connect(tool_pose, projector.GetInputPort("tool_pose"))
    builder.Connect(joint_state, controller.GetInputPort("joint_state"))
    builder.Connect(path_point, controller.GetInputPort("path_point"))
    builder.Connect(generator.GetOutputPort("reference"), controller.GetInputPort("reference"))
    builder.Connect(controller.GetOutputPort("drive"), hold.get_input_port())
    builder.Connect(hold.get_output_port(), drives.get_input_port())
    builder.Connect(drives.get_output_port(), plant.get_actuation_input_port())
    signals = {
        "joint_state": joint_state,
        "tool_pose": tool_pose,
        "path_point": path_point,
        "reference": generator.GetOutputPort("reference"),
        "law": controller.GetOutputPort("law"),
    }
    log = _add_log(builder, signals, period)
    diagram = builder.Build()
    diagram.set_name(scenario.name or "path_following")
    return PathFollowingStation(
        diagram,
        plant,
        chain,
        coordinates,
        path,
        law,
        projector,
        controller,
        log,
        eta_p.domain[1],
        initial_state,
        initial_theta,
        _warnings(law_name, chain, coordinates.link_rows @ initial_state, period),
    )


def _add_joint_state(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    chain: SerialChain,
    coordinates: PlantCoordinates,
    scenario: PathFollowingScenario,
) -> OutputPort:
    """Add the encoders: ``[q_J, v_J, q_M, v_M]`` of the plant's state."""
    rows = np.vstack([coordinates.link_rows, coordinates.motor_rows])
    encoders = builder.AddNamedSystem("joint_encoders", MatrixGain(rows))
    builder.Connect(plant.get_state_output_port(), encoders.get_input_port())
    failure = scenario.simulation.sensor_failure
    if failure.time < 0.0:
        return encoders.get_output_port()
    size = 4 * chain.dimension
    if not 0 <= failure.component < size:
        raise InputError(
            f"simulation.sensor_failure.component: {failure.component}; allowed: 0 to {size - 1}"
        )
    broken = builder.AddNamedSystem(
        "sensor_failure", SensorFailure(size, failure.component, failure.time)
    )
    builder.Connect(encoders.get_output_port(), broken.GetInputPort("measured"))
    return broken.GetOutputPort("delivered")


def _add_log(builder: DiagramBuilder, signals: dict[str, OutputPort], period: float) -> SignalLog:
    sizes = [port.size() for port in signals.values()]
    multiplexer = builder.AddNamedSystem("log_signals", Multiplexer(sizes))
    for i, port in enumerate(signals.values()):
        builder.Connect(port, multiplexer.get_input_port(i))
    sink = LogVectorOutput(multiplexer.get_output_port(), builder, period)
    sink.set_name("log")
    ends = np.cumsum(sizes).tolist()
    rows = [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]
    return SignalLog(sink, dict(zip(signals, rows, strict=True)))


def _warnings(
    law_name: str, chain: SerialChain, link_state: np.ndarray, period: float
) -> list[str]:
    """Return what a sampled controller will not do well on this robot."""
    if law_name != "elastic":
        return []
    resonance = joint_resonances(chain, link_state[: chain.dimension])[-1]
    if resonance * period <= _FASTEST_RESONANCE:
        return []
    return [
        f"the joints resonate at up to {resonance / (2.0 * np.pi):.0f} Hz, "
        f"{resonance * period:.2f} rad per sampling interval; above {_FASTEST_RESONANCE:g} rad the "
        "law 'elastic' loses accuracy and then oscillates: sample faster or take the law "
        "'singular_perturbation'"
    ]


def _drive_order(plant: MultibodyPlant, coordinates: PlantCoordinates) -> np.ndarray:
    """Return the matrix from the chain's drives to the plant's actuation."""
    order = np.zeros((plant.num_actuators(), len(coordinates.actuators)))
    order[coordinates.actuators, np.arange(len(coordinates.actuators))] = 1.0
    return order
