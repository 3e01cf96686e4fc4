"""Choices of a scenario for the parts of a station: robot, drives, workpiece, forces."""

from pathlib import Path as FilePath

from pydrake.systems.framework import DiagramBuilder

from diagrams.environment.acting_forces import Outside
from diagrams.environment.leader_side import teleoperated
from diagrams.environment.mounting import Mounting, make_mounting
from diagrams.environment.workpieces import NotchedWorkpiece, PressedWorkpiece
from diagrams.robots.arm import add_arm
from diagrams.robots.belief import BeliefSource
from diagrams.robots.delta import add_delta, free_step
from diagrams.robots.drives import ServoOptions
from diagrams.robots.model import is_delta
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
from pfsc_drake.systems.physics.surface_spring import SurfaceSpring


def servo_lag(scenario: Scenario) -> float:
    """Return the lag between what a law asks of a tool that follows, and where the tool is [s].

    Args:
        scenario: The scenario.
    """
    if RELATIVE_DEGREE[scenario.controller.law] > 1:
        return 0.0
    return 1.0 / scenario.servo.bandwidth + scenario.servo.bus_delay


def make_workpiece(scenario: Scenario, task: Task) -> Workpiece | None:
    """Return what a tool presses on or runs in, if there is anything.

    Args:
        scenario: The scenario.
        task: What the tool is to do.

    Raises:
        InputError: If the workpiece does not suit the task or the sampling time.
    """
    period = scenario.controller.sampling_time
    if scenario.workpiece is not None:
        require(scenario.notch is None, "notch", "given", "null where there is a workpiece")
        require_whole_fraction("workpiece.time_step", scenario.workpiece.time_step, period)
        if not isinstance(task, SurfaceTask):
            raise InputError("workpiece = given: must be null where the task is no surface")
        return PressedWorkpiece(task.surface, task.place, scenario.workpiece)
    if scenario.notch is None:
        return None
    require_whole_fraction("notch.time_step", scenario.notch.time_step, period)
    if not isinstance(task, PathTask):
        raise InputError("notch = given: must be null where the task is no path")
    return NotchedWorkpiece(task.path, scenario.notch)


def make_spring(scenario: Scenario, workpiece: Workpiece | None) -> SurfaceSpring | None:
    """Return what a workpiece that is pressed on is to the tool, if there is one.

    Args:
        scenario: The scenario.
        workpiece: What the tool touches, if anything.
    """
    press = scenario.compliance.press
    if press is None or press.force == 0.0 or not isinstance(workpiece, PressedWorkpiece):
        return None
    period = scenario.controller.sampling_time
    return SurfaceSpring(workpiece.touch, workpiece.stiffness(press.force), period)


def add_robot(
    builder: DiagramBuilder,
    scenario: Scenario,
    folder: FilePath,
    workpiece: Workpiece | None,
    *,
    remote: bool = False,
) -> RobotPart:
    """Add the robot of a scenario, with what its controller believes of it.

    Args:
        builder: Builder of the diagram.
        scenario: The scenario.
        folder: Where its relative file names start.
        workpiece: What the tool may touch, if anything.
        remote: Whether it stands elsewhere.

    Raises:
        InputError: If the robot cannot be read, or cannot do what the scenario asks of it.
    """
    source, controller = belief_source(scenario, folder), scenario.controller
    if remote:
        model = scenario.robot.model
        require(not is_delta(model), "robot.model", model, "an arm, where it stands elsewhere")
        return add_remote_arm(builder, source, has_sensor=scenario.needs_sensor)
    if not is_delta(scenario.robot.model):
        arm = add_arm(builder, source, workpiece)
        if arm.robot.is_massless:
            check_massless(scenario)
        return arm
    step = free_step(controller.sampling_time, scenario.simulation.max_step)
    part = add_delta(builder, source, step, workpiece)
    # what cannot be read is said before what it could not do
    _check_delta(scenario)
    return part


def belief_source(scenario: Scenario, folder: FilePath) -> BeliefSource:
    """Return where a scenario's controller has from what it believes of the robot.

    Args:
        scenario: The scenario.
        folder: Where its relative file names start.
    """
    controller = scenario.controller
    return BeliefSource(
        scenario.robot,
        controller.model,
        scenario.model_error,
        folder,
        by_velocity=not controller.law_record.commands_torque,
    )


def friction_options(scenario: Scenario, folder: FilePath) -> FrictionOptions:
    """Return what brakes the drives of a scenario's plant.

    Args:
        scenario: The scenario.
        folder: Where its relative file names start.
    """
    return FrictionOptions(
        scenario.friction,
        scenario.drive_friction,
        scenario.faults.brakes,
        scenario.simulation,
        scenario.controller.sampling_time,
        folder,
    )


def servo_options(scenario: Scenario) -> ServoOptions | None:
    """Return the velocity servos of a scenario's joints; None where its law commands torques.

    Args:
        scenario: The scenario.
    """
    if scenario.controller.law_record.commands_torque:
        return None
    return ServoOptions(scenario.servo, scenario.controller, scenario.faults, scenario.encoders)


def _check_delta(scenario: Scenario) -> None:
    """Refuse what is said of robots that turn their tool or bend."""
    law, start, surface = scenario.controller.law, scenario.start, scenario.surface
    drives = "the drives of a DELTA robot are stiff and take forces"
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


def choose_mounting(scenario: Scenario, task: Task) -> Mounting | None:
    """Return where a scenario's plates come from and go, if it has any.

    Args:
        scenario: The scenario.
        task: What the tool is to do.

    Raises:
        InputError: If the plates do not suit the task, or something else is touched.
    """
    if scenario.plate is None:
        return None
    for key in ("notch", "workpiece"):
        given = getattr(scenario, key) is not None
        require(not given, key, "given", "null where there is a plate")
    return make_mounting(
        scenario.plate,
        task,
        has_hand=scenario.hand is not None,
        period=scenario.controller.sampling_time,
    )


def outside(scenario: Scenario) -> Outside:
    """Return what acts on a scenario's robot from outside.

    Args:
        scenario: The scenario.
    """
    return Outside(
        scenario.forces,
        scenario.hold_back,
        scenario.pushes,
        scenario.hand if scenario.teleoperation is None else None,
        scenario.needs_sensor,
        scenario.controller.sampling_time,
    )


def following_options(scenario: Scenario) -> FollowerOptions:
    """Return what a scenario chooses of its controller.

    Args:
        scenario: The scenario.
    """
    return FollowerOptions(
        controller=scenario.controller,
        faults=scenario.faults,
        transition=scenario.start.transition,
        compliance=scenario.compliance,
        swings=scenario.reference.swings,
        reference=scenario.reference,
    )


def check_trajectory(scenario: Scenario) -> None:
    """Refuse what a point that moves along a path with time cannot have.

    Args:
        scenario: The scenario.

    Raises:
        InputError: If it has that.
    """
    if scenario.controller.manifold != "trajectory":
        return
    swings, transition = scenario.reference.swings, scenario.start.transition
    allowed = "none with controller.manifold = trajectory, whose coordinates are those of space"
    require(not swings, "reference.swings", f"{len(swings)} given", allowed)
    allowed = "0 with controller.manifold = trajectory, whose reference is a point that moves"
    require(transition == 0.0, "start.transition", transition, allowed)


def check_obstacles(scenario: Scenario, task: Task, part: RobotPart) -> None:
    """Refuse obstacles where progress cannot wait for them.

    Args:
        scenario: The scenario.
        task: Its task.
        part: The robot.

    Raises:
        InputError: If so.
    """
    if scenario.obstacles is None:
        return
    given, allowed = scenario.compliance.is_given, "left out where progress waits"
    require(not given, "compliance", "given", allowed)
    waits = task.is_planned and not task.manifold.follows_time
    allowed = "null unless controller.manifold is path or surface, on which progress can wait"
    require(waits, "obstacles", "given", allowed)
    swings = scenario.reference.swings
    require(not swings, "reference.swings", "given", "none where there are obstacles")


def teleoperation_options(scenario: Scenario, task: Task) -> list[Teleoperated]:
    """Return the follower's side of a scenario's teleoperation, if there is one.

    Args:
        scenario: The scenario.
        task: Its task.

    Raises:
        InputError: If nothing complies, or the tank does not suit the follower.
    """
    parameters = scenario.teleoperation
    if parameters is None:
        return []
    allowed = "null where nothing yields to what a sensor measures (compliance)"
    require(scenario.compliance.needs_sensor, "teleoperation", "given", allowed)
    turns = ComplianceParameters(rotational=scenario.compliance.rotational).is_given
    allowed = "null where the tool's orientation is stiff (compliance.rotational)"
    require(parameters.rotation is None or turns, "teleoperation.rotation", "given", allowed)
    period = scenario.controller.sampling_time
    return [teleoperated(parameters, task, servo_lag(scenario), period)]
