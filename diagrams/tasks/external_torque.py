"""What the law is told about forces on the robot."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import Scenario
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.control.external_torque import ExternalTorque
from pfsc_drake.systems.control.following_controller import FollowingController


def needs_sensor(scenario: Scenario) -> bool:
    """Return whether something in the scenario acts on measured forces."""
    measured = scenario.controller.external_torque.source == "measured"
    return measured or scenario.compliance.needs_sensor


def add_external_torque(
    builder: DiagramBuilder,
    robot: RobotModel,
    scenario: Scenario,
    controller: FollowingController,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Tell the law the external torques in the joints, as far as they come from known forces.

    A sensor in the flange does not see what acts on links in front of it.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        scenario: The scenario.
        controller: The controller.
        ports: ``joint_state``, and of ``wrench_ext``, ``wrench_measured`` and ``push_torque``
            what there is.

    Returns:
        ``tau_ext`` as the law is told, with derivatives by rows, if anything acts on the robot.

    Raises:
        InputError: If the law knows no external torques.
    """
    parameters = scenario.controller.external_torque
    if parameters.source in ("none", "observed"):
        return {}
    seen = {
        "known": {"wrench_ext": "wrench", "push_torque": "link_torque"},
        "measured": {"wrench_measured": "wrench"},
    }[parameters.source]
    degree = controller.relative_degree
    if degree == 1:
        raise InputError(
            f"controller.external_torque.source = {parameters.source} with the law "
            f"'{scenario.controller.law}'; allowed: none, its servos bear the forces"
        )
    acting = {name: ports[name] for name in seen if name in ports}
    if not acting:  # nothing acts on the robot
        return {}
    torque = builder.AddNamedSystem(
        "external_torque",
        ExternalTorque(robot, degree - 2, scenario.controller.sampling_time, parameters.bandwidth),
    )
    for name, port in acting.items():
        builder.Connect(port, torque.GetInputPort(seen[name]))
    builder.Connect(ports["joint_state"], torque.GetInputPort("joint_state"))
    builder.Connect(torque.GetOutputPort("tau_ext"), controller.GetInputPort("tau_ext"))
    return {"tau_ext": torque.GetOutputPort("tau_ext")}
