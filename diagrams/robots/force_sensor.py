"""Force/torque sensor at the flange, with its noise, failure and delay."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.part import RobotPart, SensorMount
from diagrams.scenario import SensorFailureParameters, SensorParameters
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.checks import require_whole_ticks
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import (
    ForceTorqueParameters,
    ForceTorqueSensor,
    SensorFailure,
)
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise
from pfsc_drake.systems.plants.reactions import JointReaction

_MOST_TICKS = 10_000  # of the delay


def add_force_sensor(
    builder: DiagramBuilder,
    part: RobotPart,
    parameters: SensorParameters,
    failure: SensorFailureParameters,
    period: float,
    ports: dict[str, OutputPort],
) -> OutputPort:
    """Add a force/torque sensor, and return its measured wrench, shape (6,) [N, Nm].

    Args:
        builder: Builder of the diagram.
        part: The robot.
        parameters: The sensor.
        failure: Its failure, if there is one.
        period: Sampling time [s].
        ports: ``true_joint_state``, and ``wrench_ext`` if forces act on the tool.

    Raises:
        InputError: If the sensor does not suit the robot or the sampling time.
    """
    mount = part.sensor_mount(builder, parameters.joint, ports)
    return _reading(builder, mount, parameters, failure, period)


def _reading(
    builder: DiagramBuilder,
    mount: SensorMount,
    parameters: SensorParameters,
    failure: SensorFailureParameters,
    period: float,
) -> OutputPort:
    """Return the reading of a sensor, with failure and delay."""
    if mount.reading is not None:
        return mount.reading
    sensor = _add_transducer(builder, mount, parameters, period)
    reading = _fail(builder, sensor.GetOutputPort("measured_wrench"), failure, period)
    return _delay(builder, reading, parameters.delay, period)


def _add_transducer(
    builder: DiagramBuilder,
    mount: SensorMount,
    parameters: ForceTorqueParameters,
    period: float,
) -> BlockSystem:
    """Add the sensor itself, from the load on it to its reading."""
    block = ForceTorqueSensor(parameters, period)
    sensor = builder.AddNamedSystem("force_torque_sensor", BlockSystem(block, period))
    reaction = mount.reaction
    assert reaction is not None
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


def _fail(
    builder: DiagramBuilder,
    reading: OutputPort,
    failure: SensorFailureParameters,
    period: float,
) -> OutputPort:
    """Return the sensor's reading, with its failure if there is one."""
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


def _delay(builder: DiagramBuilder, reading: OutputPort, delay: float, period: float) -> OutputPort:
    """Return a sensor's reading with its delay."""
    ticks = require_whole_ticks("sensor.delay", delay, period, _MOST_TICKS)
    if ticks == 0:
        return reading
    late = builder.AddNamedSystem(
        "force_sensor_delay", BlockSystem(Hold(reading.size(), ticks), period)
    )
    builder.Connect(reading, late.GetInputPort("value"))
    return late.GetOutputPort("held")


def taring_warnings(taring_time: float, dwell: float) -> list[str]:
    """Return a warning if the reference does not wait until the sensor is tared.

    Args:
        taring_time: Time that the tool must rest for taring [s].
        dwell: Time that the reference waits at first [s].
    """
    if dwell < taring_time:
        return [
            f"the reference sets off after reference.dwell = {dwell:g} s, before the sensor can "
            f"be tared (sensor.taring_time = {taring_time:g} s); compliant motion waits for "
            "that, and then catches up"
        ]
    return []
