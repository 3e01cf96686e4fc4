"""Prediction of the joint state for a law whose torques act with a delay."""

from dataclasses import replace

from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.estimation.robot_state import StatePredictor
from pfsc_drake.controller.law import ticks_of
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.errors import require
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController


def add_prediction(
    builder: DiagramBuilder,
    nominal: NominalRobot,
    options: ControllerParameters,
    joint_state: OutputPort,
) -> tuple[OutputPort, NominalRobot, BlockSystem | None]:
    """Add the prediction of the state at which commanded torques act, if it is chosen.

    Args:
        builder: Builder of the diagram.
        nominal: Nominal model of the robot.
        options: Parameters of the controller.
        joint_state: ``[q_J, v_J, q_M, v_M]`` as measured.

    Returns:
        The joint state for the law, the nominal model with its age, and the predictor, whose
        torques :func:`connect_predictor` connects; None without.

    Raises:
        InputError: If the delay does not suit the law or its sampling time.
    """
    if options.delay is None:
        return joint_state, nominal, None
    period = options.sampling_time
    allowed = "null with the law 'velocity_servo', which commands no torques"
    require(options.law_record.commands_torque, "controller.delay", options.delay, allowed)
    ticks = ticks_of(options)
    block = StatePredictor(nominal.robot, ticks, period, nominal.velocity_delay)
    predictor = builder.AddNamedSystem("state_predictor", BlockSystem(block, period))
    builder.Connect(joint_state, predictor.GetInputPort("joint_state"))
    now = replace(nominal, velocity_delay=0.0)
    return predictor.GetOutputPort("joint_state"), now, predictor


def connect_predictor(
    builder: DiagramBuilder,
    predictor: BlockSystem,
    controller: FollowingController,
    friction: OutputPort | None,
) -> None:
    """Connect a predictor with the commands to the drives, and with the compensated friction.

    Args:
        builder: Builder of the diagram.
        predictor: The predictor.
        controller: System that commands the drives.
        friction: Compensated torque of friction, shape (N,), if there is one.
    """
    drive = controller.GetOutputPort(controller.drive_port)
    builder.Connect(drive, predictor.GetInputPort("drive_torque"))
    if friction is not None:
        builder.Connect(friction, predictor.GetInputPort("friction_torque"))
