"""What the controller measures of the joints."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import Scenario
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import SensorFailure
from pfsc_drake.physics.joint_encoders import EncoderOptions, JointEncoders
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem


def add_joint_state(
    builder: DiagramBuilder,
    joint_state: OutputPort,
    robot: RobotModel,
    scenario: Scenario,
) -> OutputPort:
    """Add what encoders make of the joint state, and return ``[q_J, v_J, q_M, v_M]`` as measured.

    Args:
        builder: Builder of the diagram.
        joint_state: The true one.
        robot: The robot.
        scenario: The scenario.

    Raises:
        InputError: If the encoders do not suit the robot, or a sensor is to fail that does
            not exist.
    """
    measured = _add_imperfection(builder, joint_state, robot, scenario)
    failure = scenario.simulation.sensor_failure
    if failure.time < 0.0:
        return measured
    size = 4 * robot.dimension
    if not 0 <= failure.component < size:
        raise InputError(
            f"simulation.sensor_failure.component: {failure.component}; allowed: 0 to {size - 1}"
        )
    indices, period = [failure.component], scenario.controller.sampling_time
    if failure.whole_joint:
        indices = list(range(failure.component % robot.dimension, size, robot.dimension))
    failing = SensorFailure(size, indices, failure.time, period, failure.kind, failure.size)
    broken = builder.AddNamedSystem(
        "sensor_failure",
        BlockSystem(failing, period),
    )
    builder.Connect(measured, broken.GetInputPort("measured"))
    return broken.GetOutputPort("delivered")


def states_to_log(
    scenario: Scenario, joint_state: OutputPort, measured: OutputPort
) -> dict[str, OutputPort]:
    """Return ``joint_state`` for the log, and ``joint_state_measured`` where it is not the truth.

    That is with imperfect encoders, and where a sensor is to fail.

    Args:
        scenario: The scenario.
        joint_state: The true one.
        measured: What the law gets, see :func:`add_joint_state`.
    """
    if scenario.encoders == EncoderOptions() and scenario.simulation.sensor_failure.time < 0.0:
        return {"joint_state": measured}
    return {"joint_state": joint_state, "joint_state_measured": measured}


def _add_imperfection(
    builder: DiagramBuilder,
    joint_state: OutputPort,
    robot: RobotModel,
    scenario: Scenario,
) -> OutputPort:
    """Add increments and difference quotients, if there are any."""
    options = scenario.encoders
    if options == EncoderOptions():
        return joint_state
    period = scenario.controller.sampling_time
    if scenario.controller.law == "velocity_servo":
        period = scenario.servo.period or period
    encoders = JointEncoders(robot, options, period)
    real = builder.AddNamedSystem("encoder_increments", BlockSystem(encoders, period))
    builder.Connect(joint_state, real.GetInputPort("joint_state"))
    return real.GetOutputPort("joint_state")
