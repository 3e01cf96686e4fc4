"""One controller in a builder: the systems between the measured joint state and the drives."""

import math

import numpy as np
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from pfsc_drake.blocks.block import Block
from pfsc_drake.control.compliance.tuned_impedance import TuningParameters
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import LAWS
from pfsc_drake.control.law.swing import SwingingManifold, SwingingReference
from pfsc_drake.control.law.timed_reference import StreamedReference, TimedReference
from pfsc_drake.control.law.waiting_reference import WaitingReference
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import ToolKinematics, indices
from pfsc_drake.control.obstacles.elbow_room import ElbowRoom
from pfsc_drake.errors import InputError
from pfsc_drake.following.carried import add_framed_point, add_seen_tool
from pfsc_drake.following.compliance import reference_order
from pfsc_drake.following.controller import add_controller, add_reference
from pfsc_drake.following.fixtures import add_fixture_guidance
from pfsc_drake.following.law import Believed
from pfsc_drake.following.options.follower import FollowerOptions
from pfsc_drake.following.prediction import add_prediction
from pfsc_drake.following.streamed_path import Stream, add_stream
from pfsc_drake.following.task import Task
from pfsc_drake.following.waiting import Waiting, add_waiting
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController

Ports = dict[str, OutputPort]
# outputs of hand guiding, by the names of the controller's
_GUIDANCE = {"guidance": "record", "mode": "mode", "guides": "guides"}


class ControllerAssembly:
    """Systems of one controller, added to a builder in two steps.

    :meth:`add_place` adds projection and reference; between the steps the caller adds what needs
    these, such as forces. :meth:`add_law` adds the law.

    Args:
        builder: Builder of the diagram.
        task: Task of the tool.
        law: Its law.
        believed: Nominal model of the robot.
        options: Options of the controller.
        posture: Joint coordinates at the start, shape (N,) [rad or m].
        waiting: Motion that waits for obstacles, if it does.
        tuning: Response of the impedance to an operator's settings.
        carries: Whether the robot carries something that moves with it.

    Attributes:
        inputs: Input ports without a source so far, by name; all of a name get the same one.
        signals: Ports that have been added, by name: from the first step on ``joint_state``,
            ``tool_pose`` (in the frame of a moving manifold) and ``manifold_point``; of progress
            that waits ``own_time``, ``clock`` and ``watch``; ``stream`` of a path whose waypoints
            come. From the second on those of forces, ``reference``, ``law``, ``stop_category``;
            with compliance ``desired_reference`` and ``manifold_force``; and what else observers
            and guidance report.
        world_pose: ``[y_t, R_e by rows]`` in the world.
        projector: System that finds the closest point.
        stream: Systems of a path whose waypoints come, if it is one.
    """

    world_pose: OutputPort
    projector: BlockSystem
    stream: Stream | None = None

    def __init__(
        self,
        builder: DiagramBuilder,
        task: Task,
        law: FollowingLaw,
        believed: Believed,
        options: FollowerOptions,
        posture: np.ndarray,
        waiting: Waiting | None = None,
        tuning: TuningParameters | None = None,
        *,
        carries: bool = False,
    ) -> None:
        self._builder, self._task, self._law, self._options = builder, task, law, options
        self._believed, self._posture, self._waiting = believed, posture, waiting
        self._tuning, self._carries = tuning or TuningParameters(), carries
        self._period = options.controller.sampling_time
        self._order = reference_order(options.compliance, law.linearization)
        self.inputs: dict[str, list[InputPort]] = {}
        self.signals: Ports = {}

    @property
    def on_motors(self) -> bool:
        """Whether the law acts on the tool pose of the motors, not of the links."""
        return acts_on_motors(self._options.controller.law, self._believed)

    def connect(self, name: str, source: OutputPort) -> None:
        """Connect a source to all open inputs of a name, if there are any.

        Args:
            name: Name in :attr:`inputs`.
            source: The source.
        """
        for port in self.inputs.pop(name, []):
            self._builder.Connect(source, port)

    def add_place(self, joint_state: OutputPort, frame_jet: OutputPort | None = None) -> None:
        """Add projection and reference.

        Args:
            joint_state: ``[q_J, v_J, q_M, v_M]`` as measured.
            frame_jet: Motion of the frame that carries the manifold, derivatives 0..r, if it moves.

        Raises:
            InputError: If delay, motion and manifold do not go together.
        """
        builder, task, period = self._builder, self._task, self._period
        joint_state, self._believed, self._predictor = add_prediction(
            builder, self._believed, self._options.controller, joint_state
        )
        tool = ToolKinematics(self._believed.robot, self.on_motors)
        kinematics = self._add("tool_kinematics", tool)
        builder.Connect(joint_state, kinematics.GetInputPort("joint_state"))
        self.signals["joint_state"] = joint_state
        tool_pose = self.world_pose = kinematics.GetOutputPort("tool_pose")
        self._desired = None
        if task.streamed is None:
            self._desired = self._add_motion()
        order = task.manifold.layout.order
        if frame_jet is not None:
            tool_pose = add_seen_tool(builder, tool_pose, frame_jet, order, period)
        self.projector = self._add(task.projector_name, task.projecting)
        builder.Connect(tool_pose, self.projector.GetInputPort("tool_pose"))
        point = self.projector.GetOutputPort("manifold_point")
        if task.prescribed_point is not None:
            assert self._desired is not None  # time leads the point
            leader = self._add("trajectory_point", task.prescribed_point)
            builder.Connect(self._desired, leader.GetInputPort("reference"))
            point = leader.GetOutputPort("manifold_point")
        if frame_jet is not None:
            point = add_framed_point(builder, task.manifold, point, frame_jet, period)
        if task.streamed is not None:
            m = self._law.linearization.num_outputs
            self.stream = add_stream(builder, task.streamed, self.projector, self._order, m, period)
            self.inputs["waypoints"] = [self.stream.waypoints]
            self.signals["stream"] = self.stream.stream
            self._desired = self._swung(self.stream.reference)
        self.signals |= {"tool_pose": tool_pose, "manifold_point": point}

    def _add(self, name: str, block: Block) -> BlockSystem:
        return self._builder.AddNamedSystem(name, BlockSystem(block, self._period))

    def _add_motion(self) -> OutputPort | None:
        """Add the reference before it complies; None where a hand guides the tool."""
        if self._waiting is not None:
            return self._add_waiting(self._waiting)
        if self._task.guided is not None:
            return None
        motion, m = self._task.motion, self._law.linearization.num_outputs
        assert motion is not None  # else it is guided or streamed
        stream, order = self._options.stream, self._order
        block: TimedReference | StreamedReference
        if stream is None:
            block, ports = TimedReference(motion, order, m, self._period), ["override"]
        else:
            if motion.dimension != 1 or self._options.override:
                raise InputError(
                    "stream: given; must be None on surfaces, which have two coordinates to go "
                    "along, and with an override, in place of which there is the port speed"
                )
            start = float(motion.derivatives(np.array([motion.domain[0]]), 0)[0, 0, 0])
            end = self._task.length if self._task.lap is None else math.inf
            block = StreamedReference(stream, order, m, self._period, start=start, end=end)
            ports = ["goal", "speed"]
        generator = self._add("reference_generator", block)
        self.inputs |= {name: [generator.GetInputPort(name)] for name in ports}
        return self._swung(generator.GetOutputPort("reference"))

    def _add_waiting(self, waiting: Waiting) -> OutputPort:
        motion, m = self._task.motion, self._law.linearization.num_outputs
        assert motion is not None  # as it was planned
        joint_state, builder = self.signals["joint_state"], self._builder
        reference = WaitingReference(motion, waiting.pace, m, self._period)
        generator, watch = add_waiting(builder, reference, waiting, self._period, joint_state)
        self.inputs["obstacles"] = [watch.GetInputPort("obstacles")]
        self.inputs["override"] = [watch.GetInputPort("asked")]
        if waiting.elbow is not None:
            ahead, age = waiting.ahead, waiting.watch.latency
            room = ElbowRoom(ahead.chain, ahead.outline, waiting.shapes, waiting.elbow, age)
            elbow = self._add("elbow_room", room)
            builder.Connect(joint_state, elbow.GetInputPort("joint_state"))
            self.inputs["obstacles"].append(elbow.GetInputPort("obstacles"))
            self.signals["posture_torque"] = elbow.GetOutputPort("torque")
        self.signals |= {name: generator.GetOutputPort(name) for name in ("clock", "own_time")}
        self.signals["watch"] = watch.GetOutputPort("record")
        return generator.GetOutputPort("reference")

    def _swung(self, desired: OutputPort) -> OutputPort:
        """Return the reference on a manifold that oscillates, if it does."""
        swings = self._options.swings
        if not swings:
            return desired
        linearization, order = self._law.linearization, self._order
        m = linearization.num_outputs
        across = indices(linearization.manifold.coordinates, Kind.TRANSVERSAL)
        count = across.stop - across.start
        swinging = SwingingReference(swings, across.start, count, m, order)
        block = SwingingManifold(swinging, (order + 1) * m, self._period)
        system = self._add("swinging_manifold", block)
        self._builder.Connect(desired, system.GetInputPort("desired_reference"))
        return system.GetOutputPort("reference")

    def add_law(self, forces: Ports) -> tuple[FollowingController, Ports]:
        """Add the law with its reference, which complies with forces if it is to.

        Args:
            forces: Ports with forces, of ``wrench_ext``, ``wrench_measured``, ``push_torque``,
                ``wrench_led``, ``impedance_request``, ``region_switches``, .. those that there are;
                of a force sensor ``sensor_fault`` and ``tared``.

        Returns:
            The controller, and what this step has added for the log.

        Raises:
            InputError: If compliance, external torques or friction do not suit the law.
        """
        builder, options, task, law = self._builder, self._options, self._task, self._law
        compliance = options.compliance
        observes = compliance.is_given and compliance.source == "observed"
        controller, signals, made = add_controller(
            builder,
            law,
            self._believed,
            options.controller,
            options.faults,
            self.signals | forces,
            compliance.observed if observes else None,
            self._predictor,
            carries=self._carries,
        )
        made |= {name: controller.GetOutputPort(name) for name in ("law", "stop_category")}
        desired = self._desired
        if desired is None:
            assert task.guided is not None  # else there is a motion
            robot = self._believed.robot
            guidance = add_fixture_guidance(
                builder, task.guided, compliance, robot, self._order, signals, self._posture
            )
            desired = guidance.GetOutputPort("reference")
            for name, port in _GUIDANCE.items():
                if guidance.HasOutputPort(port):
                    made[name] = guidance.GetOutputPort(port)
        made |= add_reference(
            builder,
            controller,
            law.linearization,
            self._believed.robot,
            options,
            task,
            self._posture,
            self._tuning,
            signals | {"desired_reference": desired},
        )
        return controller, made


def acts_on_motors(law: str, believed: Believed) -> bool:
    """Return whether a law acts on the tool pose of the motors, not of the links.

    Args:
        law: Name of the law.
        believed: Nominal model of the robot.
    """
    return LAWS[law].on_motors and not believed.robot.is_rigid
