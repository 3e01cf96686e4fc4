"""Joint velocity control with supervision and safe stop, as a Drake diagram."""

import math
from dataclasses import replace

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Constant
from pfsc_drake.control.law.fault import FaultLatch, FaultSwitch
from pfsc_drake.control.law.safe_stop import SafeState, SafeStop
from pfsc_drake.control.law.supervision import DriveWatch, Supervision, SupervisionParameters
from pfsc_drake.physics.velocity_servo import SampledServo, VelocityServoLaw
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FaultAccess


class VelocityServo(Diagram):
    """Controls the joint velocities, ``q' = q'_ref`` (3.48).

    See :class:`VelocityServoLaw` for the law and
    :func:`~pfsc_drake.physics.velocity_servo.servo_gains` for its gains.

    The output is a function of the inputs and the integral part; sample it with a hold of the same
    period in front of the plant. A path controller with a longer period needs a hold of its own in
    front of ``velocity_reference``, whose new value acts one servo period after the tick.

    An input that is not finite, a bus that is silent for too long and, with supervision, a
    measurement that contradicts itself and torques that jump between their limits are faults. The
    first one is latched (:class:`FaultLatch`): from that instant on the servo stops the joints and
    holds them at rest (:class:`SafeStop`), whatever the reference. Only a new initialization leaves
    this state.

    Ports:
        joint_state, velocity_reference, silence (optional) (input): See :class:`SampledServo`.
        drive_torque (output): ``tau_d`` within its limits [Nm or N], shape (N,).
        fault (output): A ``Fault``, shape (1,).
        stop_category (output): A :class:`~pfsc_drake.control.law.safe_stop.StopCategory`.

    Args:
        robot: Nominal model, N joints.
        law: The law; its gains' period is the sampling time.
        safe_state: Parameters of stop and hold; by default without additional damping.
        supervision: Parameters of the supervision of the measurement; no supervision if omitted.
        longest_silence: Longest time without reference [s]; unlimited if infinite.

    Attributes:
        period: Sampling time [s].
        limits: Largest magnitudes of the drive torques [Nm or N], shape (N,).

    Raises:
        InputError: If the law is for another number of joints.
    """

    def __init__(
        self,
        robot: RobotModel,
        law: VelocityServoLaw,
        safe_state: SafeState | None = None,
        supervision: SupervisionParameters | None = None,
        longest_silence: float = math.inf,
    ) -> None:
        super().__init__()
        n = robot.dimension
        self.period, self.limits = law.gains.period, law.limits
        builder = DiagramBuilder()

        def add(name: str, block: Block) -> BlockSystem:
            return builder.AddNamedSystem(name, BlockSystem(block, self.period))

        def connect(source: BlockSystem, output: str, target: BlockSystem, name: str) -> None:
            builder.Connect(source.GetOutputPort(output), target.GetInputPort(name))

        servo = add("servo", SampledServo(robot, law, longest_silence))
        settings = safe_state or SafeState(np.zeros(n))
        stop = add("safe_stop", SafeStop(robot, law.limits, settings, self.period))
        measures, causes = [stop], {"input": servo.GetOutputPort("input_fault")}
        if supervision is None:
            connect(add("no_suspects", Constant(np.zeros(4 * n))), "value", stop, "suspects")
        else:
            watch = add("supervision", Supervision(robot, law.limits, supervision, self.period))
            connect(stop, "ignored", watch, "ignored")
            connect(watch, "suspects", stop, "suspects")
            causes["measurement"] = watch.GetOutputPort("fault")
            measures.append(watch)
            # torques may be at a limit for long, because servos are commanded velocities
            only_turns = replace(supervision, saturation_time=0.0)
            drives = add("drive_watch", DriveWatch(law.limits, only_turns, self.period))
            connect(servo, "drive_torque", drives, "drive")
            causes["drives"] = drives.GetOutputPort("fault")
        causes["bus"] = servo.GetOutputPort("bus_fault")
        # the root cause first
        latch, switch = add("fault_latch", FaultLatch(list(causes))), add("switch", FaultSwitch(n))
        for name, port in causes.items():
            builder.Connect(port, latch.GetInputPort(name))
        fault_inputs = [(servo, "stopping"), (stop, "fault"), (switch, "fault")]
        if supervision is not None:
            fault_inputs.append((drives, "stopping"))
        for system, name in fault_inputs:
            connect(latch, "fault", system, name)
        connect(servo, "drive_torque", switch, "drive")
        connect(stop, "torque", switch, "stop")

        builder.ExportInput(servo.GetInputPort("joint_state"), "joint_state")
        for system in measures:
            builder.ConnectInput("joint_state", system.GetInputPort("joint_state"))
        for name in ("velocity_reference", "silence"):
            builder.ExportInput(servo.GetInputPort(name), name)
        builder.ExportOutput(switch.GetOutputPort("command"), "drive_torque")
        builder.ExportOutput(latch.GetOutputPort("fault"), "fault")
        builder.ExportOutput(stop.GetOutputPort("stop_category"), "stop_category")
        builder.BuildInto(self)


class ServoAccess(FaultAccess):
    """Access to the fault of a diagram's velocity servo, fused or not.

    Args:
        servo: The servo, in a builder under its name.

    Attributes:
        limits: Largest magnitudes of the drive torques [Nm or N], shape (N,).
    """

    def __init__(self, servo: VelocityServo) -> None:
        super().__init__(servo, servo.period)
        self.limits = servo.limits
