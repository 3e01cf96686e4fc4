"""One builder of stations: a robot, a task and an environment, each chosen independently."""

from dataclasses import replace
from pathlib import Path as FilePath

from pydrake.geometry import Meshcat
from pydrake.systems.framework import Diagram, DiagramBuilder

from diagrams.controlled_robot import add_controlled_robot
from diagrams.drawing.mounting_drawing import MountingDrawing
from diagrams.drawing.moving_workpiece_drawing import MovingWorkpieceDrawing
from diagrams.drawing.recorded import RecordedMotion
from diagrams.drawing.replay import Playback
from diagrams.drawing.robot_geometry import RobotDrawing, draw_robot
from diagrams.environment.acting_forces import Environment
from diagrams.environment.mounting_parts import payload_of
from diagrams.holder_station import Holder, add_holder
from diagrams.robots.arm import Arm
from diagrams.robots.delta import DeltaPart
from diagrams.robots.part import RobotPart
from diagrams.robots.remote_arm import RemoteArm
from diagrams.scenario import Scenario
from diagrams.scenario.pair import check_carrier
from diagrams.scenario_task import check_joints, make_task
from diagrams.signal_log import add_log
from diagrams.site import Site
from diagrams.station import Station
from diagrams.station_options import StationOptions
from diagrams.station_parts import PARTS
from diagrams.station_start import find_start
from diagrams.tasks.task_drawing import drawing_of
from diagrams.turntable_station import Turntable
from diagrams.warnings.uncovered_links import uncovered_links
from pfsc_drake.checks import require
from pfsc_drake.controller.extension import Extension
from pfsc_drake.controller.options.follower_options import (
    FollowerOptions,
    ObstacleOptions,
    OperatorOptions,
)
from pfsc_drake.controller.sensed_force import SensedForce
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.systems.fuse import fuse_blocks


def build_station(
    scenario: Scenario,
    folder: FilePath,
    progress: Progress | None = None,
    like: Station | None = None,
    *,
    with_slope: bool = False,
    parametric: bool = False,
    remote: bool = False,
) -> Station:
    """Build the station of a scenario.

    Args:
        scenario: The scenario.
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.
        like: Station that differs in the nominal model and the integration only, if it has been
            built: its task and its start are taken.
        with_slope: Whether a workpiece that is pressed on is a spring with the stiffness of the
            contact, and the plant continuous.
        parametric: Whether mass and stiffness parameters of the nominal model, a serial chain,
            are symbols: such a station is not simulated, but its blocks' networks differentiated.
        remote: Whether the robot is in another process: the station has a
            :class:`~diagrams.robots.remote_arm.RemoteArm` for it, and the scenario must not have
            an environment, see :func:`~diagrams.scenario.schema.driven`.

    Returns:
        The station; all input of the scenario has been checked.

    Raises:
        InputError: If the scenario cannot be built.
    """
    builder, chosen = DiagramBuilder(), StationOptions(scenario, folder, progress)
    check_carrier(scenario, simulated=not (remote or parametric or with_slope))
    task = make_task(scenario, folder, progress) if like is None else like.task
    workpiece, mounting = chosen.workpiece(task), chosen.mounting(task)
    spring = chosen.spring(workpiece) if with_slope else None
    touched = workpiece if spring is None else None
    part = chosen.add_robot(builder, touched, remote=remote)
    if with_slope and part.robot.is_massless:
        allowed = "a model with masses for margins, which are about its dynamics"
        require(False, "robot.model", scenario.robot.model, allowed)
    if parametric:
        assert isinstance(part, Arm)
        part = replace(part, nominal_model=part.nominal_model.with_symbols())
    check_joints(scenario, task, part.robot.dimension)
    carrier = _add_carrier(builder, chosen, task, like)
    frame = None if carrier is None else carrier.frame
    start = (
        find_start(scenario.start, task, part, workpiece, mounting, frame)
        if like is None
        else like.controlled.initial_conditions
    )
    chosen.check(task)
    placed = part, task, task.manifold, chosen.outside, start[0]
    at_tool = scenario.operator is not None and scenario.teleoperation is None
    around = Environment(*placed, at_tool, mounting, spring)
    robot = add_controlled_robot(
        builder,
        chosen,
        part,
        task,
        start,
        _options(chosen, part, around, carrier),
        like=None if like is None else like.controlled,
    )
    around = replace(around, manifold=robot.controller.law.linearization.manifold)
    site = Site(builder, chosen, robot, around, remote=remote, carrier=carrier)
    for add_part in PARTS:
        add_part(site)
    site.connect()
    log = add_log(builder, site.logged, site.period, discrete_plant=part.drives.step is not None)
    if scenario.simulation.fused:
        fuse_blocks(builder)
    diagram = builder.Build()
    diagram.set_name(scenario.name or "station")
    return Station(diagram, site, log, workpiece)


def _add_carrier(
    builder: DiagramBuilder,
    chosen: StationOptions,
    task: Task,
    like: Station | None,
) -> Holder | Turntable | None:
    """Add the robot or the turntable that carries the workpiece, if there is one."""
    scenario = chosen.scenario
    if scenario.holder is not None:
        order, built = task.manifold.layout.order, None if like is None else like.holder
        return add_holder(builder, chosen, order, built)
    if scenario.turntable is not None:
        scenario.turntable.check()
        return Turntable(scenario.turntable)
    return None


def _options(
    chosen: StationOptions,
    part: RobotPart,
    around: Environment,
    carrier: Holder | Turntable | None,
) -> FollowerOptions:
    """Return the options of the robot's controller."""
    scenario = chosen.scenario
    remote, extensions = isinstance(part, RemoteArm), list[Extension]()
    if scenario.needs_sensor:
        load, sensor = part.nominal_load(scenario.sensor.joint), scenario.sensor
        extensions.append(SensedForce(load, sensor.measurement_range, sensor))
        if around.mounting is not None:
            extensions.append(payload_of(around.mounting, part.gravity))
    extensions += chosen.teleoperated(around.task)
    if isinstance(carrier, Turntable):
        extensions.append(carrier.known_motion)
    crossing, operator = scenario.obstacles, scenario.operator
    obstacles = None
    if crossing is not None:
        shapes = [obstacle.shape for obstacle in crossing.moving]
        obstacles = ObstacleOptions(shapes, crossing.watch, crossing.elbow)
    switches = len(scenario.switched_regions)
    return replace(
        chosen.follower,
        override=remote and around.task.is_planned,
        stop_request=remote or isinstance(carrier, Holder),
        obstacles=obstacles,
        operator=OperatorOptions(operator.tuning, switches) if operator else None,
        known_forces=around.signals,
        frame=None if carrier is None else carrier.frame,
        frame_motion=None if carrier is None else lambda: carrier.planned,
        extensions=extensions,
    )


def draw_station(settings: Scenario, folder: FilePath, station: Station) -> RobotDrawing | None:
    """Read the visual geometry of a station's robot; return None if it needs no files.

    Args:
        settings: The scenario.
        folder: Base folder of relative file names.
        station: Its station.
    """
    if not isinstance(station.part, Arm):
        return None
    drawing = draw_robot(station.part.model, station.part.tool, settings.robot, folder)
    if station.waiting is not None:
        uncovered = uncovered_links(station.part, drawing.parts, station.waiting.ahead)
        return replace(drawing, warnings=drawing.warnings + uncovered)
    if settings.holder is None or station.holder is None:
        return drawing
    part = station.holder.part
    holder = draw_robot(part.model, part.tool, settings.holder.robot, folder)
    return replace(drawing, warnings=drawing.warnings + holder.warnings, holder=holder)


def build_station_replay(
    settings: Scenario,
    station: Station,
    drawing: RobotDrawing | None,
    motion: RecordedMotion,
    meshcat: Meshcat,
) -> Diagram:
    """Return a diagram that replays a station's recorded motion.

    Args:
        settings: The scenario that was run.
        station: Its station.
        drawing: Drawing of its robot, from :func:`draw_station`.
        motion: The recorded motion.
        meshcat: Meshcat instance to draw in.
    """
    playback = Playback(motion, meshcat, settings.simulation.frame_period)
    drawn = drawing_of(station.task)
    workpiece = None
    if station.workpiece is not None:
        workpiece = station.workpiece.drawing(station.part.gravity)
    if isinstance(station.part, DeltaPart):
        return playback.build_delta(station.part.robot, drawn, workpiece)
    assert drawing is not None  # draw_station draws every other robot
    plates = None if station.mounting is None else MountingDrawing(station.mounting)
    moving = None
    carrier = settings.holder or settings.turntable
    if carrier is not None:
        moving = MovingWorkpieceDrawing(carrier.workpiece, drawing.holder)
    return playback.build(drawing, drawn, workpiece, plates, moving)
