"""From the joint state to the drive input: what all stations share."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.belief import believed_robot
from diagrams.scenario.checks import require
from diagrams.tasks.held_frame import HeldFrame
from diagrams.tasks.space_guidance import SpaceTask
from diagrams.tasks.streaming import StreamTask
from diagrams.tasks.task import Task
from diagrams.tasks.waiting import Waiting, add_waiting_reference
from pfsc_drake.control.compliance.tuned_impedance import TuningParameters
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.swing import Swing, SwingingManifold, SwingingReference
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import ToolKinematics, indices
from pfsc_drake.errors import InputError
from pfsc_drake.following.compliance import reference_order
from pfsc_drake.following.controller import add_controller, add_reference
from pfsc_drake.following.fixtures import add_fixture_guidance
from pfsc_drake.following.followed import Wanted
from pfsc_drake.following.law import Believed, Coefficients
from pfsc_drake.following.options.compliance import ComplianceParameters
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.options.follower import FaultParameters
from pfsc_drake.following.prediction import add_prediction
from pfsc_drake.following.streamed_path import Stream, add_stream
from pfsc_drake.physics.joint_sensors import EncoderOptions
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController
from pfsc_drake.systems.physics.operator_panel import OperatorPanel

# what guidance tells, for the log
_GUIDANCE = {"guidance": "record", "mode": "mode", "guides": "guides"}


@dataclass(frozen=True)
class FollowingOptions:
    """What is chosen of a controller and of how its reference begins and moves.

    Attributes:
        controller: The controller.
        faults: What is a fault, and how it ends.
        compliance: How the tool yields to forces.
        encoders: What measures the joints.
        swings: How the manifold moves, if it does.
        transition: How long the reference takes from where the tool starts [s].
        tuning: How the impedance follows what a person sets.
    """

    controller: ControllerParameters
    faults: FaultParameters
    compliance: ComplianceParameters
    encoders: EncoderOptions
    swings: list[Swing]
    transition: float
    tuning: TuningParameters


@dataclass(frozen=True)
class Following:
    """What a robot is to do, and by which law.

    Attributes:
        options: What is chosen of the controller.
        robot: The robot as it is believed to be.
        task: What it is to do.
        law: The law.
        start: Joint coordinates at the start, shape (N,).
        on_motors: Whether the law acts on the tool pose of the motors, not of the links.
        friction: Coefficients f_c and f_v that are believed, each (N,), if there are any.
        held: What carries the task's manifold, if anything does.
        carries: Whether the robot carries something that moves with it.
        waiting: How its progress waits for obstacles, if it does.
    """

    options: FollowingOptions
    robot: RobotModel
    task: Task
    law: FollowingLaw
    start: np.ndarray
    on_motors: bool = False
    friction: Coefficients | None = None
    held: HeldFrame | None = None
    carries: bool = False
    waiting: Waiting | None = None


@dataclass(frozen=True)
class ToolOnManifold:
    """Where the tool is.

    Attributes:
        projector: What finds it.
        desired_reference: Reference of the virtual output, before it yields to forces; None where
            forces alone lead the tool.
        believed: What is believed of the robot and of how well its motion is known.
        predictor: What foretells ``joint_state``, if anything does.
        signals: ``joint_state``, ``tool_pose``, ``manifold_point``; of progress that waits
            ``clock`` and ``watch``.
        world_pose: ``[y_t, R_e by rows]`` in the world, also where ``tool_pose`` is in a frame.
        stream: What makes the path, where its way points come while the tool moves.
        pen: Where way points enter that a person draws, if one does.
    """

    projector: BlockSystem
    desired_reference: OutputPort | None
    believed: Believed
    predictor: BlockSystem | None
    signals: dict[str, OutputPort]
    world_pose: OutputPort
    stream: Stream | None = None
    pen: OperatorPanel | None = None


def add_place(
    builder: DiagramBuilder,
    following: Following,
    joint_state: OutputPort,
    override: OutputPort | None = None,
    obstacles: OutputPort | None = None,
) -> ToolOnManifold:
    """Add what finds the tool's place on the manifold.

    Args:
        builder: Builder of the diagram.
        following: What the robot is to do.
        joint_state: ``[q_J, v_J, q_M, v_M]`` as measured.
        override: Share of its planned pace at which the reference moves, if that may change.
        obstacles: What is measured of obstacles, if progress waits for them.

    Raises:
        InputError: If compliance and law do not go together.
    """
    task, linearization = following.task, following.law.linearization
    options, period = following.options, following.options.controller.sampling_time
    believed = believed_robot(following.robot, options.encoders, period, following.friction)
    joint_state, believed, predictor = add_prediction(
        builder, believed, options.controller, joint_state
    )
    kinematics = builder.AddNamedSystem(
        "tool_kinematics",
        BlockSystem(ToolKinematics(following.robot, following.on_motors), period),
    )
    tool_pose, desired = kinematics.GetOutputPort("tool_pose"), None
    m, waits = linearization.num_outputs, dict[str, OutputPort]()
    stream: Stream | None = None
    pen: OperatorPanel | None = None
    if isinstance(task, StreamTask):
        order = reference_order(options.compliance, linearization)
        place = task.add_place(builder, tool_pose, None, period)
        stream = add_stream(builder, task.path, place.projector, order, m, period)
        pen = task.add_source(builder, stream, period)
        desired = _swung(builder, following, stream.reference, order)
    else:
        if following.waiting is not None and obstacles is not None:
            told = {"joint_state": joint_state, "obstacles_measured": obstacles}
            told |= {} if override is None else {"override": override}
            waits = add_waiting_reference(builder, following.waiting, task, m, period, told)
            desired = waits.pop("reference")
        elif not isinstance(task, SpaceTask):
            order = reference_order(options.compliance, linearization)
            timed = TimedReference(task.motion, order, m, period)
            generator = builder.AddNamedSystem("reference_generator", BlockSystem(timed, period))
            if override is not None:
                builder.Connect(override, generator.GetInputPort("override"))
            desired = _swung(builder, following, generator.GetOutputPort("reference"), order)
        if following.held is None:
            place = task.add_place(builder, tool_pose, desired, period)
        else:
            place, tool_pose = following.held.add_place(builder, task, tool_pose, desired, period)
    builder.Connect(joint_state, kinematics.GetInputPort("joint_state"))
    signals = {
        "joint_state": joint_state,
        "tool_pose": tool_pose,
        "manifold_point": place.manifold_point,
        **waits,
    }
    if stream is not None:
        signals["stream"] = stream.stream
    world_pose = kinematics.GetOutputPort("tool_pose")
    return ToolOnManifold(
        place.projector, desired, believed, predictor, signals, world_pose, stream, pen
    )


def _swung(
    builder: DiagramBuilder, following: Following, desired: OutputPort, order: int
) -> OutputPort:
    """Return the reference on a manifold that moves, if it does."""
    swings, linearization = following.options.swings, following.law.linearization
    if not swings:
        return desired
    manifold, m = linearization.manifold, linearization.num_outputs
    period = following.options.controller.sampling_time
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
    place: ToolOnManifold,
    forces: dict[str, OutputPort],
) -> tuple[FollowingController, dict[str, OutputPort]]:
    """Add the law with its reference, which yields to forces if it is to.

    Args:
        builder: Builder of the diagram.
        following: What the robot is to do.
        place: Where the tool is.
        forces: Forces of ``wrench_ext`` and ``wrench_measured`` what there is.

    Returns:
        The controller, and its signals ``reference``, ``law`` and ``stop_category``; with
        compliance also ``desired_reference`` and ``manifold_force``, with what estimates friction
        ``friction_estimate``, with what observes forces ``tau_ext_observed`` and
        ``wrench_observed``.

    Raises:
        InputError: If compliance, external torques or friction do not suit the law.
    """
    options, law = following.options, following.law
    compliance = options.compliance
    yields = compliance.is_given and compliance.source == "observed"
    controller, signals, made = add_controller(
        builder,
        law,
        place.believed,
        options.controller,
        options.faults,
        place.signals | forces,
        compliance.observed if yields else None,
        place.predictor,
        carries=following.carries,
    )
    made |= {name: controller.GetOutputPort(name) for name in ("law", "stop_category")}
    desired = place.desired_reference
    if desired is None:
        guidance = _add_guidance(builder, following, signals)
        desired = guidance.GetOutputPort("reference")
        told = {name: port for name, port in _GUIDANCE.items() if guidance.HasOutputPort(port)}
        made |= {name: guidance.GetOutputPort(port) for name, port in told.items()}
    task, transition = following.task, options.transition
    allowed = "0 with controller.manifold = trajectory, whose reference is a point that moves"
    steady = transition == 0.0 or not law.linearization.manifold.follows_time
    require(steady, "start.transition", transition, allowed)
    wanted = Wanted(
        following.start,
        transition,
        task.lap,
        task.length,
        task.motion.domain[1],
        options.tuning,
    )
    told = signals | {"desired_reference": desired}
    made |= add_reference(
        builder, controller, law.linearization, following.robot, compliance, wanted, told
    )
    return controller, made


def _add_guidance(
    builder: DiagramBuilder, following: Following, signals: dict[str, OutputPort]
) -> BlockSystem:
    """Add what leads a tool that has no reference of its own."""
    task, compliance, robot = following.task, following.options.compliance, following.robot
    assert isinstance(task, SpaceTask)  # see add_place
    order = reference_order(compliance, following.law.linearization)
    return add_fixture_guidance(
        builder, task.guided, compliance, robot, order, signals, following.start
    )
