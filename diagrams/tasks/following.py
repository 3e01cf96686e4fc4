"""From the joint state to the drive input: what all path following stations share."""

from dataclasses import dataclass

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import PathFollowingScenario
from diagrams.tasks.compliance import add_compliance, reference_order
from diagrams.tasks.external_torque import add_external_torque
from pfsc_drake.control.law.law import PathLaw
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.geometry import Path, PiecewisePolynomialCurve
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.control.path_following_controller import PathFollowingController
from pfsc_drake.systems.control.path_projector import PathProjector
from pfsc_drake.systems.control.reference_generator import ReferenceGenerator
from pfsc_drake.systems.control.tool_kinematics import ToolKinematics
from pfsc_drake.systems.control.trajectory_point import TrajectoryPoint


@dataclass(frozen=True)
class Task:
    """What a robot is to do, and by which law.

    Attributes:
        scenario: The scenario.
        robot: The robot.
        path: The path.
        law: The law.
        progress: Motion along the path.
        on_motors: Whether the law acts on the tool pose of the motors, not of the links.
    """

    scenario: PathFollowingScenario
    robot: RobotModel
    path: Path
    law: PathLaw
    progress: PiecewisePolynomialCurve
    on_motors: bool = False


@dataclass(frozen=True)
class PlaceOnPath:
    """What finds the tool's place on the path.

    Attributes:
        projector: The projector.
        desired_reference: Reference of the virtual output, before it yields to forces.
        signals: ``joint_state``, ``tool_pose``, ``path_point``.
    """

    projector: PathProjector
    desired_reference: OutputPort
    signals: dict[str, OutputPort]


def reference_progress(scenario: PathFollowingScenario) -> PiecewisePolynomialCurve:
    """Return a scenario's motion along its path.

    Args:
        scenario: The scenario.

    Raises:
        InputError: If it is not a motion.
    """
    reference = scenario.reference
    return rest_to_rest(
        reference.points,
        velocity=reference.velocity,
        acceleration=reference.acceleration,
        dwell=reference.dwell,
    )


def add_place_on_path(builder: DiagramBuilder, task: Task, joint_state: OutputPort) -> PlaceOnPath:
    """Add what finds the tool's place on the path.

    Args:
        builder: Builder of the diagram.
        task: What the robot is to do.
        joint_state: ``[q_J, v_J, q_M, v_M]`` as measured.

    Raises:
        InputError: If compliance and law do not go together.
    """
    linearization = task.law.linearization
    degree, num_outputs = linearization.relative_degree, linearization.num_outputs
    kinematics = builder.AddNamedSystem(
        "tool_kinematics", ToolKinematics(task.robot, task.on_motors)
    )
    projector = builder.AddNamedSystem(
        "path_projector", PathProjector(task.path, degree, task.scenario.controller.sampling_time)
    )
    generator = builder.AddNamedSystem(
        "reference_generator",
        ReferenceGenerator(
            task.progress, reference_order(task.scenario, linearization), num_outputs
        ),
    )
    tool_pose, desired = kinematics.GetOutputPort("tool_pose"), generator.GetOutputPort("reference")
    builder.Connect(joint_state, kinematics.GetInputPort("joint_state"))
    builder.Connect(tool_pose, projector.GetInputPort("tool_pose"))
    path_point = projector.GetOutputPort("path_point")
    if linearization.time_driven:
        leader = builder.AddNamedSystem(
            "trajectory_point", TrajectoryPoint(task.path, degree, num_outputs)
        )
        builder.Connect(desired, leader.GetInputPort("reference"))
        path_point = leader.GetOutputPort("path_point")
    signals = {"joint_state": joint_state, "tool_pose": tool_pose, "path_point": path_point}
    return PlaceOnPath(projector, desired, signals)


def add_law(
    builder: DiagramBuilder, task: Task, place: PlaceOnPath, forces: dict[str, OutputPort]
) -> tuple[PathFollowingController, dict[str, OutputPort]]:
    """Add the law with its reference, which yields to forces if it is to.

    Args:
        builder: Builder of the diagram.
        task: What the robot is to do.
        place: Where the tool is.
        forces: Of ``wrench_ext`` and ``wrench_measured`` what there is.

    Returns:
        The controller, and its signals ``reference`` and ``law``; with compliance also
        ``desired_reference`` and ``manifold_force``.

    Raises:
        InputError: If compliance or external torques do not suit the law.
    """
    scenario, signals = task.scenario, place.signals | forces
    controller = builder.AddNamedSystem(
        "path_following_controller",
        PathFollowingController(task.law, scenario.controller.sampling_time),
    )
    made = {"reference": place.desired_reference, "law": controller.GetOutputPort("law")}
    if scenario.compliance.is_given:
        inputs = signals | {
            "desired_reference": place.desired_reference,
            "manifold_state": controller.GetOutputPort("manifold_state"),
        }
        made |= add_compliance(builder, scenario, task.law.linearization, inputs)
    if scenario.controller.external_torque.source != "none":
        add_external_torque(builder, task.robot, scenario, controller, signals)
    builder.Connect(made["reference"], controller.GetInputPort("reference"))
    for name in ("joint_state", "path_point"):
        builder.Connect(signals[name], controller.GetInputPort(name))
    return controller, made
