"""Measured joint state: encoders, and torque sensors in elastic joints."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import SensorFailureParameters
from pfsc_drake.checks import require
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import SensorFailure
from pfsc_drake.physics.joint_sensors import (
    EncoderOptions,
    JointEncoders,
    JointTorqueSensor,
)
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise

# sides that must be measured, by the source of the controller's state
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
    """Add encoders, and return the measured ``[q_J, v_J, q_M, v_M]``.

    Args:
        builder: Builder of the diagram.
        joint_state: Actual joint state.
        robot: The robot.
        encoders: The encoders.
        failure: Failure of one of them, if there is one.
        period: Sampling time of the controller [s].
        encoder_period: Sampling time of the encoders, which servos may read more often [s].

    Raises:
        InputError: If the encoders do not suit the robot, or a sensor fails that does not exist.
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


def add_torque_sensor(
    builder: DiagramBuilder,
    robot: RobotModel,
    encoders: EncoderOptions,
    period: float,
    true_state: OutputPort,
) -> OutputPort:
    """Add torque sensors in elastic joints, and return the measured torques, shape (N,) [Nm or N].

    Args:
        builder: Builder of the diagram.
        robot: The simulated robot.
        encoders: Encoders and torque sensors.
        period: Sampling time [s].
        true_state: Actual ``[q_J, v_J, q_M, v_M]``.
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


def check_sides(
    nominal: RobotModel, controller: ControllerParameters, encoders: EncoderOptions
) -> None:
    """Refuse encoders that do not measure the sides that a controller needs.

    Args:
        nominal: Nominal model of the robot.
        controller: The controller.
        encoders: The encoders.

    Raises:
        InputError: If a side is missing.
    """
    source, sides = controller.state, encoders.sides
    if nominal.is_rigid or (source == "measured" and not controller.law_record.knows_links):
        return
    require(sides in _NEEDED[source], "encoders.sides", sides, _needed(source))


def _needed(source: str) -> str:
    return f"{' or '.join(_NEEDED[source])} where controller.state is {source}"
