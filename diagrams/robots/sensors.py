"""What a controller measures: joints by encoders, forces at the flange."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.part import RobotPart, SensorMount
from diagrams.scenario import Scenario
from diagrams.scenario.checks import require
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.control.compliance.tool_compensation import ToolCompensation
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import ForceTorqueSensor, SensorFailure
from pfsc_drake.physics.joint_encoders import EncoderOptions, JointEncoders
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise
from pfsc_drake.systems.plants.reactions import JointReaction


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


# of a sampling interval
_ROUNDING = 1e-6


def add_sensor(
    builder: DiagramBuilder,
    part: RobotPart,
    scenario: Scenario,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add a force/torque sensor with taring and compensation of the tool behind it.

    Args:
        builder: Builder of the diagram.
        part: The robot.
        scenario: The scenario.
        ports: ``joint_state`` as measured, ``true_joint_state``, and ``wrench_ext`` if anything
            acts on the tool.

    Returns:
        ``wrench_measured`` (at the tool point, world axes), ``tared``, ``sensor_fault``,
        and ``wrench_sensor``, what the sensor itself tells.

    Raises:
        InputError: If the sensor does not suit the robot or the sampling time.
    """
    parameters, period = scenario.sensor, scenario.controller.sampling_time
    mount = part.sensor_mount(builder, parameters.joint, ports)
    sensor = _add_transducer(builder, mount, scenario)
    block = ToolCompensation(
        part.belief.robot,
        mount.believed_load,
        parameters.measurement_range,
        parameters.compensation(),
        period,
    )
    compensation = builder.AddNamedSystem("tool_compensation", BlockSystem(block, period))
    reading = _fail(builder, sensor.GetOutputPort("measured_wrench"), scenario)
    reading = _delay(builder, reading, scenario)
    builder.Connect(reading, compensation.GetInputPort("measured_wrench"))
    builder.Connect(ports["joint_state"], compensation.GetInputPort("joint_state"))
    signals = {"wrench_measured": "wrench", "tared": "tared", "sensor_fault": "fault"}
    found = {name: compensation.GetOutputPort(port) for name, port in signals.items()}
    return found | {"wrench_sensor": reading}


def _add_transducer(builder: DiagramBuilder, mount: SensorMount, scenario: Scenario) -> BlockSystem:
    """Add what the sensor itself makes of the load on it."""
    parameters, period = scenario.sensor.transducer(), scenario.controller.sampling_time
    block = ForceTorqueSensor(parameters, period)
    sensor = builder.AddNamedSystem("force_torque_sensor", BlockSystem(block, period))
    reaction = mount.reaction
    if mount.index is not None:
        joint = builder.AddNamedSystem("joint_reaction", JointReaction(mount.index))
        builder.Connect(reaction, joint.get_input_port())
        reaction = joint.get_output_port()
    builder.Connect(reaction, sensor.GetInputPort("reaction"))
    if parameters.noise.any():
        noise = builder.AddNamedSystem(
            "sensor_noise", SensorNoise(parameters.noise, parameters.seed, period)
        )
        builder.Connect(noise.get_output_port(), sensor.GetInputPort("noise"))
    return sensor


def _fail(builder: DiagramBuilder, reading: OutputPort, scenario: Scenario) -> OutputPort:
    """Return what is left of the sensor's reading if it is to fail on the way."""
    failure, period = scenario.simulation.force_sensor_failure, scenario.controller.sampling_time
    if failure.time < 0.0:
        return reading
    size = reading.size()
    if not 0 <= failure.component < size:
        raise InputError(
            f"simulation.force_sensor_failure.component: {failure.component}; allowed: 0 to "
            f"{size - 1}"
        )
    indices = list(range(size)) if failure.whole_joint else [failure.component]
    failing = SensorFailure(size, indices, failure.time, period, failure.kind, failure.size)
    broken = builder.AddNamedSystem(
        "force_sensor_failure",
        BlockSystem(failing, period),
    )
    builder.Connect(reading, broken.GetInputPort("measured"))
    return broken.GetOutputPort("delivered")


def _delay(builder: DiagramBuilder, reading: OutputPort, scenario: Scenario) -> OutputPort:
    """Return a sensor's reading when the controller has it."""
    delay, period = scenario.sensor.delay, scenario.controller.sampling_time
    ticks = round(delay / period)
    whole = abs(ticks * period - delay) < _ROUNDING * period
    require(whole, "sensor.delay", delay, f"a multiple of the sampling time {period:g} s")
    if ticks == 0:
        return reading
    late = builder.AddNamedSystem(
        "force_sensor_delay", BlockSystem(Hold(reading.size(), ticks), period)
    )
    builder.Connect(reading, late.GetInputPort("value"))
    return late.GetOutputPort("held")


def sensor_warnings(scenario: Scenario) -> list[str]:
    """Return what may make the taring of a scenario's sensor too late."""
    if not scenario.compliance.needs_sensor:
        return []
    warnings, sensor, dwell = [], scenario.sensor, scenario.reference.dwell
    if dwell < sensor.taring_time:
        warnings.append(
            f"the reference sets off after reference.dwell = {dwell:g} s, before the sensor can "
            f"be tared (sensor.taring_time = {sensor.taring_time:g} s); what yields waits for "
            "that, and then catches up"
        )
    return warnings
