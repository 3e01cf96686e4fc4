"""Estimate of the links' side of elastic joints from motors and torques."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

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
from pfsc_drake.controller.nominal_robot import Coefficients
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.robot.robot_model import RobotModel, gravity_function
from pfsc_drake.systems.block_system import BlockSystem

# name of the block that reports standard deviations of the links' state
DEVIATION = "link_deviation"


@dataclass(frozen=True)
class LinkEstimate:
    """Estimated state of the links of elastic joints.

    Attributes:
        joint_state: ``[q_J, v_J, q_M, v_M]`` for the controller.
        drive_torque: Input for the commands to the drives, if there is one.
        signals: For the log: ``found_joint_state``, ``joint_torque`` if it is measured, and
            standard deviations, see :class:`LinkDeviation`; empty without an estimate.
    """

    joint_state: OutputPort
    drive_torque: InputPort | None = None
    signals: dict[str, OutputPort] = field(default_factory=dict)


def add_links(
    builder: DiagramBuilder,
    robot: RobotModel,
    controller: ControllerParameters,
    measured: OutputPort,
    start: np.ndarray,
    friction: Coefficients | None,
    torque: OutputPort | None = None,
    motors: MotorEncoders | None = None,
) -> LinkEstimate:
    """Add the estimate of the links' side of elastic joints.

    Args:
        builder: Builder of the diagram.
        robot: Nominal model of the robot, N joints.
        controller: Bandwidth and uncertainty.
        measured: ``[q_J, v_J, q_M, v_M]``, of elastic joints the motors' side.
        start: Joint coordinates at the start, at rest, shape (N,).
        friction: Coefficients f_c and f_v of the nominal model, each (N,), if there are any.
        torque: Measured joint torques, shape (N,) [Nm or N]; observed from the motors if omitted.
        motors: Encoders of the motors, for standard deviations; no deviations if omitted.
    """
    period, drive_input, signals = controller.sampling_time, None, dict[str, OutputPort]()
    if torque is None:
        torque, drive_input = _add_torque_observer(
            builder, robot, controller, measured, start, friction
        )
    else:
        signals["joint_torque"] = torque
    found = LinkState(robot, controller.state_bandwidth, period)
    system = builder.AddNamedSystem("link_state", BlockSystem(found, period))
    builder.Connect(measured, system.GetInputPort("joint_state"))
    builder.Connect(torque, system.GetInputPort("joint_torque"))
    joint_state = system.GetOutputPort("joint_state")
    if motors is not None:
        observes = drive_input is not None
        block = _deviation(robot.numeric, controller, motors, start, friction, observes=observes)
        deviation = builder.AddNamedSystem(DEVIATION, BlockSystem(block, period))
        builder.Connect(joint_state, deviation.get_input_port())
        signals = {name: deviation.GetOutputPort(name) for name in block.outputs} | signals
    return LinkEstimate(joint_state, drive_input, signals | {"found_joint_state": joint_state})


def _deviation(
    robot: RobotModel,
    controller: ControllerParameters,
    motors: MotorEncoders,
    start: np.ndarray,
    friction: Coefficients | None,
    *,
    observes: bool,
) -> LinkDeviation:
    """Return the block with standard deviations of the estimate."""
    period, rate = controller.sampling_time, controller.state_bandwidth
    known = robot, controller.state_uncertainty, motors, start, rate, period
    errors = (
        errors_of_observed_torques(*known, friction)
        if observes
        else errors_of_measured_torques(*known)
    )
    return LinkDeviation(robot, errors)


def _add_torque_observer(
    builder: DiagramBuilder,
    robot: RobotModel,
    controller: ControllerParameters,
    measured: OutputPort,
    start: np.ndarray,
    friction: Coefficients | None,
) -> tuple[OutputPort, InputPort]:
    """Add the observer of spring torques from the motors; it starts with the weight."""
    period, known = controller.sampling_time, friction or (np.zeros(robot.dimension),) * 2

    def add(name: str, block: Block) -> BlockSystem:
        return builder.AddNamedSystem(name, BlockSystem(block, period))

    model = motor_momentum(robot, known)
    observer = add(
        "spring_torque_observer", MomentumObserver(model, controller.state_bandwidth, period)
    )
    weight = gravity_function(robot.numeric)(start).full().ravel()
    torque_at_start = add("weight_at_start", Constant(weight)).GetOutputPort("value")
    total = add("spring_torque", Sum(2, robot.dimension))
    builder.Connect(measured, observer.GetInputPort("joint_state"))
    builder.Connect(torque_at_start, observer.GetInputPort("known_torque"))
    builder.Connect(torque_at_start, total.GetInputPort("term_0"))
    builder.Connect(observer.GetOutputPort("estimate"), total.GetInputPort("term_1"))
    return total.GetOutputPort("sum"), observer.GetInputPort("drive_torque")
