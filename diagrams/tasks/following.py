"""From the joint state to the drive input: what all stations share."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.believed import believed_robot
from diagrams.scenario import Scenario
from diagrams.scenario.checks import require
from diagrams.tasks.compliance import add_compliance, has_impedance, reference_order
from diagrams.tasks.guidance import add_guidance
from diagrams.tasks.space_guidance import SpaceTask
from diagrams.tasks.task import Task
from pfsc_drake.blocks.wiring_blocks import Collect, Constant
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.smooth_start import SmoothStart
from pfsc_drake.control.law.swing import SwingingManifold, SwingingReference
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.manifolds.manifold import Kind, indices
from pfsc_drake.control.tool_kinematics import ToolKinematics
from pfsc_drake.errors import InputError
from pfsc_drake.following.believed import Coefficients
from pfsc_drake.following.controller import add_controller
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.control.following_controller import FollowingController

# what guidance tells, for the log
_GUIDANCE = {"guidance": "record", "mode": "mode"}


@dataclass(frozen=True)
class Following:
    """What a robot is to do, and by which law.

    Attributes:
        scenario: The scenario.
        robot: The robot as it is believed to be.
        task: What it is to do.
        law: The law.
        start: Joint coordinates at the start, shape (N,).
        on_motors: Whether the law acts on the tool pose of the motors, not of the links.
        friction: Coefficients f_c and f_v that are believed, each (N,), if there are any.
    """

    scenario: Scenario
    robot: RobotModel
    task: Task
    law: FollowingLaw
    start: np.ndarray
    on_motors: bool = False
    friction: Coefficients | None = None


@dataclass(frozen=True)
class PlaceOnManifold:
    """Where the tool is.

    Attributes:
        projector: What finds it.
        desired_reference: Reference of the virtual output, before it yields to forces; None where
            forces alone lead the tool.
        signals: ``joint_state``, ``tool_pose``, ``manifold_point``.
    """

    projector: BlockSystem
    desired_reference: OutputPort | None
    signals: dict[str, OutputPort]


def add_place(
    builder: DiagramBuilder, following: Following, joint_state: OutputPort
) -> PlaceOnManifold:
    """Add what finds the tool's place on the manifold.

    Args:
        builder: Builder of the diagram.
        following: What the robot is to do.
        joint_state: ``[q_J, v_J, q_M, v_M]`` as measured.

    Raises:
        InputError: If compliance and law do not go together.
    """
    task, linearization = following.task, following.law.linearization
    period = following.scenario.controller.sampling_time
    kinematics = builder.AddNamedSystem(
        "tool_kinematics",
        BlockSystem(ToolKinematics(following.robot, following.on_motors), period),
    )
    tool_pose, desired = kinematics.GetOutputPort("tool_pose"), None
    if not isinstance(task, SpaceTask):
        order = reference_order(following.scenario, linearization)
        timed = TimedReference(task.motion, order, linearization.num_outputs, period)
        generator = builder.AddNamedSystem("reference_generator", BlockSystem(timed, period))
        desired = _swung(builder, following, generator.GetOutputPort("reference"), order)
    builder.Connect(joint_state, kinematics.GetInputPort("joint_state"))
    place = task.add_place(builder, tool_pose, desired, period)
    signals = {
        "joint_state": joint_state,
        "tool_pose": tool_pose,
        "manifold_point": place.manifold_point,
    }
    return PlaceOnManifold(place.projector, desired, signals)


def _swung(
    builder: DiagramBuilder, following: Following, desired: OutputPort, order: int
) -> OutputPort:
    """Return the reference on a manifold that moves, if it does."""
    swings, linearization = following.scenario.reference.swings, following.law.linearization
    if not swings:
        return desired
    manifold, m = linearization.manifold, linearization.num_outputs
    period = following.scenario.controller.sampling_time
    allowed = "none with controller.manifold = trajectory, whose coordinates are those of space"
    require(not manifold.follows_time, "reference.swings", f"{len(swings)} given", allowed)
    across = indices(manifold.coordinates, Kind.TRANSVERSAL)
    try:
        swinging = SwingingReference(swings, across.start, across.stop - across.start, m, order)
    except InputError as error:
        raise InputError(f"reference.{error}") from None
    system = builder.AddNamedSystem(
        "swinging_manifold",
        BlockSystem(SwingingManifold(swinging, (order + 1) * m, period), period),
    )
    builder.Connect(desired, system.GetInputPort("desired_reference"))
    return system.GetOutputPort("reference")


def add_law(
    builder: DiagramBuilder,
    following: Following,
    place: PlaceOnManifold,
    forces: dict[str, OutputPort],
) -> tuple[FollowingController, dict[str, OutputPort]]:
    """Add the law with its reference, which yields to forces if it is to.

    Args:
        builder: Builder of the diagram.
        following: What the robot is to do.
        place: Where the tool is.
        forces: Of ``wrench_ext`` and ``wrench_measured`` what there is.

    Returns:
        The controller, and its signals ``reference`` and ``law``; with compliance also
        ``desired_reference`` and ``manifold_force``, with what estimates friction
        ``friction_estimate``, with what observes forces ``tau_ext_observed`` and
        ``wrench_observed``.

    Raises:
        InputError: If compliance, external torques or friction do not suit the law.
    """
    scenario, law = following.scenario, following.law
    yields = scenario.compliance.is_given and scenario.compliance.source == "observed"
    controller, signals, made = add_controller(
        builder,
        law,
        believed_robot(scenario, following.robot, following.friction),
        scenario.controller,
        scenario.faults,
        place.signals | forces,
        scenario.compliance.observed if yields else None,
    )
    made |= {"law": controller.GetOutputPort("law")}
    desired = place.desired_reference
    if desired is None:
        guidance = _add_guidance(builder, following, signals)
        desired = guidance.GetOutputPort("reference")
        made |= {name: guidance.GetOutputPort(port) for name, port in _GUIDANCE.items()}
    desired = _add_smooth_start(builder, following, controller, desired)
    made = {"reference": desired} | made
    if has_impedance(scenario):
        inputs = signals | {
            "desired_reference": desired,
            "manifold_state": controller.GetOutputPort("manifold_state"),
        }
        task = following.task
        made |= add_compliance(
            builder,
            scenario,
            law.linearization,
            following.robot,
            following.start,
            inputs,
            task.lap,
            task.motion.domain[1],
            task.length,
        )
    _connect_alarms(builder, controller, forces, made)
    builder.Connect(made["reference"], controller.GetInputPort("reference"))
    return controller, made


def _add_guidance(
    builder: DiagramBuilder, following: Following, signals: dict[str, OutputPort]
) -> BlockSystem:
    """Add what leads a tool that has no reference of its own."""
    task, scenario = following.task, following.scenario
    assert isinstance(task, SpaceTask)  # see add_place
    order = reference_order(scenario, following.law.linearization)
    return add_guidance(builder, scenario, following.robot, task, order, signals, following.start)


def _add_smooth_start(
    builder: DiagramBuilder,
    following: Following,
    controller: FollowingController,
    desired: OutputPort,
) -> OutputPort:
    """Return the reference, which starts where the tool is if it is to."""
    duration, linearization = following.scenario.start.transition, following.law.linearization
    if duration == 0.0:
        return desired
    allowed = "0 with controller.manifold = trajectory, whose reference is a point that moves"
    require(not linearization.manifold.follows_time, "start.transition", duration, allowed)
    smooth = SmoothStart(
        duration,
        reference_order(following.scenario, linearization),
        linearization.num_outputs,
        controller.GetOutputPort("manifold_state").size(),
        controller.period,
    )
    start = builder.AddNamedSystem("smooth_start", BlockSystem(smooth, controller.period))
    builder.Connect(desired, start.GetInputPort("desired_reference"))
    builder.Connect(
        controller.GetOutputPort("manifold_state"), start.GetInputPort("manifold_state")
    )
    return start.GetOutputPort("reference")


def _connect_alarms(
    builder: DiagramBuilder,
    controller: FollowingController,
    forces: dict[str, OutputPort],
    made: dict[str, OutputPort],
) -> None:
    """Let the robot stop for faults of the force sensor and of the compliance, if there are any.

    What compliance alone tells is taken out of what is made.
    """
    ports = [forces.get("sensor_fault"), forces.get("tared")]
    ports += [made.pop(name, None) for name in ("compliance_status", "press_lost")]
    if ports == [None] * len(ports):
        return
    names = ("sensor_fault", "tared", "compliance_status", "press_lost")
    collect, period = Collect(dict.fromkeys(names, 1)), controller.period
    alarms = builder.AddNamedSystem("alarms", BlockSystem(collect, period))
    for name, port in zip(names, ports, strict=True):
        if port is None:
            none = builder.AddNamedSystem(f"no_{name}", BlockSystem(Constant([0.0]), period))
            port = none.GetOutputPort("value")
        builder.Connect(port, alarms.GetInputPort(name))
    builder.Connect(alarms.GetOutputPort("all"), controller.GetInputPort("alarms"))
