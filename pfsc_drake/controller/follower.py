"""Controller for a plant of the user: ports of a robot, in the plant's order of joints."""

import copy
import dataclasses as dc
import logging
from collections.abc import Callable

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from pfsc_drake.blocks.wiring_blocks import Hold, Linear
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE
from pfsc_drake.control.streams.messages import WaypointLayout
from pfsc_drake.controller.controller import Controller
from pfsc_drake.controller.fault_description import FaultInstant
from pfsc_drake.controller.moving_start import target_in_world
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.controller_parameters import (
    ControllerParameters,
    GainParameters,
    LawGains,
)
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.options.motion_limits import limits_of
from pfsc_drake.controller.tasks.stream_task import StreamTask
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.controller.unused_options import refuse_unused
from pfsc_drake.errors import InputError, require, require_one_of
from pfsc_drake.geometry.rotation import check_rotation_matrix
from pfsc_drake.robot.inverse_kinematics import middle_posture, solve_pose
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant, state_at_rest

_logger = logging.getLogger("pfsc_drake")


class Follower(Controller):
    """Controller of a robot in a user's plant.

    Ports:
        plant_state (input): State ``[q, v]`` of the plant; with ``measures`` = ``joint_state``
            the input of :class:`Controller` instead.
        actuation (output): Commands in the order of the plant's actuators, held for a sample;
            absent with velocity servos if a joint has no actuator.
        record (output): The same as ``guidance``.

    All others: see :class:`Controller`.

    Args:
        plant: The robot, finalized: its nominal model.
        tool: Name of the frame whose origin follows the manifold.
        law: Name of the law.
        make: ``(robot, posture, r) -> Task``: creates the task for a robot, its initial posture and
            a law of relative degree r.
        options: Options.

    Attributes:
        warnings: Doubts about law, gains, robot and path, one sentence each; logged once, by the
            logger ``pfsc_drake``.

    Raises:
        InputError: If robot, law, manifold and options do not go together, or the start is out of
            reach.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        tool: str,
        law: str,
        make: Callable[[RobotModel, np.ndarray, int], Task],
        options: FollowerOptions,
    ) -> None:
        require_one_of("law", law, RELATIVE_DEGREE)
        require_one_of("measures", options.measures, ("plant_state", "joint_state"))
        if not plant.HasFrameNamed(tool):
            raise InputError(f"tool = {tool}: the plant has no frame of this name")
        robot, self._coordinates = chain_from_plant(plant, plant.GetFrameByName(tool))
        self._chain = robot
        self._actuation = self._rows_of_actuation(plant, law)
        near = _near(robot, options.posture)
        task = make(robot, near, RELATIVE_DEGREE[law])
        refuse_unused(options, law, robot, task)
        if isinstance(task, StreamTask):
            only = "no override and no stream: waypoints are received"
            require(not (options.override or options.stream), "options", "both given", only)
        start = task.start(np.zeros(3))
        target = start.target
        if options.frame is not None:
            frame = _frame_of(options.frame, options.compliance)
            options, target = dc.replace(options, frame=frame), target_in_world(target, frame)
        if options.reference is not None:
            assert task.motion is not None  # as refuse_unused requires
            limits = limits_of(task.motion, options.reference)
            options = dc.replace(options, reference=limits)
        chosen = _with_gains(options.controller, law, options.bandwidth)
        super().__init__(
            task,
            NominalRobot(robot, options.friction),
            dc.replace(options, controller=chosen),
            start,
            solve_pose(robot, target, near, "start"),
        )
        self.set_name(f"{law}_follower")
        self.warnings = self.warn()
        for sentence in self.warnings:
            _logger.warning(sentence)

    @property
    def followed(self) -> Task:
        """Former name of :attr:`task`."""
        return self.task

    @property
    def start_state(self) -> np.ndarray:
        """State ``[q, v]`` of the plant at rest at the start, elastic joints under the weight."""
        return state_at_rest(self._chain, self._coordinates, self.start_posture)

    @property
    def messages(self) -> WaypointLayout:
        """Layout of messages with waypoints.

        Raises:
            InputError: If the path is not streamed.
        """
        if not isinstance(self.task, StreamTask):
            raise InputError("messages: this path is known beforehand; see add_path_streaming")
        return self.task.path.messages

    def describe(self, fault: float | np.ndarray, context: Context | None = None) -> str:
        """Return one sentence on a fault.

        Args:
            fault: Value of the port ``fault``.
            context: Context at the first sample of the fault; with it the sentence names joints,
                values and the position on the manifold, unless the manifold moves.

        Raises:
            InputError: If there is no such fault.
        """
        number = float(np.asarray(fault).item())
        require(number in list(Fault), "fault", number, f"0 to {max(Fault):d}")
        kind, system = Fault(int(number)), self._law_system
        if context is None or kind is Fault.NONE or self.options.frame is not None:
            return kind.explanation

        def value(port: OutputPort) -> np.ndarray:
            return np.array(port.Eval(self.GetSubsystemContext(port.get_system(), context)))

        signals = {name: value(port) for name, port in self._assembly.signals.items()}
        now = FaultInstant(context.get_time(), signals)
        suspects = system.suspects(self.GetSubsystemContext(system, context))
        return self.describe_fault(kind, now, None, suspects)

    def _rows_of_actuation(self, plant: MultibodyPlant, law: str) -> np.ndarray | None:
        """Return the matrix from drives to the plant's actuation; None for servos without motors.

        Raises:
            InputError: If a law commands torques, and a joint has no actuator.
        """
        if RELATIVE_DEGREE[law] == 1 and self._coordinates.undriven:
            return None
        return self._coordinates.actuation_rows(plant.num_actuators())

    def _add_measurement(self) -> OutputPort:
        if self.options.measures == "joint_state":
            return super()._add_measurement()
        measured = self._assembly.add("joint_state", Linear(self._coordinates.rows))
        self._assembly.inputs["plant_state"] = [measured.GetInputPort("vector")]
        return measured.GetOutputPort("product")

    def _export(self, builder: DiagramBuilder, *, logged: bool) -> None:
        assembly = self._assembly
        super()._export(builder, logged=logged)
        if "guidance" in assembly.signals:
            builder.ExportOutput(assembly.signals["guidance"], "record")
        if self._actuation is not None:
            hold = assembly.add("hold", Hold(self.robot.dimension), value=assembly.drive)
            actuation = assembly.add(
                "actuation", Linear(self._actuation), vector=hold.GetOutputPort("held")
            )
            builder.ExportOutput(actuation.GetOutputPort("product"), "actuation")


def _near(robot: RobotModel, posture: np.ndarray | None) -> np.ndarray:
    """Return the initial guess of the posture at the start, shape (N,)."""
    if posture is None:
        return middle_posture(robot)
    if np.shape(posture) != (robot.dimension,):
        raise InputError(
            f"posture: {np.size(posture)} values; the robot has {robot.dimension} joints"
        )
    return np.asarray(posture, dtype=float)


def _frame_of(frame: np.ndarray, compliance: ComplianceParameters) -> np.ndarray:
    """Return the pose of a frame, checked."""
    pose = np.asarray(frame, dtype=float)
    if pose.shape != (POSE_SIZE,):
        raise InputError(
            f"frame: shape {pose.shape}; must be [p_WC, R_WC by rows], shape ({POSE_SIZE},)"
        )
    check_rotation_matrix(pose[3:].reshape(3, 3), "frame")
    if compliance.is_given:
        raise InputError("frame: given; must be None if the tool complies with forces")
    return pose


def _with_gains(options: ControllerParameters, law: str, bandwidth: float) -> ControllerParameters:
    """Return options for a law, with gains by a bandwidth where gains are missing."""
    chosen = copy.deepcopy(options)
    chosen.law = law
    gains = chosen.gains.setdefault(law, LawGains())
    kinds = ["eta", "xi", "phi"]
    if not gains.xi.is_given:  # else the posture has those of xi
        kinds.append("posture")
    for kind in kinds:
        if not getattr(gains, kind).is_given:
            setattr(gains, kind, GainParameters(bandwidth=bandwidth))
    return chosen
