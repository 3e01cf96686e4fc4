"""A whole controller as one diagram, with the ports that a robot has."""

import copy
import logging
import math
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
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.law.robust_gains import SampledRobot
from pfsc_drake.control.law.timed_reference import StreamedReference, TimedReference
from pfsc_drake.control.manifolds.manifold import PlaceManifold, ToolKinematics
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, frame_size
from pfsc_drake.control.streams.messages import WaypointLayout
from pfsc_drake.errors import InputError, require, require_one_of
from pfsc_drake.following.carried import add_framed_point, add_seen_tool, carried
from pfsc_drake.following.compliance import reference_order
from pfsc_drake.following.controller import add_controller, add_reference
from pfsc_drake.following.fault_description import FaultInstant, FaultScene, describe
from pfsc_drake.following.fixtures import add_fixture_guidance
from pfsc_drake.following.followed import Followed, Wanted
from pfsc_drake.following.law import Believed, make_law, sampled_robot
from pfsc_drake.following.law_warnings import law_warnings, observed_force_warnings
from pfsc_drake.following.options.compliance import ComplianceParameters
from pfsc_drake.following.options.controller import (
    ControllerParameters,
    GainParameters,
    LawGains,
)
from pfsc_drake.following.options.follower import FollowerOptions
from pfsc_drake.following.prediction import add_prediction
from pfsc_drake.following.streamed_path import StreamedPath, add_stream
from pfsc_drake.following.unused_options import refuse_unused
from pfsc_drake.following.waiting import add_waiting_motion
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


class Follower(Diagram):
    """Path or surface following, or guidance by hand, of one arm: all between state and drives.

    All of its systems are blocks of one sampling time: :func:`~pfsc_drake.systems.fuse.fuse` makes
    them one, :meth:`stepper` steps them without Drake. Only where a hand leads through more than
    eight regions one is none, which looks at them in turn.

    Ports:
        plant_state (input): State ``[q, v]`` of the plant; or instead of it
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
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
        self._own, self._moves = followed.manifold, options.frame is not None
        if options.frame is not None:
            followed = carried(followed, _frame_of(options.frame, options.compliance))
        self.followed = followed
        self.start_posture = solve_pose(self.robot, followed.start, near, "start")
        chosen = _with_gains(options.controller, law, options.bandwidth)
        self.period = chosen.sampling_time
        rest = RestPosture(self.start_posture, followed.point)
        self.law = make_law(chosen, self.robot, followed.manifold, lambda: rest, options.faults)
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
        place, on_motors = cast(PlaceManifold, self._own), self._on_motors
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

        return [
            *self.followed.warnings,
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
        builder, law = self._builder, self.law
        linearization = law.linearization
        self._on_motors = on_motors = chosen.law == "rigid" and not self.robot.is_rigid
        joint_state, believed, predictor = add_prediction(
            builder, Believed(self.robot, options.friction), chosen, self._measured(options)
        )
        kinematics = self._add("tool_kinematics", ToolKinematics(self.robot, on_motors))
        builder.Connect(joint_state, kinematics.GetInputPort("joint_state"))
        projector, place = self._place(kinematics.GetOutputPort("tool_pose"))
        ports = {"joint_state": joint_state, "manifold_point": place}
        ports |= self._forces(chosen, options)
        compliance = options.compliance
        yields = compliance.is_given and compliance.source == "observed"
        observed = compliance.observed if yields else None
        controller, signals, _ = add_controller(
            builder, law, believed, chosen, options.faults, ports, observed, predictor
        )
        followed, robot = self.followed, self.robot
        self._controller = controller
        self._signals = ports | {
            "tool_pose": kinematics.GetOutputPort("tool_pose"),
            "law": controller.GetOutputPort("law"),
        }
        if followed.streamed is not None:
            desired, made = self._streamed(followed.streamed, options, projector)
        elif options.obstacles is not None:
            desired, made = self._waiting(chosen.law, options, joint_state)
        else:
            desired, made = self._motion(options, signals)
        motion = followed.motion if options.stream is None else None
        end = math.inf if motion is None else motion.domain[1]
        wanted = Wanted(self.start_posture, options.transition, followed.lap, followed.length, end)
        told = signals | {"desired_reference": desired}
        made |= add_reference(builder, controller, linearization, robot, compliance, wanted, told)
        self._signals |= {name: made[name] for name in _DESCRIBED if name in made}
        drive = controller.GetOutputPort(controller.drive_port)
        builder.ExportOutput(drive, controller.drive_port)
        if self._actuation is not None:
            hold = self._add("hold", Hold(self.robot.dimension))
            builder.Connect(drive, hold.GetInputPort("value"))
            actuation = self._add("actuation", Linear(self._actuation))
            builder.Connect(hold.GetOutputPort("held"), actuation.GetInputPort("vector"))
            builder.ExportOutput(actuation.GetOutputPort("product"), "actuation")
        for name in (
            *("reference", "manifold_force", "limit_force"),
            *("mode", "record", "guides", "stream", "watch"),
        ):
            if name in made:
                builder.ExportOutput(made[name], name)
        builder.ExportOutput(ports["manifold_point"], "manifold_point")
        for name in ("manifold_state", "status", "fault", "stop_category"):
            builder.ExportOutput(controller.GetOutputPort(name), name)

    def _place(self, tool_pose: OutputPort) -> tuple[BlockSystem, OutputPort]:
        """Add what finds the tool's place on the manifold; return it, and the law's point."""
        builder, r = self._builder, self.law.linearization.relative_degree
        frame = None
        if self._moves:
            told = self._add("frame", Collect({"frame_jet": frame_size(r)}))
            builder.ExportInput(told.GetInputPort("frame_jet"), "frame_jet")
            frame = told.GetOutputPort("all")
            tool_pose = add_seen_tool(builder, tool_pose, frame, r, self.period)
        projector = self._add("projector", self.followed.projector)
        builder.Connect(tool_pose, projector.GetInputPort("tool_pose"))
        point = projector.GetOutputPort("manifold_point")
        if frame is not None:
            point = add_framed_point(builder, self._own, point, frame, self.period)
        return projector, point

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

    def _streamed(
        self, path: StreamedPath, options: FollowerOptions, projector: BlockSystem
    ) -> tuple[OutputPort, Ports]:
        """Return the reference along a path of way points that come, and what is told of them."""
        only = "no override and no stream: way points themselves come"
        require(not (options.override or options.stream), "options", "both given", only)
        linearization = self.law.linearization
        order = reference_order(options.compliance, linearization)
        m, builder = linearization.num_outputs, self._builder
        stream = add_stream(builder, path, projector, order, m, self.period)
        builder.ExportInput(stream.waypoints, "waypoints")
        return stream.reference, {"stream": stream.stream}

    def _waiting(
        self, law: str, options: FollowerOptions, joint_state: OutputPort
    ) -> tuple[OutputPort, Ports]:
        """Return the reference that waits for obstacles, and what is told of them."""
        motion = add_waiting_motion(
            self._builder, (self.law, law), self.followed, options, self.start_posture, joint_state
        )
        self._builder.ExportInput(motion.obstacles, "obstacles")
        if options.override:
            self._builder.ExportInput(motion.asked, "override")
        return motion.reference, {"watch": motion.watch}

    def _motion(self, options: FollowerOptions, signals: Ports) -> tuple[OutputPort, Ports]:
        """Return the reference before it yields, and what else is told of it."""
        followed, linearization = self.followed, self.law.linearization
        order = reference_order(options.compliance, linearization)
        if followed.motion is None:
            assert followed.guided is not None
            guidance = add_fixture_guidance(
                self._builder,
                followed.guided,
                options.compliance,
                self.robot,
                order,
                signals,
                self.start_posture,
            )
            names = [name for name in ("mode", "record", "guides") if guidance.HasOutputPort(name)]
            told = {name: guidance.GetOutputPort(name) for name in names}
            return guidance.GetOutputPort("reference"), told
        m, motion, stream = linearization.num_outputs, followed.motion, options.stream
        block: TimedReference | StreamedReference
        if stream is None:
            block = TimedReference(motion, order, m, self.period)
            ports = ["override"] if options.override else []
        else:
            if motion.dimension != 1 or options.override:
                raise InputError(
                    "stream: given; must be None on surfaces, which have two coordinates to go "
                    "along, and with an override, in place of which there is the port speed"
                )
            start = float(motion.derivatives(np.array([motion.domain[0]]), 0)[0, 0, 0])
            end = followed.length if followed.lap is None else math.inf
            block = StreamedReference(stream, order, m, self.period, start=start, end=end)
            ports = ["goal", "speed"]
        reference = self._add("reference", block)
        for name in ports:
            self._builder.ExportInput(reference.GetInputPort(name), name)
        return reference.GetOutputPort("reference"), {}


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
