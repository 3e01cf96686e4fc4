"""Hold, velocity servos and bus between the law's output and the plant's joints."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.nominal_model import nominal_robot
from diagrams.robots.part import RobotPart
from diagrams.scenario import (
    DriverParameters,
    ServoParameters,
)
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.checks import require, require_whole_fraction
from pfsc_drake.controller.law import safe_state, supervision
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.options.follower_options import FaultParameters
from pfsc_drake.physics.driver import DriveLowPass
from pfsc_drake.physics.joint_sensors import EncoderOptions
from pfsc_drake.physics.velocity_servo import BusDelay, VelocityServoLaw, joint_inertia, servo_gains
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.velocity_servo import ServoAccess, VelocityServo


@dataclass(frozen=True)
class ServoOptions:
    """Velocity servos of the joints, with their supervision.

    Attributes:
        servo: Their gains and the bus to them.
        controller: The controller that commands them.
        faults: Fault detection and stops.
        encoders: Encoders of the joints.
    """

    servo: ServoParameters
    controller: ControllerParameters
    faults: FaultParameters
    encoders: EncoderOptions


def add_drives(
    builder: DiagramBuilder,
    part: RobotPart,
    servos: ServoOptions | None,
    driver: DriverParameters,
    period: float,
    ports: dict[str, OutputPort],
    initial_state: np.ndarray,
) -> tuple[dict[str, OutputPort], ServoAccess | None]:
    """Connect the law to the plant's actuation.

    Args:
        builder: Builder of the diagram.
        part: The robot.
        servos: Servos of a law that commands velocities; None where it commands torques.
        driver: Delay and low pass of the torques.
        period: Sampling time of the controller [s].
        ports: ``drive`` of the law, torques or reference velocities, and ``joint_state``.
        initial_state: State of the plant at the start, for the design of the servos.

    Returns:
        Further signals for the log, with servos ``drive_torque``, within its limits [Nm or N],
        shape (N,), ``servo_fault`` and ``servo_stop_category``, each (1,); the servos, if there
        are any.

    Raises:
        InputError: If the servos or the driver do not suit the robot or the controller.
    """
    torque, chain, signals, access = ports["drive"], part.nominal_model.robot, {}, None
    ticks = driver.ticks(period)
    if servos is not None:
        plain = "none with the law 'velocity_servo', whose delay is servo.bus_delay"
        require(driver == DriverParameters(), "driver", driver, plain)
        q_J = (part.coordinates.link_rows @ initial_state)[: chain.dimension]
        servo = _add_servo(builder, chain, servos, ports, q_J)
        access, period = ServoAccess(servo), servo.period
        torque = servo.GetOutputPort("drive_torque")
        signals = {
            "drive_torque": torque,
            "servo_fault": servo.GetOutputPort("fault"),
            "servo_stop_category": servo.GetOutputPort("stop_category"),
        }
    if driver.low_pass > 0.0:
        filtering = DriveLowPass(chain.dimension, driver.low_pass, period)
        low_pass = builder.AddNamedSystem("drive_low_pass", BlockSystem(filtering, period))
        builder.Connect(torque, low_pass.GetInputPort("command"))
        torque = low_pass.GetOutputPort("passed")
    hold = builder.AddNamedSystem("hold", BlockSystem(Hold(chain.dimension, 1 + ticks), period))
    builder.Connect(torque, hold.GetInputPort("value"))
    part.connect_drives(builder, hold.GetOutputPort("held"))
    return signals, access


def _add_servo(
    builder: DiagramBuilder,
    chain: RobotModel,
    options: ServoOptions,
    ports: dict[str, OutputPort],
    q_J: np.ndarray,
) -> VelocityServo:
    """Add velocity servos, and return them."""
    servo, controller, faults = options.servo, options.controller, options.faults
    tick = controller.sampling_time
    period = servo.period or tick
    ratio = require_whole_fraction("servo.period", period, tick)
    rate = None if servo.integral_rate < 0.0 else servo.integral_rate
    gains = servo_gains(joint_inertia(chain, q_J), servo.bandwidth, period, rate)
    effort = chain.gather("effort_limit") * controller.effort_scale
    nominal = nominal_robot(chain, options.encoders, tick)
    watched = replace(supervision(controller.law, faults, nominal), joint_limits=False)
    system = builder.AddNamedSystem(
        "velocity_servo",
        VelocityServo(
            chain,
            VelocityServoLaw(gains, effort),
            safe_state(controller, chain, faults),
            watched,
            servo.watchdog or np.inf,
        ),
    )
    velocity = ports["drive"]
    if servo.bus_delay > 0.0:
        lost = servo.lost.begin, servo.lost.end
        delay = BusDelay(chain.dimension, servo.bus_delay, tick, lost)
        bus = builder.AddNamedSystem("bus_delay", BlockSystem(delay, tick))
        builder.Connect(velocity, bus.GetInputPort("sent"))
        builder.Connect(bus.GetOutputPort("silence"), system.GetInputPort("silence"))
        velocity = bus.GetOutputPort("delivered")
    elif ratio > 1:
        # the law must not be evaluated between its own ticks
        hold = builder.AddNamedSystem("velocity_hold", BlockSystem(Hold(chain.dimension), tick))
        builder.Connect(velocity, hold.GetInputPort("value"))
        velocity = hold.GetOutputPort("held")
    builder.Connect(velocity, system.GetInputPort("velocity_reference"))
    builder.Connect(ports["joint_state"], system.GetInputPort("joint_state"))
    return system
