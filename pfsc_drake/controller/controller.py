"""Complete controller as one diagram, from the measured state to the commands."""

import dataclasses as dc
from typing import Self

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort

from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.blocks.wiring_blocks import Collect
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.law.robust_gains import SampledRobot
from pfsc_drake.control.manifolds.moving_frame import MovingFrameManifold
from pfsc_drake.control.planning.joint_trajectory import TrajectoryStart
from pfsc_drake.controller.assembly import Assembly
from pfsc_drake.controller.fault_description import FaultInstant, FaultScene, describe
from pfsc_drake.controller.law import make_law, sampled_robot
from pfsc_drake.controller.law_warnings import law_warnings, observed_force_warnings
from pfsc_drake.controller.moving_start import resting_point
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.planning.drive_limits import keep_drive_limits
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.controller.waiting import Waiting, plan_waiting
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.systems.following_controller import ControllerAccess, FollowingController
from pfsc_drake.systems.fuse import network_of

# outputs of every controller beside the commands, and those of some
_ALWAYS = ("manifold_state", "status", "fault", "stop_category")
_PUBLIC = (
    *("reference", "manifold_force", "limit_force", "mode", "guides", "guidance", "stream"),
    *("watch", "manifold_point"),
)


class Controller(Diagram):
    """Path or surface following, or hand guiding, of one robot.

    All of its systems are blocks with one sampling time, so that it can be one function
    (:attr:`network`): stepped without Drake, differentiated, exported as C. The exception is
    guidance through more than eight regions, whose distances are computed in turns.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,) [rad, rad/s or m,
            m/s]; of elastic joints only the motors' side is used unless ``controller.state`` is
            ``measured``.
        joint_torque (input): With ``controller.state`` = ``from_torque``: measured torques in
            elastic joints, shape (N,) [Nm or N].
        override (input): With ``override``: speed scaling of the motion, shape (1,); see
            :class:`TimedReference`.
        goal (input): With ``stream``: arc length of the last waypoint [m], shape (1,), and
        speed (input, optional): speed towards it [m/s]; see :class:`StreamedReference`.
        obstacles (input): With ``obstacles``: position and velocity of each as measured, shape
            (6K,) [m, m/s]; NaN or infinite values stop the motion.
        waypoints (input): On a streamed path: a message with the last waypoints, see
            :func:`~pfsc_drake.add_path_streaming`.
        wrench (input): Force and torque on the tool at the tool point, world axes, shape (6,)
            [N, Nm], without the load of the tool: for hand guiding, compliance, and law or posture
            with known or measured forces. NaN is a fault.
        wrench_ext, push_torque (input): With ``known_forces``.
        impedance_request, regions_on (input): With ``operator``.
        frame_jet (input): With ``frame``: motion of the frame of path or surface,
            derivatives 0..r of ``[p_WC, R_WC by rows]``, shape (12 (r + 1),) [m, 1, per s, ..].
        stop_request (input): With ``stop_request``: any value except 0 stops the robot, shape (1,).
        drive_torque (output): With laws that command torques: drive torques within their limits,
            shape (N,) [Nm or N].
        velocity_reference (output): With ``velocity_servo``: joint velocities, shape (N,) [rad/s or
            m/s].
        reference (output): Derivatives 0..r of the virtual output's reference by rows.
        manifold_force (output): With compliance: forces along the coordinates, shape (m,) [N, Nm].
        limit_force (output): With hand guiding along a manifold: forces by which limits of the
            robot hold the tool, see :class:`GuidedMotion`.
        mode, guides, guidance (output): With hand guiding through space, see
            :class:`FixtureGuidance`.
        watch (output): With ``obstacles``: ``record`` of :class:`ObstacleWatch`.
        stream (output): On a streamed path: status of the stream.
        manifold_state (output): Derivatives 0..r-1 of the virtual output by rows, shape (r m,).
        manifold_point (output): Point of the manifold closest to the tool.
        status (output): ``[fault, rcond, saturated drives]``, shape (3,).
        fault (output): A :class:`~pfsc_drake.control.law.fault.Fault`, shape (1,).
        stop_category (output): A :class:`~pfsc_drake.control.law.safe_stop.StopCategory`, shape
            (1,): at 0 the robot's brakes must close.

    Extensions add ports of their own.

    Args:
        task: Task of the tool; receives its plan, and the motion within the limits of the drives.
        nominal: Nominal model of the robot.
        options: Options.
        start: Start of the tool, in the frame of a manifold that moves.
        posture: Joint coordinates there, shape (N,) [rad or m].
        duration: Duration of the run [s]; 0 for the duration of the motion.
        progress: Receives the fraction done and the name of the step.
        like: A controller of the same task, whose plan of waiting for obstacles is reused.
        logged: Whether all signals are outputs, for a log.

    Attributes:
        task: The task.
        robot: Nominal model of the robot.
        nominal: The same, with friction and properties of its encoders.
        options: The options.
        law: The law.
        rest: Posture and manifold point at the start.
        period: Sampling time [s].
        start_posture: Joint coordinates at the start, shape (N,) [rad or m].
        drive_port: Name of the output with the commands to the drives.
        deviations: Names of the outputs with standard deviations, of links that are not measured.
        estimates_state: Whether the law gets an estimated joint state.
        on_motors: Whether the law acts on the tool pose of the motors, not of the links.
        waiting: Motion that waits for obstacles, if there is one.
        logged: Names of the outputs for a log, if there is one.

    Raises:
        InputError: If options, law, robot and task do not go together.
    """

    def __init__(
        self,
        task: Task,
        nominal: NominalRobot,
        options: FollowerOptions,
        start: StartPoint,
        posture: np.ndarray,
        *,
        duration: float = 0.0,
        progress: Progress | None = None,
        like: Self | None = None,
        logged: bool = False,
    ) -> None:
        super().__init__()
        self._plan(task, nominal, options, start, posture)
        initial = TrajectoryStart(posture, start.projection)
        friction = nominal.friction
        if options.reference is not None:
            known = task, self.law, initial, friction
            keep_drive_limits(options, *known, duration, progress)
        self.waiting: Waiting | None = None if like is None else like.waiting
        if options.obstacles is not None and like is None:
            self.waiting = plan_waiting(options, task, self.law, initial, friction, posture)
        builder = DiagramBuilder()
        self._assembly = Assembly(builder, task, self.law, nominal, options, initial, self.waiting)
        self._assembly.build(self._add_measurement())
        self.estimates_state = self._assembly.estimates_state
        self.on_motors, self.drive_port = self._assembly.on_motors, self._law_system.drive_port
        names = ("position_deviation", "tool_deviation", "velocity_deviation")
        self.deviations = [name for name in names if name in self._assembly.outputs]
        self._export(builder, logged=logged)
        builder.BuildInto(self)

    def _plan(
        self,
        task: Task,
        nominal: NominalRobot,
        options: FollowerOptions,
        start: StartPoint,
        posture: np.ndarray,
    ) -> None:
        """Set task, robot and options, and create the law."""
        self.task, self.robot, self.options = task, nominal.robot, options
        self.nominal = nominal
        self.start_posture, self.period = posture, options.controller.sampling_time
        point, manifold = task.point(start), task.manifold
        if options.frame is not None:
            point = resting_point(point, options.frame, manifold.layout.order)
            manifold = MovingFrameManifold(manifold)
        self.rest = RestPosture(posture, point)
        self.law = make_law(
            options.controller, self.robot, manifold, lambda: self.rest, options.faults
        )

    def _add_measurement(self) -> OutputPort:
        """Add the input of the measured state, and return the joint state."""
        block = Collect({"joint_state": 4 * self.robot.dimension})
        measured = self._assembly.add("measured_state", block)
        self._assembly.inputs["joint_state"] = [measured.GetInputPort("joint_state")]
        return measured.GetOutputPort("all")

    def _export(self, builder: DiagramBuilder, *, logged: bool) -> None:
        """Export ports of the assembly as ports of the diagram."""
        assembly, law = self._assembly, self._law_system
        for name, (port, *others) in assembly.inputs.items():
            builder.ExportInput(port, name)
            for other in others:
                builder.ConnectInput(name, other)
        builder.ExportOutput(assembly.drive, law.drive_port)
        for name in _ALWAYS:
            builder.ExportOutput(law.GetOutputPort(name), name)
        self.logged = [name for name in assembly.outputs if name not in _ALWAYS] if logged else []
        further = ["closest_point", "world_pose", "found_state", "growing_path"] if logged else []
        names = dict.fromkeys([*_PUBLIC, *assembly.public, *self.logged, *further])
        for name in (name for name in names if name in assembly.signals):
            builder.ExportOutput(assembly.signals[name], name)
        self.logged.append("stop_category")

    @property
    def _law_system(self) -> FollowingController:
        return self._assembly.controller

    @property
    def projector(self) -> str:
        """Name of the system that finds the closest point."""
        return self.task.projector_name

    @property
    def access(self) -> ControllerAccess:
        """Access to faults and commands, with or without fused blocks."""
        return ControllerAccess(self._law_system, f"{self.get_name()}.")

    @property
    def network(self) -> Network:
        """Network of functions between its ports."""
        return network_of(self)

    def stepper(self, connected: tuple[str, ...] = ()) -> Stepper:
        """Return the controller as an object to call at every sample, without Drake.

        ``stepper.step(joint_state=..)["drive_torque"]``; the result has all outputs.

        Args:
            connected: Optional inputs with a value at every sample.
        """
        return Stepper(self.network, connected)

    def connect(self, builder: DiagramBuilder, name: str, source: OutputPort) -> None:
        """Connect a source to an input, if there is one of that name.

        Args:
            builder: Builder of the diagram that the controller is in.
            name: Name of the input.
            source: The source.
        """
        if self.HasInputPort(name):
            builder.Connect(source, self.GetInputPort(name))

    def planned_frame(self, placement: np.ndarray) -> PiecewisePolynomialCurve:
        """Return the planned motion of the tool frame over time.

        Args:
            placement: Nominal pose of the base relative to the model's, ``[p, R by rows]``, (12,).

        Raises:
            InputError: If the joints cannot follow the motion.
        """
        return self._assembly.planned_frame(placement)

    def warn(self) -> list[str]:
        """Return warnings about task, motion, law, gains and robot, one sentence each."""
        plan, chosen, law = self.task.drive_plan, self.options.controller, self.law
        link_state = np.append(self.start_posture, np.zeros(self.robot.dimension))
        return [
            *self.task.warnings,
            *([] if plan is None else plan.messages),
            *law_warnings(chosen, self.robot, law, link_state, self.sampled_loop),
            *observed_force_warnings(self.options.compliance, self.robot, law, self.rest),
        ]

    def sampled_loop(self) -> SampledRobot:
        """Return the law, which commands torques, on its robot at rest at the start."""
        law = self.law
        return sampled_robot(
            self.options.controller, self.robot, law.linearization, self.rest, law.posture
        )

    def describe_fault(
        self,
        fault: Fault,
        now: FaultInstant,
        before: FaultInstant | None,
        suspects: np.ndarray,
        oscillating: np.ndarray | None = None,
    ) -> str:
        """Return one sentence on a fault.

        Args:
            fault: The fault.
            now: Signals of the first sample with it.
            before: Signals of the last sample without it, if there is one.
            suspects: Implausible components of the joint state, nonzero if so, shape (4N,).
            oscillating: Drives whose commands oscillated before, by index.
        """
        scene = FaultScene(
            self.law,
            self.robot,
            self.task.projected_manifold,
            self.on_motors,
            now,
            before,
            suspects,
        )
        if oscillating is not None:
            scene = dc.replace(scene, oscillating=oscillating)
        return describe(fault, scene)
