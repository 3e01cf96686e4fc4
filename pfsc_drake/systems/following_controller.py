"""Manifold following controller with supervision and safe stop, as a Drake diagram."""

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, InputPort, OutputPort

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Constant, Rows
from pfsc_drake.control.compliance.tool_compensation import Alarms
from pfsc_drake.control.law.exact_linearization import ExactLinearization
from pfsc_drake.control.law.fault import Fault, FaultLatch, FaultSwitch
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.joint_jet import JointJet
from pfsc_drake.control.law.rest_hold import RestHold
from pfsc_drake.control.law.safe_stop import SafeStop
from pfsc_drake.control.law.sampled_law import LawReport, SampledLaw
from pfsc_drake.control.law.supervision import DriveWatch, Supervision, SupervisionParameters
from pfsc_drake.systems.block_system import BlockSystem, is_tick
from pfsc_drake.systems.fuse import BlockAccess


class FaultAccess:
    """Access to fault and suspects of a diagram that stops a robot, fused or not.

    Args:
        diagram: Diagram with a ``fault_latch``, a ``safe_stop`` and, if joints are supervised, a
            ``supervision``; in a builder under its name.
        period: Sampling time of its blocks [s].
        path: Names of the enclosing diagrams, each with a dot.

    Attributes:
        name: Name of the diagram, with its path.
        period: Sampling time [s].
    """

    def __init__(self, diagram: Diagram, period: float, path: str = "") -> None:
        self.name, self.period = f"{path}{diagram.get_name()}", period
        self._is_supervised = diagram.HasSubsystemNamed("supervision")

    def fault(self, blocks: BlockAccess, root: Context) -> Fault:
        """Return the latched fault at the last tick, the present instant if it is a tick.

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        latch = f"{self.name}.fault_latch.fault"
        read = blocks.output if is_tick(root.get_time(), self.period) else blocks.state
        return Fault(int(read(root, latch)[0]))

    def suspects(self, blocks: BlockAccess, root: Context) -> np.ndarray:
        """Return which measured values are rejected, nonzero if so, shape (4N,).

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        ignored = blocks.state(root, f"{self.name}.safe_stop.ignored")
        if not (self._is_supervised and is_tick(root.get_time(), self.period)):
            return ignored
        return np.maximum(ignored, blocks.output(root, f"{self.name}.supervision.suspects"))


class FollowingController(Diagram):
    """A following law with supervision of joints and drives, and a safe stop after a fault.

    A :class:`SampledLaw`, with the results of :class:`ExactLinearization`, commands the drives
    until
    there is a fault: its own, one found by :class:`Supervision` or :class:`DriveWatch`, or one of
    the external :class:`Alarms`. The first fault is latched (:class:`FaultLatch`): from then on the
    drives stop the robot and hold it at rest (:class:`SafeStop`), velocity servos get the reference
    zero; only a new initialization leaves this state.

    Ports:
        joint_state, manifold_point, reference, tau_ext (optional), friction_torque (optional),
            posture_reference (input): See :class:`SampledLaw`.
        alarms (input, optional): See :class:`Alarms`.
        drive_torque (output): Drive torques within their limits [Nm or N], shape (N,).
            For velocity servos (r = 1) its name is velocity_reference instead [rad/s or m/s]; the
                attribute ``drive_port`` is its name.
        manifold_state, virtual_input, reference_velocity (output): See :class:`SampledLaw`.
        status (output): ``[fault, rcond, saturated drives]``, shape (3,).
        fault (output): A :class:`Fault`, shape (1,).
        stop_category (output): A :class:`~pfsc_drake.control.law.safe_stop.StopCategory`.
        law (output): All of these, in the order of the law's ``layout``.
        joint_jet (output): If ``carries``, see :class:`JointJet`.

    Args:
        law: The law.
        period: Sampling time [s].
        supervision: Parameters of the supervision of joints and drives; no supervision if omitted.
        carries: Whether the motion of the robot is an output, for parts that move with it.
        hold: Holds the torques of sticking drives; they follow the law if omitted.

    Attributes:
        period: Sampling time [s].
        layout: Layout of the port ``law``.
        relative_degree: ``r`` of the law.
        drive_port: Name of the output port for the drives.
    """

    def __init__(
        self,
        law: FollowingLaw,
        period: float,
        supervision: SupervisionParameters | None = None,
        *,
        carries: bool = False,
        hold: RestHold | None = None,
    ) -> None:
        super().__init__()
        self.period, self.layout = period, law.layout
        self.relative_degree = law.linearization.relative_degree
        commands_torque = self.relative_degree > 1
        self.drive_port = "drive_torque" if commands_torque else "velocity_reference"
        builder = DiagramBuilder()

        def add(name: str, block: Block) -> BlockSystem:
            return builder.AddNamedSystem(name, BlockSystem(block, period))

        def connect(source: OutputPort, *inputs: InputPort) -> None:
            for port in inputs:
                builder.Connect(source, port)

        linear = add("linearization", ExactLinearization(law.linearization))
        sampled = add("law", SampledLaw(law, period, hold))
        connect(linear.GetOutputPort("relation"), sampled.GetInputPort("relation"))
        drive = add("drive", Rows(law.layout.size, range(law.layout.drive.stop)))
        connect(sampled.GetOutputPort("evaluation"), drive.GetInputPort("whole"))
        alarms = add("alarms", Alarms())
        causes = {"input": sampled.GetOutputPort("input_fault")}
        stop = add("safe_stop", SafeStop(law.robot, law.limits, law.safe_state, period))
        measures, stopping = [stop], [sampled]
        if supervision is None:
            nothing = add("no_suspects", Constant(np.zeros(4 * law.robot.dimension)))
            connect(nothing.GetOutputPort("value"), stop.GetInputPort("suspects"))
        else:
            effort = law.limits if commands_torque else law.robot.gather("effort_limit")
            watch = add("supervision", Supervision(law.robot, effort, supervision, period))
            drives = add("drive_watch", DriveWatch(law.limits, supervision, period))
            connect(stop.GetOutputPort("ignored"), watch.GetInputPort("ignored"))
            connect(watch.GetOutputPort("suspects"), stop.GetInputPort("suspects"))
            connect(drive.GetOutputPort("part"), drives.GetInputPort("drive"))
            causes["measurement"] = watch.GetOutputPort("fault")
            causes["drives"] = drives.GetOutputPort("fault")
            measures.append(watch)
            stopping.append(drives)
        causes |= {"alarms": alarms.GetOutputPort("fault"), "law": sampled.GetOutputPort("fault")}
        # the root cause first
        latch = add("fault_latch", FaultLatch(list(causes)))
        unit = "Nm or N" if commands_torque else "rad/s or m/s"
        switch = add("switch", FaultSwitch(law.robot.dimension, unit))
        report = add("report", LawReport(law.layout))
        for name, port in causes.items():
            connect(port, latch.GetInputPort(name))
        fault = latch.GetOutputPort("fault")
        connect(fault, *(system.GetInputPort("fault") for system in (stop, switch, report)))
        connect(fault, *(system.GetInputPort("stopping") for system in stopping))
        connect(drive.GetOutputPort("part"), switch.GetInputPort("drive"))
        if commands_torque:
            connect(stop.GetOutputPort("torque"), switch.GetInputPort("stop"))
        connect(sampled.GetOutputPort("evaluation"), report.GetInputPort("evaluation"))
        connect(switch.GetOutputPort("command"), report.GetInputPort("command"))

        fed = [linear, sampled, *measures, alarms]
        names = [name for system in fed for name in system.network.inputs]
        inside = {"relation", "fault", "stopping", "suspects", "ignored"}
        for name in dict.fromkeys(name for name in names if name not in inside):
            ports = [s.GetInputPort(name) for s in fed if s.HasInputPort(name)]
            builder.ExportInput(ports[0], name)
            for port in ports[1:]:
                builder.ConnectInput(name, port)
        builder.ExportOutput(switch.GetOutputPort("command"), self.drive_port)
        for name in ("manifold_state", "virtual_input", "reference_velocity"):
            if sampled.HasOutputPort(name):
                builder.ExportOutput(sampled.GetOutputPort(name), name)
        builder.ExportOutput(report.GetOutputPort("status"), "status")
        builder.ExportOutput(fault, "fault")
        builder.ExportOutput(stop.GetOutputPort("stop_category"), "stop_category")
        builder.ExportOutput(report.GetOutputPort("law"), "law")
        if carries:
            motion = add("joint_jet", JointJet(law.linearization, law.layout))
            connect(linear.GetOutputPort("relation"), motion.GetInputPort("relation"))
            connect(sampled.GetOutputPort("evaluation"), motion.GetInputPort("evaluation"))
            builder.ExportOutput(motion.GetOutputPort("joint_jet"), "joint_jet")
        builder.BuildInto(self)

    def suspects(self, context: Context) -> np.ndarray:
        """Return which components of the joint state are implausible, nonzero if so, shape (4N,).

        Args:
            context: Own context.
        """
        found = [
            self.GetSubsystemByName(name).GetOutputPort(port)
            for name, port in (("supervision", "suspects"), ("safe_stop", "ignored"))
        ]
        values = [p.Eval(self.GetSubsystemContext(p.get_system(), context)) for p in found]
        return np.maximum(*values)


class ControllerAccess(FaultAccess):
    """Access to a diagram's controller: command and last state, fused or not.

    Args:
        controller: The controller, in a builder under its name.
        path: Names of the enclosing diagrams, each with a dot.

    Attributes:
        drive_port: Name of the output port for the drives.
    """

    def __init__(self, controller: FollowingController, path: str = "") -> None:
        super().__init__(controller, controller.period, path)
        self.drive_port = controller.drive_port

    def drive(self, blocks: BlockAccess, root: Context) -> np.ndarray:
        """Return the command of the drives, shape (N,).

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        return blocks.output(root, f"{self.name}.switch.command")

    def set_last_state(self, blocks: BlockAccess, root: Context, joint_state: np.ndarray) -> None:
        """Set the state of the last tick; earlier comparisons are dropped.

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram.
            joint_state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        """
        blocks.set_state(root, f"{self.name}.safe_stop.last", joint_state)
        if self._is_supervised:
            watch = f"{self.name}.supervision"
            blocks.set_state(root, f"{watch}.last", joint_state)
            for name in ("sums", "unchanged", "unseen"):
                sums = blocks.state(root, f"{watch}.{name}")
                blocks.set_state(root, f"{watch}.{name}", np.zeros(len(sums)))
