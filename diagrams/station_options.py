"""Options of the parts of a station, from a scenario."""

from dataclasses import dataclass
from pathlib import Path as FilePath

from pydrake.systems.framework import DiagramBuilder

from diagrams.environment.acting_forces import Outside
from diagrams.environment.leader import teleoperated
from diagrams.environment.mounting import Mounting, make_mounting
from diagrams.environment.workpieces import NotchedWorkpiece, PressedWorkpiece
from diagrams.robots.arm import add_arm
from diagrams.robots.delta import add_delta, free_step
from diagrams.robots.drives import ServoOptions
from diagrams.robots.model import is_delta
from diagrams.robots.nominal_model import NominalModelSource
from diagrams.robots.part import RobotPart
from diagrams.robots.plant_friction import FrictionOptions
from diagrams.robots.remote_arm import add_remote_arm
from diagrams.robots.workpiece import Workpiece
from diagrams.scenario import Scenario
from diagrams.scenario.massless import check_massless
from pfsc_drake.checks import require, require_whole_fraction
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.tasks.path_task import PathTask
from pfsc_drake.controller.tasks.surface_task import SurfaceTask
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.controller.teleoperated import Teleoperated
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.systems.physics.surface_spring import SurfaceSpring


@dataclass
class StationOptions:
    """Options of the parts of a station, from a scenario.

    Attributes:
        scenario: The scenario.
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.
    """

    scenario: Scenario
    folder: FilePath
    progress: Progress | None = None

    @property
    def period(self) -> float:
        """Sampling time of the controller [s]."""
        return self.scenario.controller.sampling_time

    @property
    def nominal_model_source(self) -> NominalModelSource:
        """Origin of the nominal model of the robot."""
        scenario, controller = self.scenario, self.scenario.controller
        return NominalModelSource(
            scenario.robot,
            controller.model,
            scenario.model_error,
            self.folder,
            by_velocity=not controller.law_record.commands_torque,
        )

    @property
    def friction(self) -> FrictionOptions:
        """Friction and holding brakes of the plant's drives."""
        scenario, brakes = self.scenario, self.scenario.faults.brakes
        kinds = scenario.friction, scenario.drive_friction, brakes
        return FrictionOptions(*kinds, scenario.simulation, self.period, self.folder)

    @property
    def servo(self) -> ServoOptions | None:
        """Velocity servos of the joints; None where the law commands torques."""
        scenario = self.scenario
        if scenario.controller.law_record.commands_torque:
            return None
        return ServoOptions(scenario.servo, scenario.controller, scenario.faults, scenario.encoders)

    @property
    def outside(self) -> Outside:
        """External forces on the robot."""
        scenario = self.scenario
        hand = scenario.hand if scenario.teleoperation is None else None
        forces = scenario.forces, scenario.hold_back, scenario.pushes, hand
        return Outside(*forces, scenario.needs_sensor, self.period)

    @property
    def follower(self) -> FollowerOptions:
        """Options of the controller that a diagram of the user's own has too."""
        scenario = self.scenario
        return FollowerOptions(
            controller=scenario.controller,
            faults=scenario.faults,
            transition=scenario.start.transition,
            compliance=scenario.compliance,
            swings=scenario.reference.swings,
            reference=scenario.reference,
        )

    def workpiece(self, task: Task) -> Workpiece | None:
        """Return the workpiece that a tool presses on or runs in, if there is one.

        Args:
            task: Task of the tool.

        Raises:
            InputError: If the workpiece does not suit the task or the sampling time.
        """
        pressed, notch = self.scenario.workpiece, self.scenario.notch
        if pressed is not None:
            require(notch is None, "notch", "given", "null where there is a workpiece")
            require_whole_fraction("workpiece.time_step", pressed.time_step, self.period)
            if not isinstance(task, SurfaceTask):
                raise InputError("workpiece = given: must be null where the task is no surface")
            return PressedWorkpiece(task.surface, task.projected_manifold, pressed)
        if notch is None:
            return None
        require_whole_fraction("notch.time_step", notch.time_step, self.period)
        if not isinstance(task, PathTask):
            raise InputError("notch = given: must be null where the task is no path")
        return NotchedWorkpiece(task.path, notch)

    def spring(self, workpiece: Workpiece | None) -> SurfaceSpring | None:
        """Return the spring that models a workpiece under pressure, or None.

        Args:
            workpiece: Workpiece that the tool touches, if there is one.
        """
        press = self.scenario.compliance.press
        if press is None or press.force == 0.0 or not isinstance(workpiece, PressedWorkpiece):
            return None
        return SurfaceSpring(workpiece.touch, workpiece.stiffness(press.force), self.period)

    def mounting(self, task: Task) -> Mounting | None:
        """Return origin and destination of a scenario's plates, if it has any.

        Args:
            task: Task of the tool.

        Raises:
            InputError: If the plates do not suit the task, or something else is touched.
        """
        scenario = self.scenario
        if scenario.plate is None:
            return None
        for key in ("notch", "workpiece"):
            absent = getattr(scenario, key) is None
            require(absent, key, "given", "null where there is a plate")
        has_hand = scenario.hand is not None
        return make_mounting(scenario.plate, task, has_hand=has_hand, period=self.period)

    def teleoperated(self, task: Task) -> list[Teleoperated]:
        """Return the follower's side of a teleoperation, if there is one.

        Args:
            task: Task of the tool.

        Raises:
            InputError: If nothing complies, or the tank does not suit the follower.
        """
        parameters, compliance = self.scenario.teleoperation, self.scenario.compliance
        if parameters is None:
            return []
        allowed = "null where nothing complies with measured forces (compliance)"
        require(compliance.needs_sensor, "teleoperation", "given", allowed)
        turns = ComplianceParameters(rotational=compliance.rotational).is_given
        allowed = "null where the tool's orientation is stiff (compliance.rotational)"
        require(parameters.rotation is None or turns, "teleoperation.rotation", "given", allowed)
        return [teleoperated(parameters, task, self._servo_lag, self.period)]

    def add_robot(
        self, builder: DiagramBuilder, workpiece: Workpiece | None, *, remote: bool = False
    ) -> RobotPart:
        """Add the robot, with the nominal model that its controller has.

        Args:
            builder: Builder of the diagram.
            workpiece: Workpiece that the tool may touch, if there is one.
            remote: Whether the robot is in another process.

        Raises:
            InputError: If the robot cannot be read, or does not suit the scenario.
        """
        scenario, model, source = (
            self.scenario,
            self.scenario.robot.model,
            self.nominal_model_source,
        )
        if remote:
            require(
                not is_delta(model), "robot.model", model, "an arm, where it is in another process"
            )
            return add_remote_arm(builder, source, has_sensor=scenario.needs_sensor)
        if not is_delta(model):
            arm = add_arm(builder, source, workpiece)
            if arm.robot.is_massless:
                check_massless(scenario)
            return arm
        step = free_step(self.period, scenario.simulation.max_step)
        part = add_delta(builder, source, step, workpiece)
        # errors of reading come before those of unsuitable parameters
        self._check_delta()
        return part

    def check(self, task: Task) -> None:
        """Refuse obstacles, oscillations and transitions that the task does not support.

        Args:
            task: Task of the tool.

        Raises:
            InputError: If the task does not support one of them.
        """
        scenario, swings = self.scenario, self.scenario.reference.swings
        if scenario.obstacles is not None:
            complies, allowed = scenario.compliance.is_given, "left out where progress waits"
            require(not complies, "compliance", "given", allowed)
            waits = task.is_planned and not task.manifold.follows_time
            allowed = (
                "null unless controller.manifold is path or surface, on which progress can wait"
            )
            require(waits, "obstacles", "given", allowed)
            require(not swings, "reference.swings", "given", "none where there are obstacles")
        if scenario.controller.manifold == "trajectory":
            coordinates = "whose coordinates are those of space"
            allowed = f"none with controller.manifold = trajectory, {coordinates}"
            require(not swings, "reference.swings", f"{len(swings)} given", allowed)
            transition = scenario.start.transition
            allowed = (
                "0 with controller.manifold = trajectory, whose reference is a point that moves"
            )
            require(transition == 0.0, "start.transition", transition, allowed)

    @property
    def _servo_lag(self) -> float:
        """Lag between the command of a law and a tool that follows it [s]."""
        if RELATIVE_DEGREE[self.scenario.controller.law] > 1:
            return 0.0
        servo = self.scenario.servo
        return 1.0 / servo.bandwidth + servo.bus_delay

    def _check_delta(self) -> None:
        """Refuse options for robots that turn their tool or have elastic joints."""
        scenario, start, surface = self.scenario, self.scenario.start, self.scenario.surface
        law, drives = (
            scenario.controller.law,
            "the drives of a DELTA robot are stiff and take forces",
        )
        require(law == "rigid", "controller.law", law, f"rigid, {drives}")
        one = "none; one pose of the slides belongs to each position"
        require(not start.posture_deg, "start.posture_deg", start.posture_deg, one)
        turned = "none; a DELTA robot only translates"
        require(not any(start.rotation_deg), "start.rotation_deg", start.rotation_deg, turned)
        keyframes = scenario.path.orientation.keyframes
        require(not keyframes, "path.orientation.keyframes", len(keyframes), turned)
        if surface is not None:
            kind = surface.orientation.kind
            require(kind == "none", "surface.orientation.kind", kind, turned)
