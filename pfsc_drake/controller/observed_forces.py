"""What a law is told about forces on the robot, measured or from how the links move."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.blocks.wiring_blocks import Constant, Rows
from pfsc_drake.control.estimation.external_forces import ExternalTorque, ToolWrench
from pfsc_drake.control.estimation.momentum import MomentumObserver, link_momentum
from pfsc_drake.controller.believed import Believed
from pfsc_drake.controller.options.compliance_parameters import ObservedForceParameters
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController

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


def add_observed_forces(
    builder: DiagramBuilder,
    believed: Believed,
    options: ControllerParameters,
    tool: ObservedForceParameters | None,
    controller: FollowingController,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Observe external torques, for law, compliance and posture, whichever is to know them.

    Args:
        builder: Builder of the diagram.
        believed: The robot.
        options: What is chosen of the controller.
        tool: How forces on the tool are observed for compliance, if they are.
        controller: The controller.
        ports: ``joint_state`` as measured, and ``friction`` if friction is compensated.

    Returns:
        ``tau_ext_observed`` of shape (N,), with compliance without a sensor also
        ``wrench_observed`` and ``ready``, for a posture that yields ``posture_torque`` of shape
        (N,); empty if nothing is observed.

    Raises:
        InputError: If the law, the robot or what is done about friction does not allow it.
    """
    told, robot = options.external_torque, believed.robot
    posture = options.posture
    keys = {
        "controller.external_torque.source": told.source == "observed",
        "compliance.source": tool is not None,
        "controller.posture.yields": posture.yields == "observed",
    }
    needed = [key for key, is_needed in keys.items() if is_needed]
    if not needed:
        return {}
    _check(options, robot, controller, needed[0])
    inputs = ports | {"drive_torque": controller.GetOutputPort("drive_torque")}
    made: dict[str, OutputPort] = {}
    if told.source == "observed":
        order = controller.relative_degree - 2
        torque = _add_observer(
            builder, "external_torque_observer", believed, options, inputs, told.bandwidth, order
        )
        builder.Connect(torque, controller.GetInputPort("tau_ext"))
        made["tau_ext_observed"] = _first(builder, torque, robot.dimension, options.sampling_time)
    if posture.yields == "observed":
        made["posture_torque"] = _add_observer(
            builder, "posture_torque_observer", believed, options, inputs, posture.observer_rate, 0
        )
        made.setdefault("tau_ext_observed", made["posture_torque"])
    if tool is not None:
        torque = _add_observer(
            builder, "tool_force_observer", believed, options, inputs, tool.rate, 0
        )
        bands = (tool.force_dead_band, tool.torque_dead_band)
        fit = ToolWrench(robot, tool.damping, bands)
        period = options.sampling_time
        wrench = builder.AddNamedSystem("tool_wrench", BlockSystem(fit, period))
        builder.Connect(torque, wrench.GetInputPort("tau_ext"))
        builder.Connect(ports["joint_state"], wrench.GetInputPort("joint_state"))
        ready = builder.AddNamedSystem("no_taring", BlockSystem(Constant([1.0]), period))
        made |= {"wrench_observed": wrench.GetOutputPort("wrench")}
        made |= {"ready": ready.GetOutputPort("value")}
        made.setdefault("tau_ext_observed", torque)
    return made


def _check(
    options: ControllerParameters, robot: RobotModel, controller: FollowingController, key: str
) -> None:
    if controller.relative_degree == 1:
        raise InputError(
            f"{key} = observed with the law '{options.law}'; its servos do not tell "
            "the torques that an observer needs"
        )
    friction = options.friction
    if friction.source == "observer" and not robot.is_elastic:
        raise InputError(
            f"{key} = observed with controller.friction.source = observer: in rigid joints forces "
            "and friction cannot be told apart; allowed: controller.friction.source model or none"
        )


def _add_observer(
    builder: DiagramBuilder,
    name: str,
    believed: Believed,
    options: ControllerParameters,
    ports: dict[str, OutputPort],
    rate: float,
    num_derivatives: int,
) -> OutputPort:
    """Add an observer of external torques, and return them with their derivatives by rows."""
    period = options.sampling_time
    model = link_momentum(believed.robot).with_delay(believed.velocity_delay)
    observer = builder.AddNamedSystem(
        name, BlockSystem(MomentumObserver(model, rate, period, num_derivatives), period)
    )
    builder.Connect(ports["joint_state"], observer.GetInputPort("joint_state"))
    builder.Connect(ports["drive_torque"], observer.GetInputPort("drive_torque"))
    if "friction" in ports and model.known_weight.any():
        builder.Connect(ports["friction"], observer.GetInputPort("known_torque"))
    return observer.GetOutputPort("estimate")


def _first(builder: DiagramBuilder, torque: OutputPort, size: int, period: float) -> OutputPort:
    """Return the torques without their derivatives."""
    if torque.size() == size:
        return torque
    rows = Rows(torque.size(), range(size))
    first = builder.AddNamedSystem("external_torque_rows", BlockSystem(rows, period))
    builder.Connect(torque, first.GetInputPort("whole"))
    return first.GetOutputPort("part")
