"""Forces on the robot, at its tool and on its links."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder

from diagrams.environment.mounting import Mounting
from diagrams.environment.mounting_parts import add_gripper, add_hand, add_mounting_hand
from diagrams.environment.operator import Operator, add_live_hand
from diagrams.robots.arm import Arm, CoupledArm
from diagrams.robots.part import RobotPart
from diagrams.scenario import ForcePulse, HandParameters, HoldBackParameters
from pfsc_drake.blocks.wiring_blocks import Collect, Hold, Rows, Sum
from pfsc_drake.checks import require
from pfsc_drake.control.manifolds.manifold import Manifold, ToolKinematics
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError
from pfsc_drake.physics.link_forces import LinkForces, LinkHand, LinkHandParameters
from pfsc_drake.physics.scripted_force import DecoupledForce, ForceProfile, ScriptedForce
from pfsc_drake.robot.serial.link_points import LinkPoint, point_on_link
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.surface_spring import SurfaceSpring
from pfsc_drake.systems.plants.applied_wrenches import LinkPushes


@dataclass(frozen=True)
class Outside:
    """External forces on a robot.

    Attributes:
        forces: Scripted forces, on the tool and on links.
        hold_back: A wrench that only slows the tool down.
        pushes: Hands that hold and push links.
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

    @property
    def on_links(self) -> bool:
        """Whether there are forces on links."""
        return bool(self.pushes) or any(pulse.link for pulse in self.forces)

    @property
    def on_tool(self) -> bool:
        """Whether there are forces on the tool."""
        pulses = any(not pulse.link for pulse in self.forces)
        return pulses or self.hold_back.force != 0.0 or self.hand is not None


@dataclass(frozen=True)
class Environment:
    """Environment of a robot: forces at its tool and on its links.

    Attributes:
        part: The robot.
        task: Its task.
        manifold: Manifold of ``manifold_point``.
        outside: External forces.
        start: Start of the tool.
        has_operator: Whether a person guides the tool.
        mounting: Plates that are mounted, if there are any.
        spring: Spring that replaces contact in the plant, if there is one.
    """

    part: RobotPart
    task: Task
    manifold: Manifold
    outside: Outside
    start: StartPoint
    has_operator: bool = False
    mounting: Mounting | None = None
    spring: SurfaceSpring | None = None

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the existing force signals."""
        acts = (self.mounting, self.spring, self.part.contact)
        on_tool = self.has_operator or self.outside.on_tool or any(acts)
        on_links = self.outside.on_links and isinstance(self.part, Arm)
        return ("wrench_ext",) * on_tool + ("push_torque",) * on_links

    def add(
        self,
        builder: DiagramBuilder,
        ports: dict[str, OutputPort],
        operator: Operator | None = None,
        reaction: BlockSystem | None = None,
    ) -> dict[str, OutputPort]:
        """Add all forces, and return their signals.

        Args:
            builder: Builder of the diagram.
            ports: ``true_state`` of the joints, and ``manifold_point`` for forces along its axes.
            operator: The person who guides the tool, if there is one.
            reaction: Reaction on a workpiece robot; its inputs are connected.

        Returns:
            ``wrench_ext`` on the tool point, world axes, shape (6,), if forces can act there; with
            forces on K links ``push_wrench`` of shape (6K,), ``push_point`` of shape (3K,)
            and ``push_torque`` of shape (N,); with plates the signals of :func:`add_gripper`,
            with an operator ``hand_wrench`` and ``phase``.

        Raises:
            InputError: If a force does not suit the robot, or it has no such link.
        """
        part, outside, period = self.part, self.outside, self.outside.period
        joint_state, mounting = ports["true_state"], self.mounting
        sources = self._scripted(builder, ports)
        mounts = mounting is not None and mounting.parameters.operator is not None
        if outside.hand is not None and not mounts:
            sources.append(
                add_hand(builder, part.robot, self.task, outside.hand, period, joint_state)
            )
        if operator is not None:
            sources.append(add_live_hand(builder, part.robot, operator, joint_state))
        pushes, signals = self._add_pushes(builder, ports)
        if mounting is not None:
            mounted = self._add_mounting(builder, mounting, joint_state)
            wrenches = ("gripper_wrench", "hand_wrench")
            sources += [mounted[name] for name in wrenches if name in mounted]
            signals |= mounted
        acting: list[OutputPort] = []
        applied: OutputPort | None = None
        if part.contact is not None:
            # the law's pose is that of the encoders, or of the motors
            view = self._add_view(builder, joint_state)
            builder.Connect(view, part.contact.GetInputPort("tool_pose"))
            acting.append(part.contact.GetOutputPort("wrench"))
        if sources:
            total = _sum(builder, "wrench", sources, period)
            # held over a sample, so that it is computed once and not in every stage of the
            # integrator
            hold = builder.AddNamedSystem("wrench_hold", BlockSystem(Hold(6), period))
            builder.Connect(total, hold.GetInputPort("value"))
            applied = hold.GetOutputPort("held")
            acting.append(applied)
            if reaction is not None:
                builder.Connect(total, reaction.GetInputPort("wrench"))
                builder.Connect(
                    self._add_view(builder, joint_state), reaction.GetInputPort("tool_pose")
                )
        if self.spring is not None:
            # the force of a stiff spring varies within a sample
            builder.AddNamedSystem("surface_spring", self.spring)
            pose = self._add_view(builder, joint_state)
            builder.Connect(pose, self.spring.GetInputPort("tool_pose"))
            touching = self.spring.GetOutputPort("wrench")
            applied = touching if applied is None else _sum_in_plant(builder, touching, applied)
            acting = [applied]
        if pushes is not None and isinstance(part, Arm):
            part.connect_pushes(builder, pushes, applied, joint_state)
        elif applied is not None:
            part.connect_wrench(builder, applied, joint_state)
        if acting:
            signals["wrench_ext"] = _sum(builder, "all_wrenches", acting, period)
        return signals

    def _add_view(self, builder: DiagramBuilder, joint_state: OutputPort) -> OutputPort:
        """Return the actual pose of the tool."""
        view = BlockSystem(ToolKinematics(self.part.robot), self.outside.period)
        builder.AddNamedSystem("contact_view", view)
        builder.Connect(joint_state, view.GetInputPort("joint_state"))
        return view.GetOutputPort("tool_pose")

    def _add_mounting(
        self, builder: DiagramBuilder, mounting: Mounting, joint_state: OutputPort
    ) -> dict[str, OutputPort]:
        """Add plates, gripper and operator, and return their signals."""
        part, period = self.part, self.outside.period
        gripper, signals = add_gripper(builder, mounting, part, self.start, period, joint_state)
        if mounting.parameters.operator is None:
            return signals
        parameters = self.outside.hand
        assert parameters is not None  # an operator who mounts has a hand
        hand = add_mounting_hand(
            builder, mounting, part.robot, self.task, parameters, period, joint_state
        )
        builder.Connect(signals["held"], hand.GetInputPort("held"))
        builder.Connect(hand.GetOutputPort("vacuum"), gripper.GetInputPort("vacuum"))
        hand_signals = {
            "hand_wrench": hand.GetOutputPort("wrench"),
            "phase": hand.GetOutputPort("phase"),
        }
        return signals | hand_signals

    def _scripted(self, builder: DiagramBuilder, ports: dict[str, OutputPort]) -> list[OutputPort]:
        """Add the scripted forces on the tool."""
        outside, period, sources = self.outside, self.outside.period, []
        pulses = [pulse for pulse in outside.forces if not pulse.link]
        if pulses:
            operator = self._add_script(builder, "operator", pulses, ports)
            sources.append(operator.GetOutputPort("wrench"))
        pulse = outside.hold_back
        if pulse.force != 0.0:
            manifold = self.task.projected_manifold
            allowed = "0 unless six axes follow a path with all of its orientation"
            square = len(manifold.coordinates) == self.part.robot.dimension == 6
            along_path = isinstance(manifold, PathManifold)
            require(square and along_path, "hold_back.force", pulse.force, allowed)
            assert isinstance(manifold, PathManifold)
            shape = (pulse.begin, pulse.end, pulse.ramp, pulse.force)
            block = DecoupledForce(self.part.robot, manifold, shape, period)
            brake = builder.AddNamedSystem("hold_back", BlockSystem(block, period))
            builder.Connect(ports["true_state"], brake.GetInputPort("joint_state"))
            builder.Connect(ports["manifold_point"], brake.GetInputPort("manifold_point"))
            sources.append(brake.GetOutputPort("wrench"))
        return sources

    def _add_script(
        self,
        builder: DiagramBuilder,
        name: str,
        pulses: list[ForcePulse],
        ports: dict[str, OutputPort],
    ) -> BlockSystem:
        """Add scripted forces at one point."""
        profile, period = ForceProfile(pulses), self.outside.period
        script = BlockSystem(ScriptedForce(profile, self.manifold, period), period)
        builder.AddNamedSystem(name, script)
        if profile.needs_manifold:
            builder.Connect(ports["manifold_point"], script.GetInputPort("manifold_point"))
        return script

    def _add_pushes(
        self, builder: DiagramBuilder, ports: dict[str, OutputPort]
    ) -> tuple[LinkPushes | None, dict[str, OutputPort]]:
        """Add forces on links, and return the system that applies them, if any, and signals."""
        part, period, found = self.part, self.outside.period, _pushes(self.part, self.outside)
        if not found or not isinstance(part, Arm):
            return None, {}
        system = LinkPushes(part.robot, [push.link_point for push in found])
        builder.AddNamedSystem("link_pushes", system)
        size = len(found)
        pushed = [(push.link_point.link, push.link_point.p_LQ) for push in found]
        link_forces = LinkForces(part.robot, pushed)
        forces = builder.AddNamedSystem("link_forces", BlockSystem(link_forces, period))
        points = forces.GetOutputPort("points")
        collect = Collect({f"wrench_{k + 1}": 6 for k in range(size)})
        wrenches = builder.AddNamedSystem("link_wrenches", BlockSystem(collect, period))
        # held over a sample, so that bodies and joints receive the same, constant forces
        hold = builder.AddNamedSystem("push_hold", BlockSystem(Hold(6 * size), period))
        builder.Connect(wrenches.GetOutputPort("all"), hold.GetInputPort("value"))
        for target in (system, forces):
            builder.Connect(ports["true_state"], target.GetInputPort("joint_state"))
            builder.Connect(hold.GetOutputPort("held"), target.GetInputPort("wrenches"))
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
                source = self._add_script(builder, f"link_script_{k + 1}", push.pulses, ports)
            builder.Connect(
                source.GetOutputPort("wrench"), wrenches.GetInputPort(f"wrench_{k + 1}")
            )
        return system, {
            "push_wrench": hold.GetOutputPort("held"),
            "push_point": points,
            "push_torque": forces.GetOutputPort("tau_ext"),
        }


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
    """Return the sum of wrenches within a tick, by a system of Drake's."""
    total = builder.AddNamedSystem("tool_wrench", Adder(len(wrenches), 6))
    for i, wrench in enumerate(wrenches):
        builder.Connect(wrench, total.get_input_port(i))
    return total.get_output_port()


@dataclass
class _Push:
    """Force at one point of a link, by pulses or by a hand."""

    link_point: LinkPoint
    pulses: list[ForcePulse]
    hand: LinkHandParameters | None = None


def _pushes(part: RobotPart, outside: Outside) -> list[_Push]:
    """Return the forces on links, those of pulses at the same point combined."""
    scripted: list[_Push] = []
    for i, pulse in enumerate(outside.forces):
        if not pulse.link:
            continue
        for push in scripted:
            same = push.link_point.name == pulse.link
            if same and np.array_equal(push.pulses[0].point, pulse.point):
                push.pulses.append(pulse)
                break
        else:
            link_point = _link_point(part, outside, f"forces[{i}]", pulse.link, pulse.point)
            scripted.append(_Push(link_point, [pulse]))
    hands = [
        _Push(_link_point(part, outside, f"pushes[{i}]", hand.link, hand.point), [], hand)
        for i, hand in enumerate(outside.pushes)
    ]
    return scripted + hands


def _link_point(
    part: RobotPart, outside: Outside, where: str, link: str, point: np.ndarray
) -> LinkPoint:
    if not isinstance(part, Arm):
        raise InputError(
            f"{where}.link = '{link}'; allowed: none, this robot is pushed at its tool"
        )
    try:
        link_point = point_on_link(part.model, part.coordinates, link, point)
    except InputError as error:
        raise InputError(f"{where}.link = {error}") from None
    # the load on a sensor behind the last joint is computed for forces on the tool point only
    last = link_point.link == part.robot.dimension - 1
    if last and outside.has_sensor and isinstance(part, CoupledArm):
        raise InputError(
            f"{where}.link = '{link}' with robot.rotor_coupling and a force sensor; allowed: links "
            "before the last, or no link, for the tool point"
        )
    return link_point
