"""The state for which a law of torques that act late is evaluated."""

from dataclasses import replace

from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.estimation.robot_state import StatePredictor
from pfsc_drake.controller.believed import Believed
from pfsc_drake.controller.law import ticks_of
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.errors import require
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController


def add_prediction(
    builder: DiagramBuilder,
    believed: Believed,
    options: ControllerParameters,
    joint_state: OutputPort,
) -> tuple[OutputPort, Believed, BlockSystem | None]:
    """Add what foretells the state in which commanded torques act, where the law is to know.

    Args:
        builder: Builder of the diagram.
        believed: The robot.
        options: What is chosen of the controller.
        joint_state: ``[q_J, v_J, q_M, v_M]`` as measured.

    Returns:
        The joint state for the law, what is believed of how well that is known, and the predictor,
        whose torques :func:`connect_predictor` brings; None without.

    Raises:
        InputError: If the delay does not suit the law or its sampling time.
    """
    if options.delay is None:
        return joint_state, believed, None
    period = options.sampling_time
    allowed = "null with the law 'velocity_servo', which commands no torques"
    require(options.law_record.commands_torque, "controller.delay", options.delay, allowed)
    ticks = ticks_of(options)
    block = StatePredictor(believed.robot, ticks, period, believed.velocity_delay)
    predictor = builder.AddNamedSystem("state_predictor", BlockSystem(block, period))
    builder.Connect(joint_state, predictor.GetInputPort("joint_state"))
    now = replace(believed, velocity_delay=0.0)
    return predictor.GetOutputPort("joint_state"), now, predictor


def connect_predictor(
    builder: DiagramBuilder,
    predictor: BlockSystem,
    controller: FollowingController,
    friction: OutputPort | None,
) -> None:
    """Tell a predictor what the drives are told, and what of it friction is believed to take.

    Args:
        builder: Builder of the diagram.
        predictor: The predictor.
        controller: What tells the drives.
        friction: Torque of friction that is compensated, shape (N,), if any is.
    """
    drive = controller.GetOutputPort(controller.drive_port)
    builder.Connect(drive, predictor.GetInputPort("drive_torque"))
    if friction is not None:
        builder.Connect(friction, predictor.GetInputPort("friction_torque"))
