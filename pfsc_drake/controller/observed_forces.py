"""External forces for the law, known, measured, or observed from the joint motion."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.blocks.wiring_blocks import Constant, Rows
from pfsc_drake.control.estimation.external_forces import ExternalTorque, ToolWrench
from pfsc_drake.control.estimation.momentum import MomentumObserver, link_momentum
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.options.compliance_parameters import ObservedForceParameters
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController

# signals by source, and the ports of ExternalTorque for them
_INPUTS = {
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
    """Add external joint torques of known or measured forces, and connect them to the law.

    A sensor in the flange does not measure forces on the links in front of it.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        options: Parameters of the controller.
        controller: The controller.
        ports: ``joint_state``, and those of ``wrench_ext``, ``wrench_measured`` and
            ``push_torque`` that exist.

    Returns:
        ``tau_ext`` for the law, with derivatives by rows, and ``posture_torque`` of shape (N,) for
        a posture that complies with known forces; empty without forces on the robot.

    Raises:
        InputError: If the law does not use external torques.
    """
    parameters, added = options.external_torque, dict[str, OutputPort]()
    period, degree = options.sampling_time, controller.relative_degree
    if options.posture.yields == "known":
        posture = ExternalTorque(robot, 0, period)
        added |= _add(builder, "posture_torque", posture, period, _INPUTS["known"], ports)
    if parameters.source not in _INPUTS:
        return added
    if degree == 1:
        raise InputError(
            f"controller.external_torque.source = {parameters.source} with the law "
            f"'{options.law}'; allowed: none, its servos reject the forces"
        )
    torque = ExternalTorque(robot, degree - 2, period, parameters.bandwidth)
    added |= _add(builder, "tau_ext", torque, period, _INPUTS[parameters.source], ports)
    if "tau_ext" in added:
        builder.Connect(added["tau_ext"], controller.GetInputPort("tau_ext"))
    return added


def _add(
    builder: DiagramBuilder,
    name: str,
    torque: ExternalTorque,
    period: float,
    inputs: dict[str, str],
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add external torques, and return them by name; empty without forces on the robot."""
    acting = {signal: ports[signal] for signal in inputs if signal in ports}
    if not acting:
        return {}
    system = builder.AddNamedSystem(_SYSTEMS[name], BlockSystem(torque, period))
    for signal, port in acting.items():
        builder.Connect(port, system.GetInputPort(inputs[signal]))
    builder.Connect(ports["joint_state"], system.GetInputPort("joint_state"))
    return {name: system.GetOutputPort("tau_ext")}


def add_observed_forces(
    builder: DiagramBuilder,
    nominal: NominalRobot,
    options: ControllerParameters,
    tool: ObservedForceParameters | None,
    controller: FollowingController,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add observers of external torques for law, compliance and posture, as chosen.

    Args:
        builder: Builder of the diagram.
        nominal: Nominal model of the robot.
        options: Parameters of the controller.
        tool: Observer of forces on the tool for compliance, if there is one.
        controller: The controller.
        ports: ``joint_state`` as measured, and ``friction`` if friction is compensated.

    Returns:
        ``tau_ext_observed`` of shape (N,), with compliance without a sensor also
        ``wrench_observed`` and ``ready``, for a compliant posture ``posture_torque`` of shape (N,);
        empty if nothing is observed.

    Raises:
        InputError: If the law, the robot or the friction compensation does not allow it.
    """
    external, robot = options.external_torque, nominal.robot
    posture = options.posture
    keys = {
        "controller.external_torque.source": external.source == "observed",
        "compliance.source": tool is not None,
        "controller.posture.yields": posture.yields == "observed",
    }
    needed = [key for key, is_needed in keys.items() if is_needed]
    if not needed:
        return {}
    _check(options, robot, controller, needed[0])
    inputs = ports | {"drive_torque": controller.GetOutputPort("drive_torque")}
    added: dict[str, OutputPort] = {}
    if external.source == "observed":
        order = controller.relative_degree - 2
        torque = _add_observer(
            builder, "external_torque_observer", nominal, options, inputs, external.bandwidth, order
        )
        builder.Connect(torque, controller.GetInputPort("tau_ext"))
        added["tau_ext_observed"] = _first(builder, torque, robot.dimension, options.sampling_time)
    if posture.yields == "observed":
        added["posture_torque"] = _add_observer(
            builder, "posture_torque_observer", nominal, options, inputs, posture.observer_rate, 0
        )
        added.setdefault("tau_ext_observed", added["posture_torque"])
    if tool is not None:
        torque = _add_observer(
            builder, "tool_force_observer", nominal, options, inputs, tool.rate, 0
        )
        bands = (tool.force_dead_band, tool.torque_dead_band)
        fit = ToolWrench(robot, tool.damping, bands)
        period = options.sampling_time
        wrench = builder.AddNamedSystem("tool_wrench", BlockSystem(fit, period))
        builder.Connect(torque, wrench.GetInputPort("tau_ext"))
        builder.Connect(ports["joint_state"], wrench.GetInputPort("joint_state"))
        ready = builder.AddNamedSystem("no_taring", BlockSystem(Constant([1.0]), period))
        added |= {"wrench_observed": wrench.GetOutputPort("wrench")}
        added |= {"ready": ready.GetOutputPort("value")}
        added.setdefault("tau_ext_observed", torque)
    return added


def _check(
    options: ControllerParameters, robot: RobotModel, controller: FollowingController, key: str
) -> None:
    if controller.relative_degree == 1:
        raise InputError(
            f"{key} = observed with the law '{options.law}'; its servos do not report "
            "the torques that an observer needs"
        )
    friction = options.friction
    if friction.source == "observer" and not robot.is_elastic:
        raise InputError(
            f"{key} = observed with controller.friction.source = observer: in rigid joints forces "
            "and friction cannot be separated; allowed: controller.friction.source model or none"
        )


def _add_observer(
    builder: DiagramBuilder,
    name: str,
    nominal: NominalRobot,
    options: ControllerParameters,
    ports: dict[str, OutputPort],
    rate: float,
    num_derivatives: int,
) -> OutputPort:
    """Add an observer of external torques, and return them with their derivatives by rows."""
    period = options.sampling_time
    model = link_momentum(nominal.robot).with_delay(nominal.velocity_delay)
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
