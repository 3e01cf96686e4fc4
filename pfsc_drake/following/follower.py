"""A whole controller as one diagram, with the ports that a robot has."""

import copy
import dataclasses as dc
import logging
from collections.abc import Callable
from typing import cast

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.blocks.wiring_blocks import Collect, Hold, Linear
from pfsc_drake.control.compliance.measured_wrench import MeasuredWrench
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.law.robust_gains import SampledRobot
from pfsc_drake.control.manifolds.manifold import PlaceManifold
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, MovingFrameManifold, frame_size
from pfsc_drake.control.planning.course import CourseStart
from pfsc_drake.control.streams.messages import WaypointLayout
from pfsc_drake.errors import InputError, require, require_one_of
from pfsc_drake.following.assembly import ControllerAssembly, acts_on_motors
from pfsc_drake.following.carried import placed, resting_point
from pfsc_drake.following.fault_description import FaultInstant, FaultScene, describe
from pfsc_drake.following.law import Believed, make_law, sampled_robot
from pfsc_drake.following.law_warnings import law_warnings, observed_force_warnings
from pfsc_drake.following.link_state import FoundLinks, add_links
from pfsc_drake.following.options.compliance import ComplianceParameters
from pfsc_drake.following.options.controller import (
    ControllerParameters,
    GainParameters,
    LawGains,
)
from pfsc_drake.following.options.follower import FollowerOptions
from pfsc_drake.following.options.motion import limits_of
from pfsc_drake.following.planning.drive_limits import keep_drive_limits
from pfsc_drake.following.task import Followed
from pfsc_drake.following.unused_options import refuse_unused
from pfsc_drake.following.waiting import plan_waiting
from pfsc_drake.geometry.rotation import check_rotation_matrix
from pfsc_drake.robot.inverse_kinematics import middle_posture, solve_pose
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant, state_at_rest
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import fuse

Ports = dict[str, OutputPort]
_logger = logging.getLogger("pfsc_drake")
# what sentences on faults tell of besides
_DESCRIBED = ("reference", "manifold_force", "press")
# names of outputs, and of what they put out
_OUTPUTS = {name: name for name in ("reference", "manifold_force", "limit_force", "mode", "guides")}
_OUTPUTS |= {"record": "guidance", "stream": "stream", "watch": "watch"}
_OUTPUTS |= {"manifold_point": "manifold_point"}


class Follower(Diagram):
    """Path or surface following, or guidance by hand, of one arm: all between state and drives.

    All of its systems are blocks of one sampling time: :func:`~pfsc_drake.systems.fuse.fuse` makes
    them one, :meth:`stepper` steps them without Drake. Only where a hand leads through more than
    eight regions one is none, which looks at them in turn.

    Ports:
        plant_state (input): State ``[q, v]`` of the plant; or instead of it
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s]; of
            elastic joints the motors' side alone is read if ``controller.state`` is not
            ``measured``.
        joint_torque (input): With ``controller.state`` = ``from_torque``: torques that are measured
            in elastic joints, shape (N,) [Nm or N].
        override (input, optional): Pace of the motion, shape (1,); see :class:`TimedReference`.
        goal (input): With ``stream``: arc length of the last way point [m], shape (1,), and
        obstacles (input): With ``obstacles``: position and velocity of each as measured, shape
            (6K,) [m, m/s]; what is no number stops the motion.
        speed (input, optional): how fast to go there [m/s]; see :class:`StreamedReference`.
        waypoints (input): On a path of way points that come: a message of the last of them, see
            :func:`~pfsc_drake.add_path_streaming`.
        wrench (input): Force and torque on the tool at the tool point, world axes, shape (6,)
            [N, Nm], the load of the tool itself taken off: where a hand leads the tool, where it
            yields by ``compliance``, and where the law or the posture is told of forces that are
            known or measured. What is no finite number is a fault.
        frame_jet (input): With ``frame``: the motion of the frame that path or surface are in,
            derivatives 0..r of ``[p_WC, R_WC by rows]``, shape (12 (r + 1),) [m, 1, per s, ..].
        drive_torque (output): Drive torques within their limits, shape (N,) [Nm or N]; of velocity
            servos
        velocity_reference (output): Joint velocities, shape (N,) [rad/s or m/s].
        actuation (output): The same in the order of the plant's actuators, held from tick to tick;
            absent with velocity servos if a joint has no actuator.
        reference (output): Derivatives 0..r of the virtual output's reference by rows.
        manifold_force (output): Where it yields: forces along the coordinates, shape (m,) [N, Nm].
        limit_force (output): Where a hand leads it along a manifold: by what forces the robot's
            limits hold it, see :class:`LedMotion`.
        mode, record (output): Where a hand leads it through space, see :class:`FixtureGuidance`.
        watch (output): With ``obstacles``: what is seen of them, ``record`` of ObstacleWatch.
        stream (output): On a path of way points that come: what became of them.
        manifold_state (output): Derivatives 0..r-1 of the virtual output by rows, shape (r m,).
        manifold_point (output): Where on the manifold the tool is.
        status (output): ``[fault, rcond, saturated drives]``, shape (3,).
        fault (output): A :class:`~pfsc_drake.control.law.fault.Fault`, shape (1,).
        stop_category (output): A :class:`~pfsc_drake.control.law.safe_stop.StopCategory`, shape
            (1,): at 0 the robot's brakes are to be closed.

    Args:
        plant: The robot, finalized; as it is believed.
        tool: Name of the frame whose origin follows the manifold.
        law: Name of the law.
        make: ``(robot, posture, r) -> Followed``: what is followed by a law of relative degree r,
            and of a robot from which posture on.
        options: What else is chosen.

    Attributes:
        robot: The robot as a chain of N joints.
        followed: What is followed.
        law: The law.
        period: Sampling time [s].
        start_posture: Joint coordinates at the start, shape (N,) [rad or m].
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
        make: Callable[[RobotModel, np.ndarray, int], Followed],
        options: FollowerOptions,
    ) -> None:
        super().__init__()
        require_one_of("law", law, RELATIVE_DEGREE)
        require(
            options.measures in ("plant_state", "joint_state"),
            "measures",
            options.measures,
            "plant_state, joint_state",
        )
        if not plant.HasFrameNamed(tool):
            raise InputError(f"tool = {tool}: the plant has no frame of this name")
        self.robot, self._coordinates = chain_from_plant(plant, plant.GetFrameByName(tool))
        self._actuation = self._rows_of_actuation(plant, law)
        near = self._near(options.posture)
        followed = make(self.robot, near, RELATIVE_DEGREE[law])
        refuse_unused(options, law, self.robot, followed)
        if followed.streamed is not None:
            only = "no override and no stream: way points themselves come"
            require(not (options.override or options.stream), "options", "both given", only)
        self.followed, self._moves = followed, options.frame is not None
        start, point, manifold = followed.start, followed.point, followed.manifold
        if options.frame is not None:
            frame = _frame_of(options.frame, options.compliance)
            start, point = placed(start, frame), resting_point(point, frame, manifold.layout.order)
            manifold = MovingFrameManifold(manifold)
        self.start_posture = solve_pose(self.robot, start, near, "start")
        chosen = _with_gains(options.controller, law, options.bandwidth)
        self.period = chosen.sampling_time
        rest = RestPosture(self.start_posture, point)
        self.law = make_law(chosen, self.robot, manifold, lambda: rest, options.faults)
        if options.reference is not None:
            begun = CourseStart(self.start_posture, point[followed.place.layout.memory])
            assert followed.motion is not None  # as refuse_unused requires
            limits = limits_of(followed.motion, options.reference)
            known = self.law, begun, options.friction
            keep_drive_limits(limits, chosen, 0.0, followed, *known)
        self._builder = DiagramBuilder()
        self._wire(chosen, options)
        self._builder.BuildInto(self)
        self.set_name(f"{law}_follower")
        self.warnings = self._warnings(chosen, options.compliance, rest)
        for sentence in self.warnings:
            _logger.warning(sentence)

    @property
    def start_state(self) -> np.ndarray:
        """State ``[q, v]`` of the plant at rest at the start; elastic joints carry the weight."""
        return state_at_rest(self.robot, self._coordinates, self.start_posture)

    @property
    def messages(self) -> WaypointLayout:
        """Layout of messages with waypoints.

        Raises:
            InputError: If the path does not come as waypoints.
        """
        if self.followed.streamed is None:
            raise InputError("messages: this path is known beforehand; see add_path_streaming")
        return self.followed.streamed.messages

    def stepper(self, connected: tuple[str, ...] = ()) -> Stepper:
        """Return the controller as something to call at every tick, without Drake.

        ``stepper.step(plant_state=..)["drive_torque"]``; all outputs are in what it returns.

        Args:
            connected: Optional inputs that are given at every tick.
        """
        return Stepper(fuse(self).network, connected)

    def describe(self, fault: float | np.ndarray, context: Context | None = None) -> str:
        """Return one sentence on a fault.

        Args:
            fault: Value of the port ``fault``.
            context: Own context at the sample at which the fault is new; with it the sentence names
                joints, values and the position on the manifold, unless that moves.

        Raises:
            InputError: If there is no such fault.
        """
        number = float(np.asarray(fault).item())
        require(number in list(Fault), "fault", number, f"0 to {max(Fault):d}")
        kind = Fault(int(number))
        if context is None or kind is Fault.NONE or self._moves:
            return kind.explanation

        def value(port: OutputPort) -> np.ndarray:
            return np.array(port.Eval(self.GetSubsystemContext(port.get_system(), context)))

        signals = {name: value(port) for name, port in self._signals.items()}
        now = FaultInstant(context.get_time(), signals)
        suspects = self._controller.suspects(self.GetSubsystemContext(self._controller, context))
        place, on_motors = cast(PlaceManifold, self.followed.manifold), self._on_motors
        scene = FaultScene(self.law, self.robot, place, on_motors, now, None, suspects)
        return describe(kind, scene)

    def _warnings(
        self,
        chosen: ControllerParameters,
        compliance: ComplianceParameters,
        rest: RestPosture,
    ) -> list[str]:
        law, robot = self.law, self.robot
        link_state = np.append(self.start_posture, np.zeros(robot.dimension))

        def sampled() -> SampledRobot:
            return sampled_robot(chosen, robot, law.linearization, rest, law.posture)

        plan = self.followed.drive_plan
        return [
            *self.followed.warnings,
            *([] if plan is None else plan.said),
            *law_warnings(chosen, robot, law, link_state, sampled),
            *observed_force_warnings(compliance, robot, law, rest),
        ]

    def _rows_of_actuation(self, plant: MultibodyPlant, law: str) -> np.ndarray | None:
        """Return the matrix from drives to the plant's actuation; None for servos without motors.

        Raises:
            InputError: If a law commands torques, and a joint has no actuator.
        """
        if RELATIVE_DEGREE[law] == 1 and self._coordinates.undriven:
            return None
        return self._coordinates.actuation_rows(plant.num_actuators())

    def _near(self, posture: np.ndarray | None) -> np.ndarray:
        """Return from where the posture at the start is looked for, shape (N,)."""
        if posture is None:
            return middle_posture(self.robot)
        if np.shape(posture) != (self.robot.dimension,):
            raise InputError(
                f"posture: {np.size(posture)} values; the robot has {self.robot.dimension} joints"
            )
        return np.asarray(posture, dtype=float)

    def _add(self, name: str, block: Block) -> BlockSystem:
        return self._builder.AddNamedSystem(name, BlockSystem(block, self.period))

    def _measured(self, options: FollowerOptions) -> OutputPort:
        """Export what is measured, and return the joint state."""
        if options.measures == "plant_state":
            measured = self._add("joint_state", Linear(self._coordinates.rows))
            self._builder.ExportInput(measured.GetInputPort("vector"), "plant_state")
            return measured.GetOutputPort("product")
        measured = self._add("joint_state", Collect({"measured": 4 * self.robot.dimension}))
        self._builder.ExportInput(measured.GetInputPort("measured"), "joint_state")
        return measured.GetOutputPort("all")

    def _wire(self, chosen: ControllerParameters, options: FollowerOptions) -> None:
        builder, followed = self._builder, self.followed
        wired, waiting = dc.replace(options, controller=chosen), None
        if options.obstacles is not None:
            waiting = plan_waiting(self.law, followed, wired, self.start_posture)
        believed = Believed(self.robot, options.friction)
        self._on_motors = acts_on_motors(chosen.law, believed)
        assembly = ControllerAssembly(
            builder,
            followed,
            self.law,
            believed,
            wired,
            self.start_posture,
            waiting,
        )
        links = self._links(chosen, options)
        assembly.add_place(links.joint_state, self._frame_jet())
        for name, (port, *others) in assembly.inputs.items():
            if name != "override" or options.override:
                builder.ExportInput(port, name)
                for other in others:
                    builder.ConnectInput(name, other)
        forces = self._forces(chosen, options)
        self._controller, made = assembly.add_law(forces)
        self._signals = assembly.signals | forces
        self._signals |= {name: made[name] for name in ("law", *_DESCRIBED) if name in made}
        controller = self._controller
        drive = controller.GetOutputPort(controller.drive_port)
        builder.ExportOutput(drive, controller.drive_port)
        if links.drive_torque is not None:
            builder.Connect(drive, links.drive_torque)
        if self._actuation is not None:
            hold = self._add("hold", Hold(self.robot.dimension))
            builder.Connect(drive, hold.GetInputPort("value"))
            actuation = self._add("actuation", Linear(self._actuation))
            builder.Connect(hold.GetOutputPort("held"), actuation.GetInputPort("vector"))
            builder.ExportOutput(actuation.GetOutputPort("product"), "actuation")
        outputs = assembly.signals | made
        for name, signal in _OUTPUTS.items():
            if signal in outputs:
                builder.ExportOutput(outputs[signal], name)
        for name in ("manifold_state", "status", "fault", "stop_category"):
            builder.ExportOutput(controller.GetOutputPort(name), name)

    def _links(self, chosen: ControllerParameters, options: FollowerOptions) -> FoundLinks:
        """Return the joint state as the law takes it, its links' side found if not measured."""
        measured, torque = self._measured(options), None
        if chosen.state == "measured":
            return FoundLinks(measured)
        if chosen.state == "from_torque":
            sensors = self._add("joint_torque", Collect({"joint_torque": self.robot.dimension}))
            self._builder.ExportInput(sensors.GetInputPort("joint_torque"), "joint_torque")
            torque = sensors.GetOutputPort("all")
        start, friction = self.start_posture, options.friction
        return add_links(self._builder, self.robot, chosen, measured, start, friction, torque)

    def _frame_jet(self) -> OutputPort | None:
        """Export the motion of the frame that carries the manifold, if one does."""
        if not self._moves:
            return None
        size = frame_size(self.law.linearization.relative_degree)
        frame = self._add("frame", Collect({"frame_jet": size}))
        self._builder.ExportInput(frame.GetInputPort("frame_jet"), "frame_jet")
        return frame.GetOutputPort("all")

    def _forces(self, chosen: ControllerParameters, options: FollowerOptions) -> Ports:
        """Export what is known of forces on the tool, and return it by the names of its uses."""
        compliance, source = options.compliance, chosen.external_torque.source
        sensed = compliance.needs_sensor or source == "measured"
        known = source == "known" or chosen.posture.yields == "known"
        if not (sensed or known):
            return {}
        wrench = self._add("wrench", MeasuredWrench())
        self._builder.ExportInput(wrench.GetInputPort("wrench"), "wrench")
        made = {name: wrench.GetOutputPort(name) for name in ("sensor_fault", "tared")}
        measured = wrench.GetOutputPort("measured")
        made |= {"wrench_measured": measured} if sensed else {}
        return made | ({"wrench_ext": measured} if known else {})


def _frame_of(frame: np.ndarray, compliance: ComplianceParameters) -> np.ndarray:
    """Return the pose of a frame, checked."""
    pose = np.asarray(frame, dtype=float)
    if pose.shape != (POSE_SIZE,):
        raise InputError(
            f"frame: shape {pose.shape}; must be [p_WC, R_WC by rows], shape ({POSE_SIZE},)"
        )
    check_rotation_matrix(pose[3:].reshape(3, 3), "frame")
    if compliance.is_given:
        raise InputError("frame: given; must be None where the tool yields to forces")
    return pose


def _with_gains(options: ControllerParameters, law: str, bandwidth: float) -> ControllerParameters:
    """Return options for a law, with gains of a bandwidth where there are none."""
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
