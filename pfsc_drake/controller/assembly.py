"""Assembly of one controller: its systems between the measured joint state and the drives."""

import math

import numpy as np
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Collect, Constant
from pfsc_drake.control.compliance.measured_wrench import MeasuredWrench
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import LAWS
from pfsc_drake.control.law.reference import SmoothStart
from pfsc_drake.control.law.swing import OscillatingManifold, OscillatingReference
from pfsc_drake.control.law.timed_reference import StreamedReference, TimedReference
from pfsc_drake.control.law.waiting_reference import WaitingReference
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import ToolKinematics, indices
from pfsc_drake.control.manifolds.moving_frame import frame_size
from pfsc_drake.control.planning.joint_trajectory import TrajectoryStart
from pfsc_drake.controller.compliance import add_compliance, has_impedance, reference_order
from pfsc_drake.controller.fixtures import add_fixture_guidance
from pfsc_drake.controller.free_posture import add_posture_reference
from pfsc_drake.controller.friction_compensation import add_friction_compensation, rest_hold
from pfsc_drake.controller.law import supervision
from pfsc_drake.controller.link_state import LinkEstimate, add_links
from pfsc_drake.controller.moving_start import add_framed_point, add_relative_tool
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.observed_forces import add_external_torque, add_observed_forces
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.planning.motion_demand import MotionDemand
from pfsc_drake.controller.planning.planned_frame import planned_frame
from pfsc_drake.controller.prediction import add_prediction, connect_predictor
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.controller.tasks.stream_task import StreamTask
from pfsc_drake.controller.tasks.streamed_path import add_stream
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.controller.waiting import Waiting, add_waiting
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController

# signals that stop the robot, in the order of the port for them
_ALARMS = ("sensor_fault", "tared", "compliance_status", "press_lost")
# observed signals, and outputs of hand guiding by name of the controller's output
_OBSERVED = ("tau_ext_observed", "wrench_observed")
_GUIDANCE = {"guidance": "record", "mode": "mode", "guides": "guides"}


class Assembly:
    """Builder of the diagram of one controller.

    Args:
        builder: Builder of the controller's diagram.
        task: Task of the tool.
        law: Law.
        nominal: Nominal model of the robot.
        options: Options; the controller's law is the one of ``law``.
        start: Start of the robot.
        waiting: Motion that waits for obstacles, if there is one.

    Attributes:
        inputs: Input ports of the controller: all ports of a name get the same signal.
        signals: Output ports of its systems, by name.
        outputs: Names of the logged signals.
        public: Names of further outputs of the controller.
        controller: Law with supervision.
    """

    controller: FollowingController

    def __init__(
        self,
        builder: DiagramBuilder,
        task: Task,
        law: FollowingLaw,
        nominal: NominalRobot,
        options: FollowerOptions,
        start: TrajectoryStart,
        waiting: Waiting | None = None,
    ) -> None:
        self.builder, self.task, self.law, self.options = builder, task, law, options
        self.nominal, self.posture, self._waiting = nominal, start.q_J, waiting
        self._start = start
        self.period = options.controller.sampling_time
        self.on_motors = acts_on_motors(options.controller.law, nominal)
        self._order = reference_order(options.compliance, law.linearization)
        self.inputs: dict[str, list[InputPort]] = {}
        self.signals: dict[str, OutputPort] = {}
        self.outputs: list[str] = []
        self.public: list[str] = []

    def add(self, name: str, block: Block, **sources: OutputPort) -> BlockSystem:
        """Add a block, and return its system.

        Args:
            name: Name of the system.
            block: The block.
            sources: Sources of its inputs by name; other inputs stay open.
        """
        system = self.builder.AddNamedSystem(name, BlockSystem(block, self.period))
        for port, source in sources.items():
            self.builder.Connect(source, system.GetInputPort(port))
        return system

    def show(self, **signals: OutputPort) -> None:
        """Add signals by name, and log them.

        Args:
            signals: Signals by name.
        """
        self.signals |= signals
        self.outputs += [name for name in signals if name not in self.outputs]

    def open(self, name: str, size: int) -> OutputPort:
        """Add an input of the controller, and return its signal.

        Args:
            name: Name of the input.
            size: Size of the signal.
        """
        collect = self.add(f"{name}_input", Collect({name: size}))
        self.inputs[name] = [collect.GetInputPort(name)]
        return collect.GetOutputPort("all")

    def build(self, measured: OutputPort) -> None:
        """Add all systems.

        Args:
            measured: ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).

        Raises:
            InputError: If options, law and task are incompatible.
        """
        links = self._links(measured)
        self._measured = measured
        self.signals["found_state"] = links.joint_state
        self._add_projection(links.joint_state)
        self._add_forces()
        for extension in self.options.extensions:
            extension.before_law(self)
        self._add_law()
        self._add_reference()
        for extension in self.options.extensions:
            extension.after_law(self)
        self.show(**links.signals)
        if links.drive_torque is not None:
            self.builder.Connect(self.drive, links.drive_torque)

    def planned_frame(self, placement: np.ndarray) -> PiecewisePolynomialCurve:
        """Return the planned motion of the tool frame over time, see :func:`planned_frame`.

        Args:
            placement: Nominal pose of the base relative to the model's, ``[p, R by rows]``, (12,).

        Raises:
            InputError: If the joints cannot follow the motion.
        """
        assert self.task.motion is not None  # of a workpiece robot
        known = self.task, self.law, self._start, self.nominal.friction
        return planned_frame(MotionDemand(self.options, *known), self.task.motion, placement)

    @property
    def estimates_state(self) -> bool:
        """Whether the law gets an estimated joint state."""
        return self.signals["joint_state"] is not self._measured

    @property
    def drive(self) -> OutputPort:
        """Commands to the drives."""
        return self.controller.GetOutputPort(self.controller.drive_port)

    def _links(self, measured: OutputPort) -> LinkEstimate:
        """Return the joint state for the law; its links' side is estimated if not measured."""
        chosen, torque = self.options.controller, None
        if chosen.state == "measured" or self.nominal.robot.is_rigid:
            return LinkEstimate(measured)
        if chosen.state == "from_torque":
            torque = self.open("joint_torque", self.nominal.robot.dimension)
        known = self.posture, self.nominal.friction, torque, self.nominal.motors
        return add_links(self.builder, self.nominal.robot, chosen, measured, *known)

    def _add_projection(self, joint_state: OutputPort) -> None:
        """Add projection and reference."""
        builder, task, period = self.builder, self.task, self.period
        joint_state, self.nominal, self._predictor = add_prediction(
            builder, self.nominal, self.options.controller, joint_state
        )
        tool = ToolKinematics(self.nominal.robot, self.on_motors)
        kinematics = self.add("tool_kinematics", tool, joint_state=joint_state)
        tool_pose = kinematics.GetOutputPort("tool_pose")
        self.show(joint_state=joint_state)
        self.signals["world_pose"] = tool_pose
        order, frame_jet = task.manifold.layout.order, None
        desired = self._add_motion()
        if self.options.frame is not None:
            for extension in self.options.extensions:
                extension.before_projection(self)
            frame_jet = self.signals.get("frame_jet") or self.open("frame_jet", frame_size(order))
            tool_pose = add_relative_tool(builder, tool_pose, frame_jet, order, period)
        projector = self.add(task.projector_name, task.projection_block, tool_pose=tool_pose)
        point = self.signals["closest_point"] = projector.GetOutputPort("manifold_point")
        if task.prescribed_point is not None:
            assert desired is not None  # time prescribes the point
            block = task.prescribed_point
            prescribed = self.add("trajectory_point", block, reference=desired)
            point = prescribed.GetOutputPort("manifold_point")
        if frame_jet is not None:
            point = add_framed_point(builder, task.manifold, point, frame_jet, period)
        if isinstance(task, StreamTask):
            m = self.law.linearization.num_outputs
            stream = add_stream(builder, task.path, projector, self._order, m, period)
            self.inputs["waypoints"] = [stream.waypoints]
            self.show(stream=stream.stream)
            self.signals["growing_path"] = stream.path
            desired = self._add_oscillation(stream.reference)
        self._desired = desired
        self.show(tool_pose=tool_pose, manifold_point=point)

    def _add_motion(self) -> OutputPort | None:
        """Add the reference without compliance; None for hand guiding and streamed waypoints."""
        if self._waiting is not None:
            return self._add_waiting(self._waiting)
        task, options = self.task, self.options
        if not task.is_planned:
            return None
        motion, m = task.motion, self.law.linearization.num_outputs
        assert motion is not None  # of a planned task
        if options.stream is None:
            block = TimedReference(motion, self._order, m, self.period)
            generator = self.add("reference_generator", block)
            self._open_override(generator.GetInputPort("override"))
            return self._add_oscillation(generator.GetOutputPort("reference"))
        if motion.dimension != 1 or options.override:
            raise InputError(
                "stream: given; must be None on surfaces, which have two tangential coordinates, "
                "and with an override, in place of which there is the port speed"
            )
        start = float(motion.derivatives(np.array([motion.domain[0]]), 0)[0, 0, 0])
        end = task.length if task.revolution is None else math.inf
        streamed = StreamedReference(
            options.stream, self._order, m, self.period, start=start, end=end
        )
        generator = self.add("reference_generator", streamed)
        self.inputs |= {name: [generator.GetInputPort(name)] for name in ("goal", "speed")}
        return self._add_oscillation(generator.GetOutputPort("reference"))

    def _open_override(self, port: InputPort) -> None:
        if self.options.override:
            self.builder.Connect(self.open("override", 1), port)

    def _add_waiting(self, waiting: Waiting) -> OutputPort:
        motion, m = self.task.motion, self.law.linearization.num_outputs
        assert motion is not None  # of a planned task
        joint_state = self.signals["joint_state"]
        reference = WaitingReference(motion, waiting.scaling, m, self.period)
        generator, watch = add_waiting(self.builder, reference, waiting, self.period, joint_state)
        self.inputs["obstacles"] = [watch.GetInputPort("obstacles")]
        self._open_override(watch.GetInputPort("requested"))
        if waiting.elbow is not None:
            elbow = self.add("elbow_room", waiting.elbow_clearance, joint_state=joint_state)
            self.inputs["obstacles"].append(elbow.GetInputPort("obstacles"))
            self.show(posture_torque=elbow.GetOutputPort("torque"))
        self.show(**{name: generator.GetOutputPort(name) for name in ("clock", "own_time")})
        self.show(watch=watch.GetOutputPort("record"))
        return generator.GetOutputPort("reference")

    def _add_oscillation(self, desired: OutputPort) -> OutputPort:
        """Return the reference on an oscillating manifold, if the manifold oscillates."""
        swings = self.options.swings
        if not swings:
            return desired
        linearization, order = self.law.linearization, self._order
        m = linearization.num_outputs
        across = indices(linearization.manifold.coordinates, Kind.TRANSVERSAL)
        count = across.stop - across.start
        swinging = OscillatingReference(swings, across.start, count, m, order)
        block = OscillatingManifold(swinging, (order + 1) * m, self.period)
        system = self.add("swinging_manifold", block, desired_reference=desired)
        return system.GetOutputPort("reference")

    def _add_forces(self) -> None:
        """Add inputs of measured or known forces on the tool, and of an operator."""
        options, chosen = self.options, self.options.controller
        source, yields = chosen.external_torque.source, chosen.posture.yields
        sensed = options.compliance.needs_sensor or source == "measured"
        known = source == "known" or yields == "known"
        if options.operator is not None:
            requests = options.operator.requests
            self.signals |= {name: self.open(name, size) for name, size in requests.items()}
        if known and options.known_forces is not None:
            sizes = {"wrench_ext": 6, "push_torque": self.nominal.robot.dimension}
            self.signals |= {name: self.open(name, sizes[name]) for name in options.known_forces}
            known = False
        sensed = sensed and not any(extension.measures for extension in options.extensions)
        if not (sensed or known):
            return
        wrench = self.add("wrench", MeasuredWrench())
        self.inputs["wrench"] = [wrench.GetInputPort("wrench")]
        self.signals |= {name: wrench.GetOutputPort(name) for name in ("sensor_fault", "tared")}
        uses = {"wrench_measured": sensed, "wrench_ext": known}
        measured = wrench.GetOutputPort("measured")
        self.signals |= {name: measured for name, is_used in uses.items() if is_used}

    def _add_law(self) -> None:
        """Add the law, and connect all of its inputs except reference and alarms."""
        builder, law, nominal, options = self.builder, self.law, self.nominal, self.options
        chosen, compliance, signals = options.controller, options.compliance, self.signals
        watched = supervision(chosen.law, options.faults, nominal)
        controller = self.controller = builder.AddNamedSystem(
            "following_controller",
            FollowingController(
                law,
                self.period,
                watched,
                carries=options.carries,
                hold=rest_hold(law, nominal, chosen),
            ),
        )
        observes = compliance.is_given and compliance.source == "observed"
        signals |= add_external_torque(builder, nominal.robot, chosen, controller, signals)
        friction, logged = add_friction_compensation(builder, nominal, chosen, controller, signals)
        if friction is not None:
            signals["friction"] = friction
        if self._predictor is not None:
            connect_predictor(builder, self._predictor, controller, friction)
        tool = compliance.observed if observes else None
        signals |= add_observed_forces(builder, nominal, chosen, tool, controller, signals)
        self.show(**logged, **{name: signals[name] for name in _OBSERVED if name in signals})
        self.show(**add_posture_reference(builder, nominal.robot, chosen, law, controller, signals))
        for name in ("joint_state", "manifold_point"):
            builder.Connect(signals[name], controller.GetInputPort(name))
        if options.stop_request:
            self.inputs["stop_request"] = [controller.GetInputPort("stop_request")]
        if options.carries:
            self.signals["joint_jet"] = controller.GetOutputPort("joint_jet")
            self.public.append("joint_jet")
        self.show(**{name: controller.GetOutputPort(name) for name in ("law", "stop_category")})

    def _add_reference(self) -> None:
        """Connect reference and alarms of the law."""
        builder, options, task = self.builder, self.options, self.task
        linearization, robot, desired = self.law.linearization, self.nominal.robot, self._desired
        if desired is None:
            assert isinstance(task, SpaceTask)  # else there is a motion
            known = options.compliance, robot, self._order, self.signals, self.posture
            guidance = add_fixture_guidance(builder, task, *known)
            desired = guidance.GetOutputPort("reference")
            for name, port in _GUIDANCE.items():
                if guidance.HasOutputPort(port):
                    self.show(**{name: guidance.GetOutputPort(port)})
        state = self.controller.GetOutputPort("manifold_state")
        if options.transition > 0.0:
            m = linearization.num_outputs
            smooth = SmoothStart(options.transition, self._order, m, state.size(), self.period)
            sources = {"desired_reference": desired, "manifold_state": state}
            if "own_time" in self.signals:
                sources["own_time"] = self.signals["own_time"]
            desired = self.add("smooth_start", smooth, **sources).GetOutputPort("reference")
        signals = {"reference": desired}
        if has_impedance(options.compliance, linearization.manifold):
            ports = self.signals | {"desired_reference": desired, "manifold_state": state}
            signals |= add_compliance(
                builder, options, linearization, robot, task, self.posture, ports
            )
        alarms = {name: self.signals[name] for name in _ALARMS if name in self.signals}
        alarms |= {name: signals.pop(name) for name in _ALARMS if name in signals}
        if alarms:
            self._connect_alarms(alarms)
        builder.Connect(signals["reference"], self.controller.GetInputPort("reference"))
        self.show(**signals)

    def _connect_alarms(self, alarms: dict[str, OutputPort]) -> None:
        """Stop the robot for faults of the force sensor and of the compliance."""
        for name in _ALARMS:
            if name not in alarms:
                none = self.add(f"no_{name}", Constant([0.0]))
                alarms[name] = none.GetOutputPort("value")
        collected = self.add("alarms", Collect(dict.fromkeys(_ALARMS, 1)), **alarms)
        self.builder.Connect(collected.GetOutputPort("all"), self.controller.GetInputPort("alarms"))


def acts_on_motors(law: str, nominal: NominalRobot) -> bool:
    """Return whether a law acts on the tool pose of the motors, not of the links.

    Args:
        law: Name of the law.
        nominal: Nominal model of the robot.
    """
    return LAWS[law].on_motors and not nominal.robot.is_rigid
