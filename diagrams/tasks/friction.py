"""What the law is told about friction."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import Scenario
from pfsc_drake.control.estimation.generalized_momentum import drive_momentum
from pfsc_drake.control.estimation.momentum_observer import MomentumObserver
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.control.disturbance_observer import DisturbanceObserver
from pfsc_drake.systems.control.following_controller import FollowingController

# f_c [Nm or N] and f_v [Nm s/rad or N s/m], each (N,)
Coefficients = tuple[np.ndarray, np.ndarray]


def add_friction_compensation(
    builder: DiagramBuilder,
    robot: RobotModel,
    scenario: Scenario,
    controller: FollowingController,
    believed: Coefficients | None,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Let the law overcome friction, if it is to.

    Args:
        builder: Builder of the diagram.
        robot: The robot as it is believed.
        scenario: The scenario.
        controller: The controller.
        believed: Coefficients of friction, if any are believed.
        ports: ``joint_state`` as measured, and ``tau_ext`` if the law is told of it.

    Returns:
        ``friction_estimate`` for the log, if there is one.

    Raises:
        InputError: If the compensation does not suit law or robot, or lacks coefficients.
    """
    parameters = scenario.controller.friction
    if parameters.source == "none":
        return {}
    if controller.relative_degree == 1:
        raise InputError(
            f"controller.friction.source = {parameters.source} with the law "
            f"'{scenario.controller.law}'; allowed: none, its servos overcome friction"
        )
    period = scenario.controller.sampling_time
    observer = builder.AddNamedSystem(
        "disturbance_observer",
        DisturbanceObserver(
            MomentumObserver(drive_momentum(robot), parameters.rate, period), period
        ),
    )
    builder.Connect(controller.GetOutputPort("drive_torque"), observer.GetInputPort("drive_torque"))
    builder.Connect(ports["joint_state"], observer.GetInputPort("joint_state"))
    friction = observer.GetOutputPort("estimate")
    if parameters.applied:
        builder.Connect(friction, controller.GetInputPort("friction_torque"))
    return {"friction_estimate": friction}
