"""What acts on links of the robot, beside its tool."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.arm import Arm, CoupledArm
from diagrams.robots.part import RobotPart
from diagrams.scenario import ForcePulse
from diagrams.tasks.task import Task
from pfsc_drake.blocks.wiring_blocks import Collect, Hold, Rows
from pfsc_drake.errors import InputError
from pfsc_drake.physics.link_forces import LinkForces, LinkHand, LinkHandParameters
from pfsc_drake.physics.scripted_force import ForceProfile, ScriptedForce
from pfsc_drake.robot.serial.link_places import LinkPlace, place_on_link
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.plants.external_forces import LinkPushes


@dataclass
class _Push:
    """What acts at one point of a link: pulses, or a hand."""

    place: LinkPlace
    pulses: list[ForcePulse]
    hand: LinkHandParameters | None = None


@dataclass(frozen=True)
class PushedLinks:
    """What acts on links of a robot.

    Attributes:
        forces: Written down beforehand; those without a link act on the tool.
        hands: Hands that take hold of links.
        has_sensor: Whether forces on the tool are measured.
    """

    forces: list[ForcePulse]
    hands: list[LinkHandParameters]
    has_sensor: bool


def add_pushes(
    builder: DiagramBuilder,
    part: RobotPart,
    task: Task,
    pushed: PushedLinks,
    period: float,
    ports: dict[str, OutputPort],
) -> tuple[LinkPushes | None, dict[str, OutputPort]]:
    """Add forces on links of the robot, by scripts and by hands.

    Args:
        builder: Builder of the diagram.
        part: The robot.
        task: What it is to do, for the axes of its manifold.
        pushed: What acts on them.
        period: Sampling time [s].
        ports: ``joint_state``, the true one, ``manifold_point``.

    Returns:
        What is to be applied to the robot's plant, or None if nothing is; and for the log and
        the law ``push_wrench`` of shape (6K,), ``push_point`` of shape (3K,) and ``push_torque``
        of shape (N,).

    Raises:
        InputError: If the robot has no such link, or its links cannot be pushed.
    """
    found = _pushes(part, pushed)
    if not found or not isinstance(part, Arm):
        return None, {}
    system = LinkPushes(part.robot, [push.place for push in found])
    builder.AddNamedSystem("link_pushes", system)
    size = len(found)
    told = LinkForces(part.robot, [(push.place.link, push.place.p_LQ) for push in found])
    forces = builder.AddNamedSystem("link_forces", BlockSystem(told, period))
    points = forces.GetOutputPort("points")
    collect = Collect({f"wrench_{k + 1}": 6 for k in range(size)})
    wrenches = builder.AddNamedSystem("link_wrenches", BlockSystem(collect, period))
    # held over a tick, so that bodies and joints bear the same, and the integrator sees no more
    hold = builder.AddNamedSystem("push_hold", BlockSystem(Hold(6 * size), period))
    builder.Connect(wrenches.GetOutputPort("all"), hold.GetInputPort("value"))
    for bearing in (system, forces):
        builder.Connect(ports["joint_state"], bearing.GetInputPort("joint_state"))
        builder.Connect(hold.GetOutputPort("held"), bearing.GetInputPort("wrenches"))
    for k, push in enumerate(found):
        if push.hand is not None:
            source = builder.AddNamedSystem(
                f"link_hand_{k + 1}", BlockSystem(LinkHand(push.hand, period), period)
            )
            own = Rows(3 * size, range(3 * k, 3 * k + 3))
            point = builder.AddNamedSystem(f"pushed_point_{k + 1}", BlockSystem(own, period))
            builder.Connect(points, point.GetInputPort("whole"))
            builder.Connect(point.GetOutputPort("part"), source.GetInputPort("point"))
        else:
            profile = ForceProfile(push.pulses)
            source = builder.AddNamedSystem(
                f"link_script_{k + 1}",
                BlockSystem(ScriptedForce(profile, task.manifold, period), period),
            )
            if profile.needs_manifold:
                builder.Connect(ports["manifold_point"], source.GetInputPort("manifold_point"))
        builder.Connect(source.GetOutputPort("wrench"), wrenches.GetInputPort(f"wrench_{k + 1}"))
    return system, {
        "push_wrench": hold.GetOutputPort("held"),
        "push_point": points,
        "push_torque": forces.GetOutputPort("tau_ext"),
    }


def _pushes(part: RobotPart, pushed: PushedLinks) -> list[_Push]:
    """Return what acts on links, pulses at one point together."""
    scripted: list[_Push] = []
    for i, pulse in enumerate(pushed.forces):
        if not pulse.link:
            continue
        for push in scripted:
            if push.place.name == pulse.link and np.array_equal(push.pulses[0].point, pulse.point):
                push.pulses.append(pulse)
                break
        else:
            place = _place(part, pushed, f"forces[{i}]", pulse.link, pulse.point)
            scripted.append(_Push(place, [pulse]))
    hands = [
        _Push(_place(part, pushed, f"pushes[{i}]", hand.link, hand.point), [], hand)
        for i, hand in enumerate(pushed.hands)
    ]
    return scripted + hands


def _place(
    part: RobotPart, pushed: PushedLinks, where: str, link: str, point: np.ndarray
) -> LinkPlace:
    if not isinstance(part, Arm):
        raise InputError(
            f"{where}.link = '{link}'; allowed: none, this robot is pushed at its tool"
        )
    try:
        place = place_on_link(part.model, part.coordinates, link, point)
    except InputError as error:
        raise InputError(f"{where}.link = {error}") from None
    # what a sensor behind the last joint bears is told for forces on the tool point alone
    last = place.link == part.robot.dimension - 1
    if last and pushed.has_sensor and isinstance(part, CoupledArm):
        raise InputError(
            f"{where}.link = '{link}' with robot.rotor_coupling and a force sensor; allowed: links "
            "before the last, or no link, for the tool point"
        )
    return place
