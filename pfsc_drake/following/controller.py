"""A law with what tells it of its reference, of forces and friction, and of spare joints."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.blocks.wiring_blocks import Collect, Constant
from pfsc_drake.control.compliance.tuned_impedance import TuningParameters
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.law.reference import SmoothStart
from pfsc_drake.following.compliance import add_compliance, has_impedance, reference_order
from pfsc_drake.following.friction import add_friction_compensation, rest_hold
from pfsc_drake.following.law import Believed, supervision
from pfsc_drake.following.observed_forces import add_external_torque, add_observed_forces
from pfsc_drake.following.options.compliance import ObservedForceParameters
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.options.follower import FaultParameters, FollowerOptions
from pfsc_drake.following.posture import add_posture_reference
from pfsc_drake.following.prediction import connect_predictor
from pfsc_drake.following.task import Task
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController

# what stops the robot, in the order of the port that is told
_ALARMS = ("sensor_fault", "tared", "compliance_status", "press_lost")


def add_reference(
    builder: DiagramBuilder,
    controller: FollowingController,
    linearization: Linearization,
    robot: RobotModel,
    options: FollowerOptions,
    task: Task,
    posture: np.ndarray,
    tuning: TuningParameters,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Connect ``reference`` and ``alarms`` of a controller.

    Args:
        builder: Builder of the diagram.
        controller: The controller.
        linearization: Linearization of its law.
        robot: The robot as it is believed, N joints.
        options: How the tool complies, and how long the transition to the motion takes.
        task: Task of the tool.
        posture: Joint coordinates at the start, shape (N,) [rad or m].
        tuning: Response of the impedance to an operator's settings.
        ports: ``desired_reference``, derivatives up to :func:`reference_order` by rows, and what
            :func:`add_compliance` takes; of a force sensor ``sensor_fault`` and ``tared``; of a
            reference that waits ``own_time``, with which a transition waits.

    Returns:
        ``reference`` as the law is told, and what :func:`add_compliance` returns for the log.

    Raises:
        InputError: If the compliance does not suit the law.
    """
    m, period, compliance = linearization.num_outputs, controller.period, options.compliance
    state, desired = controller.GetOutputPort("manifold_state"), ports["desired_reference"]
    if options.transition > 0.0:
        order = reference_order(compliance, linearization)
        smooth = SmoothStart(options.transition, order, m, state.size(), period)
        start = builder.AddNamedSystem("smooth_start", BlockSystem(smooth, period))
        builder.Connect(desired, start.GetInputPort("desired_reference"))
        builder.Connect(state, start.GetInputPort("manifold_state"))
        if "own_time" in ports:
            builder.Connect(ports["own_time"], start.GetInputPort("own_time"))
        desired = start.GetOutputPort("reference")
    made = {"reference": desired}
    if has_impedance(compliance, linearization.manifold):
        told = ports | {"desired_reference": desired, "manifold_state": state}
        made |= add_compliance(
            builder, options, linearization, robot, task, posture, tuning, told, period
        )
    _connect_alarms(builder, controller, ports, made)
    builder.Connect(made["reference"], controller.GetInputPort("reference"))
    return made


def _connect_alarms(
    builder: DiagramBuilder,
    controller: FollowingController,
    ports: dict[str, OutputPort],
    made: dict[str, OutputPort],
) -> None:
    """Let the robot stop for faults of the force sensor and of the compliance, if there are any.

    What compliance alone tells is taken out of what is made.
    """
    told = {name: ports[name] for name in _ALARMS if name in ports}
    told |= {name: made.pop(name) for name in _ALARMS if name in made}
    if not told:
        return
    period = controller.period
    collect = Collect(dict.fromkeys(_ALARMS, 1))
    alarms = builder.AddNamedSystem("alarms", BlockSystem(collect, period))
    for name in _ALARMS:
        if name not in told:
            none = builder.AddNamedSystem(f"no_{name}", BlockSystem(Constant([0.0]), period))
            told[name] = none.GetOutputPort("value")
        builder.Connect(told[name], alarms.GetInputPort(name))
    builder.Connect(alarms.GetOutputPort("all"), controller.GetInputPort("alarms"))


# what an observer tells
_OBSERVED = ("tau_ext_observed", "wrench_observed")


def add_controller(
    builder: DiagramBuilder,
    law: FollowingLaw,
    believed: Believed,
    options: ControllerParameters,
    faults: FaultParameters,
    ports: dict[str, OutputPort],
    tool: ObservedForceParameters | None = None,
    predictor: BlockSystem | None = None,
    *,
    carries: bool = False,
) -> tuple[FollowingController, dict[str, OutputPort], dict[str, OutputPort]]:
    """Add a law and connect all of its inputs but ``reference`` and ``alarms``.

    Args:
        builder: Builder of the diagram.
        law: The law.
        believed: The robot.
        options: What is chosen of the controller.
        faults: What is a fault.
        ports: ``joint_state``, ``manifold_point``, and what there is of ``wrench_ext``,
            ``wrench_measured``, ``push_torque``.
        tool: How forces on the tool are observed for compliance, if they are.
        predictor: What foretells ``joint_state``, if anything does.
        carries: Whether the robot carries something that moves with it.

    Returns:
        The controller; the ports given with all that was added (see the functions that add it);
        and what of that is worth a look: ``friction_estimate``, ``tau_ext_observed``,
        ``wrench_observed``, ``posture_reference``.

    Raises:
        InputError: If external torques, friction or posture do not suit the law.
    """
    watched = supervision(options.law, faults, believed)
    controller = builder.AddNamedSystem(
        "following_controller",
        FollowingController(
            law,
            options.sampling_time,
            watched,
            carries=carries,
            hold=rest_hold(law, believed, options),
        ),
    )
    robot, signals = believed.robot, dict(ports)
    signals |= add_external_torque(builder, robot, options, controller, signals)
    friction, logged = add_friction_compensation(builder, believed, options, controller, signals)
    if friction is not None:
        signals["friction"] = friction
    if predictor is not None:
        connect_predictor(builder, predictor, controller, friction)
    signals |= add_observed_forces(builder, believed, options, tool, controller, signals)
    logged |= {name: signals[name] for name in _OBSERVED if name in signals}
    logged |= add_posture_reference(builder, robot, options, law, controller, signals)
    for name in ("joint_state", "manifold_point"):
        builder.Connect(signals[name], controller.GetInputPort(name))
    return controller, signals, logged
