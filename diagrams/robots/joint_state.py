"""What a controller knows of joints: by encoders, and the links' side of elastic ones."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.part import RobotPart
from diagrams.robots.remote_arm import RemoteArm
from diagrams.scenario import SensorFailureParameters
from diagrams.scenario.checks import require
from pfsc_drake.control.estimation.link_errors import MotorEncoders
from pfsc_drake.errors import InputError
from pfsc_drake.following.law import Coefficients
from pfsc_drake.following.link_state import FoundLinks, add_links
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.physics.force_torque_sensor import SensorFailure
from pfsc_drake.physics.joint_sensors import (
    EncoderOptions,
    JointEncoders,
    JointTorqueSensor,
    encoder_resolution,
)
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise

# which sides must be measured where the controller has its state from
_NEEDED = {
    "measured": ("both",),
    "from_torque": ("motor_and_torque",),
    "observed": ("motor", "motor_and_torque"),
}


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
    if robot.is_rigid or (source == "measured" and not controller.law_record.knows_links):
        return FoundLinks(measured)
    remote = isinstance(part, RemoteArm)
    if not remote:  # else the robot knows what it measures
        require(sides in _NEEDED[source], "encoders.sides", sides, _wanted(source))
    if source == "measured":
        return FoundLinks(measured)
    torque, resolution = None, encoder_resolution(robot.numeric, encoders)[1]
    if source == "from_torque":
        torque = _measured_torque(builder, part, encoders, controller.sampling_time, true_state)
    motors = MotorEncoders(resolution, encoders.difference_quotient, encoders.filter_time)
    links = add_links(builder, robot, controller, measured, start, friction, torque, motors)
    if remote:  # that is all that is known of the robot
        del links.signals["found_joint_state"]
    return links


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
