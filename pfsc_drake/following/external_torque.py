"""What the law is told about forces on the robot."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.estimation.external_forces import ExternalTorque
from pfsc_drake.errors import InputError
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.control.following_controller import FollowingController

# by source the signals that tell, and the ports of ExternalTorque for them
_SEEN = {
    "known": {"wrench_ext": "wrench", "push_torque": "link_torque"},
    "measured": {"wrench_measured": "wrench"},
}
_SYSTEMS = {"tau_ext": "external_torque", "posture_torque": "external_torque_of_posture"}


def add_external_torque(
    builder: DiagramBuilder,
    robot: RobotModel,
    options: ControllerParameters,
    controller: FollowingController,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Tell the law the external torques in the joints, as far as they come from known forces.

    A sensor in the flange does not see what acts on links in front of it.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        options: What is chosen of the controller.
        controller: The controller.
        ports: ``joint_state``, and of ``wrench_ext``, ``wrench_measured`` and ``push_torque``
            what there is.

    Returns:
        ``tau_ext`` as the law is told, with derivatives by rows, and ``posture_torque`` of shape
        (N,) as a posture is told that yields to known forces, as far as anything acts on the
        robot.

    Raises:
        InputError: If the law knows no external torques.
    """
    parameters, made = options.external_torque, dict[str, OutputPort]()
    period, degree = options.sampling_time, controller.relative_degree
    if options.posture.yields == "known":
        posture = ExternalTorque(robot, 0, period)
        made |= _add(builder, "posture_torque", posture, period, _SEEN["known"], ports)
    if parameters.source not in _SEEN:
        return made
    if degree == 1:
        raise InputError(
            f"controller.external_torque.source = {parameters.source} with the law "
            f"'{options.law}'; allowed: none, its servos bear the forces"
        )
    torque = ExternalTorque(robot, degree - 2, period, parameters.bandwidth)
    made |= _add(builder, "tau_ext", torque, period, _SEEN[parameters.source], ports)
    if "tau_ext" in made:
        builder.Connect(made["tau_ext"], controller.GetInputPort("tau_ext"))
    return made


def _add(
    builder: DiagramBuilder,
    name: str,
    torque: ExternalTorque,
    period: float,
    seen: dict[str, str],
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add external torques, and return them by name; nothing if nothing acts on the robot."""
    acting = {signal: ports[signal] for signal in seen if signal in ports}
    if not acting:
        return {}
    system = builder.AddNamedSystem(_SYSTEMS[name], BlockSystem(torque, period))
    for signal, port in acting.items():
        builder.Connect(port, system.GetInputPort(seen[signal]))
    builder.Connect(ports["joint_state"], system.GetInputPort("joint_state"))
    return {name: system.GetOutputPort("tau_ext")}
