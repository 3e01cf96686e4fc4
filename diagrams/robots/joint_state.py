"""What a controller knows of joints: by encoders, and the links' side of elastic ones."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from diagrams.robots.part import RobotPart
from diagrams.robots.remote_arm import RemoteArm
from diagrams.scenario import SensorFailureParameters
from diagrams.scenario.checks import require
from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Constant, Sum
from pfsc_drake.control.estimation.link_deviation import LinkDeviation
from pfsc_drake.control.estimation.link_errors import (
    MotorEncoders,
    errors_of_measured_torques,
    errors_of_observed_torques,
)
from pfsc_drake.control.estimation.momentum import MomentumObserver, motor_momentum
from pfsc_drake.control.estimation.robot_state import LinkState
from pfsc_drake.errors import InputError
from pfsc_drake.following.law import Coefficients
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.physics.force_torque_sensor import SensorFailure
from pfsc_drake.physics.joint_sensors import (
    EncoderOptions,
    JointEncoders,
    JointTorqueSensor,
    encoder_resolution,
)
from pfsc_drake.robot.robot_model import RobotModel, gravity_function
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise

# laws that act on the motors of elastic joints alone
_OF_MOTORS = ("rigid", "velocity_servo")
# which sides must be measured where the controller has its state from
_NEEDED = {
    "measured": ("both",),
    "from_torque": ("motor_and_torque",),
    "observed": ("motor", "motor_and_torque"),
}


# name of the block that tells how sure links are
DEVIATION = "link_deviation"


@dataclass(frozen=True)
class FoundLinks:
    """What a controller has instead of the links' side of elastic joints.

    Attributes:
        joint_state: ``[q_J, v_J, q_M, v_M]`` as the controller takes it.
        drive_torque: Port that wants to know what the drives are told, if there is one.
        signals: For the log: ``found_joint_state``, unless that is all that is known of the
            robot, ``joint_torque`` where that is measured, and standard deviations, see
            :class:`LinkDeviation`; none where nothing is found.
    """

    joint_state: OutputPort
    drive_torque: InputPort | None = None
    signals: dict[str, OutputPort] = field(default_factory=dict)


def add_joint_state(
    builder: DiagramBuilder,
    joint_state: OutputPort,
    robot: RobotModel,
    encoders: EncoderOptions,
    failure: SensorFailureParameters,
    period: float,
    encoder_period: float,
) -> OutputPort:
    """Add what encoders make of the joint state, and return ``[q_J, v_J, q_M, v_M]`` as measured.

    Args:
        builder: Builder of the diagram.
        joint_state: The true one.
        robot: The robot.
        encoders: The encoders.
        failure: How one of them fails, if any does.
        period: Sampling time of the controller [s].
        encoder_period: That of the encoders, which servos may read more often [s].

    Raises:
        InputError: If the encoders do not suit the robot, or a sensor is to fail that does
            not exist.
    """
    measured = joint_state
    if encoders != EncoderOptions():
        block = JointEncoders(robot, encoders, encoder_period)
        real = builder.AddNamedSystem("encoder_increments", BlockSystem(block, encoder_period))
        builder.Connect(joint_state, real.GetInputPort("joint_state"))
        measured = real.GetOutputPort("joint_state")
    if failure.time < 0.0:
        return measured
    size = 4 * robot.dimension
    if not 0 <= failure.component < size:
        raise InputError(
            f"simulation.sensor_failure.component: {failure.component}; allowed: 0 to {size - 1}"
        )
    indices = [failure.component]
    if failure.whole_joint:
        indices = list(range(failure.component % robot.dimension, size, robot.dimension))
    failing = SensorFailure(size, indices, failure.time, period, failure.kind, failure.size)
    broken = builder.AddNamedSystem(
        "sensor_failure",
        BlockSystem(failing, period),
    )
    builder.Connect(measured, broken.GetInputPort("measured"))
    return broken.GetOutputPort("delivered")


def states_to_log(joint_state: OutputPort, measured: OutputPort) -> dict[str, OutputPort]:
    """Return ``joint_state`` for the log, and ``joint_state_measured`` where it is not the truth.

    That is with imperfect encoders, and where a sensor is to fail.

    Args:
        joint_state: The true one.
        measured: What the law gets, see :func:`add_joint_state`.
    """
    if measured is joint_state:
        return {"joint_state": measured}
    return {"joint_state": joint_state, "joint_state_measured": measured}


def add_torque_sensor(
    builder: DiagramBuilder,
    robot: RobotModel,
    encoders: EncoderOptions,
    period: float,
    true_state: OutputPort,
) -> OutputPort:
    """Add torque sensors in elastic joints, and return what they measure, shape (N,) [Nm or N].

    Args:
        builder: Builder of the diagram.
        robot: The robot as it is.
        encoders: What the sensors do.
        period: Sampling time [s].
        true_state: The true ``[q_J, v_J, q_M, v_M]``.
    """
    block = JointTorqueSensor(robot, encoders.torque)
    sensor = builder.AddNamedSystem("joint_torque_sensor", BlockSystem(block, period))
    builder.Connect(true_state, sensor.GetInputPort("joint_state"))
    if encoders.torque.noise > 0.0:
        effort = robot.gather("effort_limit")
        deviation = encoders.torque.noise * np.where(robot.elastic_joints, effort, 0.0)
        noise = SensorNoise(deviation, encoders.torque.seed, period)
        builder.AddNamedSystem("joint_torque_noise", noise)
        builder.Connect(noise.get_output_port(), sensor.GetInputPort("noise"))
    return sensor.GetOutputPort("joint_torque")


def add_link_state(
    builder: DiagramBuilder,
    part: RobotPart,
    controller: ControllerParameters,
    encoders: EncoderOptions,
    measured: OutputPort,
    true_state: OutputPort,
    start: np.ndarray,
    friction: Coefficients | None,
) -> FoundLinks:
    """Add what finds the links' side of elastic joints where it is not measured.

    Args:
        builder: Builder of the diagram.
        part: The robot.
        controller: Says where it has that from.
        encoders: What is measured.
        measured: ``[q_J, v_J, q_M, v_M]`` as encoders measure it.
        true_state: The same as it is.
        start: Joint coordinates at the start, at rest, shape (N,).
        friction: Coefficients f_c and f_v that are believed, each (N,), if there are any.

    Raises:
        InputError: If what the controller wants is not measured.
    """
    robot, source, sides = part.belief.robot, controller.state, encoders.sides
    if robot.is_rigid or (source == "measured" and controller.law in _OF_MOTORS):
        return FoundLinks(measured)
    if not isinstance(part, RemoteArm):  # else the robot knows what it measures
        require(sides in _NEEDED[source], "encoders.sides", sides, _wanted(source))
    if source == "measured":
        return FoundLinks(measured)
    period, wants = controller.sampling_time, None
    if source == "from_torque":
        torque = _measured_torque(builder, part, encoders, period, true_state)
    else:
        torque, wants = _add_torque_observer(builder, robot, controller, measured, start, friction)
    found = LinkState(robot, controller.state_bandwidth, period)
    system = builder.AddNamedSystem("link_state", BlockSystem(found, period))
    builder.Connect(measured, system.GetInputPort("joint_state"))
    builder.Connect(torque, system.GetInputPort("joint_torque"))
    joint_state = system.GetOutputPort("joint_state")
    signals = _add_deviation(builder, robot, controller, encoders, joint_state, start, friction)
    if source == "from_torque":
        signals |= {"joint_torque": torque}
    if not isinstance(part, RemoteArm):
        signals |= {"found_joint_state": joint_state}
    return FoundLinks(joint_state, wants, signals)


def _add_deviation(
    builder: DiagramBuilder,
    robot: RobotModel,
    controller: ControllerParameters,
    encoders: EncoderOptions,
    joint_state: OutputPort,
    start: np.ndarray,
    friction: Coefficients | None,
) -> dict[str, OutputPort]:
    """Add what tells how far the links may be from where they were found; its outputs by name."""
    robot, period = robot.numeric, controller.sampling_time
    uncertainty, rate = controller.state_uncertainty, controller.state_bandwidth
    motors = MotorEncoders(
        encoder_resolution(robot, encoders)[1], encoders.difference_quotient, encoders.filter_time
    )
    if controller.state == "from_torque":
        errors = errors_of_measured_torques(robot, uncertainty, motors, start, rate, period)
    else:
        errors = errors_of_observed_torques(
            robot, uncertainty, motors, start, rate, period, friction
        )
    block = LinkDeviation(robot, errors)
    system = builder.AddNamedSystem(DEVIATION, BlockSystem(block, period))
    builder.Connect(joint_state, system.get_input_port())
    return {name: system.GetOutputPort(name) for name in block.outputs}


def _add_torque_observer(
    builder: DiagramBuilder,
    robot: RobotModel,
    controller: ControllerParameters,
    measured: OutputPort,
    start: np.ndarray,
    friction: Coefficients | None,
) -> tuple[OutputPort, InputPort]:
    """Add what observes springs from their motors; at the start they bear the weight."""
    period, known = controller.sampling_time, friction or (np.zeros(robot.dimension),) * 2

    def add(name: str, block: Block) -> BlockSystem:
        return builder.AddNamedSystem(name, BlockSystem(block, period))

    model = motor_momentum(robot, known)
    observer = add(
        "spring_torque_observer", MomentumObserver(model, controller.state_bandwidth, period)
    )
    weight = gravity_function(robot.numeric)(start).full().ravel()
    borne = add("weight_at_start", Constant(weight)).GetOutputPort("value")
    total = add("spring_torque", Sum(2, robot.dimension))
    builder.Connect(measured, observer.GetInputPort("joint_state"))
    builder.Connect(borne, observer.GetInputPort("known_torque"))
    builder.Connect(borne, total.GetInputPort("term_0"))
    builder.Connect(observer.GetOutputPort("estimate"), total.GetInputPort("term_1"))
    return total.GetOutputPort("sum"), observer.GetInputPort("drive_torque")


def _measured_torque(
    builder: DiagramBuilder,
    part: RobotPart,
    encoders: EncoderOptions,
    period: float,
    true_state: OutputPort,
) -> OutputPort:
    """Return what torque sensors in the joints tell, shape (N,)."""
    if isinstance(part, RemoteArm):
        return part.torque.get_output_port()
    return add_torque_sensor(builder, part.robot, encoders, period, true_state)


def _wanted(source: str) -> str:
    return f"{' or '.join(_NEEDED[source])} where controller.state is {source}"
