"""Everything that acts on the robot."""

from dataclasses import dataclass

from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder

from diagrams.robots.arm import Arm
from diagrams.robots.part import RobotPart
from diagrams.scenario import ForcePulse, HandParameters, HoldBackParameters
from diagrams.scenario.checks import require
from diagrams.surroundings.mounting import Mounting
from diagrams.surroundings.mounting_parts import add_hand, add_mounting
from diagrams.surroundings.operator import Operator, add_live_hand
from diagrams.surroundings.pushes import PushedLinks, add_pushes
from diagrams.tasks.task import StartPoint, Task
from pfsc_drake.blocks.wiring_blocks import Hold, Sum
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.physics.link_forces import LinkHandParameters
from pfsc_drake.physics.scripted_force import DecoupledForce, ForceProfile, ScriptedForce
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.surface_spring import SurfaceSpring


@dataclass(frozen=True)
class Outside:
    """What acts on a robot from outside.

    Attributes:
        forces: Written down beforehand, on the tool and on links.
        hold_back: A wrench that only slows the tool down.
        pushes: Hands that take hold of links.
        hand: An operator's hand on the tool, if there is one.
        has_sensor: Whether forces are measured.
        period: Sampling time of the controller [s].
    """

    forces: list[ForcePulse]
    hold_back: HoldBackParameters
    pushes: list[LinkHandParameters]
    hand: HandParameters | None
    has_sensor: bool
    period: float


def add_surroundings(
    builder: DiagramBuilder,
    part: RobotPart,
    task: Task,
    outside: Outside,
    ports: dict[str, OutputPort],
    start: StartPoint,
    operator: Operator | None = None,
    mounting: Mounting | None = None,
    spring: SurfaceSpring | None = None,
) -> dict[str, OutputPort]:
    """Add forces on the robot, and return their signals for the log.

    Args:
        builder: Builder of the diagram.
        part: The robot.
        task: What it is to do.
        outside: What acts on it.
        ports: ``joint_state``, the true one, ``manifold_point``.
        start: Where the tool starts.
        operator: A person who guides the tool, if there is one.
        mounting: Plates that are mounted, if there are any.
        spring: What the tool touches in place of contact in the plant, if it does.

    Returns:
        ``wrench_ext`` on the tool point, world axes, shape (6,), if anything can act there, what
        :func:`add_pushes` returns of the links and :func:`add_mounting` of plates.

    Raises:
        InputError: If a force does not suit the robot.
    """
    period, joint_state = outside.period, ports["joint_state"]
    sources = _scripted(builder, part, task, outside, ports)
    mounts = mounting is not None and mounting.parameters.operator is not None
    if outside.hand is not None and not mounts:
        sources.append(add_hand(builder, part.robot, task, outside.hand, period, joint_state))
    if operator is not None:
        sources.append(add_live_hand(builder, part.robot, operator, joint_state))
    pushed = PushedLinks(outside.forces, outside.pushes, outside.has_sensor)
    pushes, signals = add_pushes(builder, part, task, pushed, period, ports)
    if mounting is not None:
        wrenches, mounted = add_mounting(
            builder, mounting, part, task, outside.hand, period, start, joint_state
        )
        sources, signals = sources + wrenches, signals | mounted
    acting: list[OutputPort] = []
    held: OutputPort | None = None
    if part.contact is not None:
        # the law's own pose is what encoders make of it, or that of the motors
        view = _add_view(builder, part, period)
        builder.Connect(ports["joint_state"], view.GetInputPort("joint_state"))
        builder.Connect(view.GetOutputPort("tool_pose"), part.contact.GetInputPort("tool_pose"))
        acting.append(part.contact.GetOutputPort("wrench"))
    if sources:
        total = _sum(builder, "wrench", sources, period)
        # held over a tick, so that it is computed once and not in every stage of the integrator
        hold = builder.AddNamedSystem("wrench_hold", BlockSystem(Hold(6), period))
        builder.Connect(total, hold.GetInputPort("value"))
        held = hold.GetOutputPort("held")
        acting.append(held)
    if spring is not None:
        # what is stiff follows the tool within a tick, too
        touching = _add_spring(builder, part, spring, period, ports["joint_state"])
        held = touching if held is None else _sum_in_plant(builder, touching, held)
        acting = [held]
    if pushes is not None and isinstance(part, Arm):
        part.connect_pushes(builder, pushes, held, ports["joint_state"])
    elif held is not None:
        part.connect_wrench(builder, held, ports["joint_state"])
    if acting:
        signals["wrench_ext"] = _sum(builder, "all_wrenches", acting, period)
    return signals


def _add_spring(
    builder: DiagramBuilder,
    part: RobotPart,
    spring: SurfaceSpring,
    period: float,
    joint_state: OutputPort,
) -> OutputPort:
    """Add what the tool touches, and return its wrench on the tool."""
    view = _add_view(builder, part, period)
    builder.Connect(joint_state, view.GetInputPort("joint_state"))
    builder.AddNamedSystem("surface_spring", spring)
    builder.Connect(view.GetOutputPort("tool_pose"), spring.GetInputPort("tool_pose"))
    return spring.GetOutputPort("wrench")


def _add_view(builder: DiagramBuilder, part: RobotPart, period: float) -> BlockSystem:
    """Add what tells where the tool truly is."""
    view = BlockSystem(ToolKinematics(part.robot), period)
    return builder.AddNamedSystem("contact_view", view)


def _scripted(
    builder: DiagramBuilder,
    part: RobotPart,
    task: Task,
    outside: Outside,
    ports: dict[str, OutputPort],
) -> list[OutputPort]:
    """Add the forces on the tool that are written down beforehand."""
    period, sources = outside.period, []
    pulses = [pulse for pulse in outside.forces if not pulse.link]
    if pulses:
        profile = ForceProfile(pulses)
        operator = builder.AddNamedSystem(
            "operator", BlockSystem(ScriptedForce(profile, task.manifold, period), period)
        )
        if profile.needs_manifold:
            builder.Connect(ports["manifold_point"], operator.GetInputPort("manifold_point"))
        sources.append(operator.GetOutputPort("wrench"))
    pulse = outside.hold_back
    if pulse.force != 0.0:
        manifold = task.place
        allowed = "0 unless six axes follow a path with all of its orientation"
        square = len(manifold.coordinates) == part.robot.dimension == 6
        along_path = isinstance(manifold, PathManifold)
        require(square and along_path, "hold_back.force", pulse.force, allowed)
        assert isinstance(manifold, PathManifold)
        shape = (pulse.begin, pulse.end, pulse.ramp, pulse.force)
        brake = builder.AddNamedSystem(
            "hold_back", BlockSystem(DecoupledForce(part.robot, manifold, shape, period), period)
        )
        for name in ("joint_state", "manifold_point"):
            builder.Connect(ports[name], brake.GetInputPort(name))
        sources.append(brake.GetOutputPort("wrench"))
    return sources


def _sum(
    builder: DiagramBuilder, name: str, sources: list[OutputPort], period: float
) -> OutputPort:
    """Return the sum of one wrench or more, by a system of a name if there are several.

    Args:
        builder: Builder of the diagram.
        name: Name of the system.
        sources: The wrenches, each (6,).
        period: Sampling time [s].
    """
    if len(sources) == 1:
        return sources[0]
    total = builder.AddNamedSystem(name, BlockSystem(Sum(len(sources), 6), period))
    for i, source in enumerate(sources):
        builder.Connect(source, total.GetInputPort(f"term_{i}"))
    return total.GetOutputPort("sum")


def _sum_in_plant(builder: DiagramBuilder, *wrenches: OutputPort) -> OutputPort:
    """Return the sum of wrenches that a plant bears within a tick, without Python in between."""
    total = builder.AddNamedSystem("tool_wrench", Adder(len(wrenches), 6))
    for i, wrench in enumerate(wrenches):
        builder.Connect(wrench, total.get_input_port(i))
    return total.get_output_port()
