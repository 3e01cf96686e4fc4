"""One builder of stations: a robot, a task and surroundings, each chosen independently."""

from dataclasses import replace
from functools import cache
from pathlib import Path as FilePath

from pydrake.geometry import Meshcat
from pydrake.systems.framework import Diagram, DiagramBuilder

from diagrams.drawing.held_look import held_look
from diagrams.drawing.mounting_look import mounting_look
from diagrams.drawing.recorded import RecordedMotion
from diagrams.drawing.replay import build_delta_replay, build_replay
from diagrams.drawing.robot_geometry import RobotDrawing, draw_robot
from diagrams.holder_station import add_holder, stop_both
from diagrams.robots.arm import Arm
from diagrams.robots.belief import believed_robot
from diagrams.robots.delta import DeltaPart
from diagrams.robots.drives import add_drives
from diagrams.robots.force_sensor import add_sensor
from diagrams.robots.friction import add_friction, believed_friction
from diagrams.robots.joint_state import add_joint_state, add_link_state, states_to_log
from diagrams.robots.remote_arm import RemoteArm
from diagrams.scenario import Scenario
from diagrams.scenario.checks import require
from diagrams.scenario.pair import check_carrier
from diagrams.signal_log import add_log
from diagrams.station import Station
from diagrams.station_parts import (
    add_afar,
    add_robot,
    check_trajectory,
    choose_mounting,
    following_options,
    friction_options,
    make_spring,
    make_task,
    make_workpiece,
    naming_reference,
    outside,
    servo_lag,
    servo_options,
)
from diagrams.station_start import find_rest, find_start
from diagrams.station_warnings import controller_warnings
from diagrams.surroundings.forces import add_surroundings
from diagrams.surroundings.mounting_parts import add_payload
from diagrams.surroundings.obstacles import add_obstacles, add_told_obstacles
from diagrams.surroundings.operator import add_operator
from diagrams.tasks.held_frame import law_manifold
from diagrams.tasks.streaming import StreamTask
from diagrams.tasks.waiting import Approach, plan_waiting
from diagrams.turntable_station import add_turntable
from diagrams.warnings.uncovered_links import uncovered_links
from pfsc_drake.control.planning.course import CourseStart
from pfsc_drake.following.assembly import ControllerAssembly
from pfsc_drake.following.law import make_law
from pfsc_drake.following.law_warnings import MODES
from pfsc_drake.following.planning.drive_limits import keep_drive_limits
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.physics.joint_sensors import EncoderOptions
from pfsc_drake.systems.following_controller import ControllerAccess
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
        folder: Where the scenario's relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.
        like: The same but for what is believed and how it is integrated, if it has been built: its
            task and its start are taken.
        with_slope: Whether a workpiece that is pressed on is a spring, with the stiffness that
            contact has there, and the plant continuous.
        parametric: Whether mass and stiffness parameters of the believed robot, a serial chain,
            are symbols: such a station is not simulated, but its blocks' networks differentiated.
        remote: Whether the robot stands elsewhere: the station has a
            :class:`~diagrams.robots.remote_arm.RemoteArm` for it, and the scenario must tell
            nothing of its surroundings, see :func:`~diagrams.scenario.schema.driven`.

    Returns:
        The station; everything in the scenario that can be wrong has been checked.

    Raises:
        InputError: If the scenario cannot be built.
    """
    builder = DiagramBuilder()
    check_carrier(scenario, simulated=not (remote or parametric or with_slope))
    task = make_task(scenario, folder, progress) if like is None else like.task
    workpiece, mounting = make_workpiece(scenario, task), choose_mounting(scenario, task)
    spring = make_spring(scenario, workpiece) if with_slope else None
    touched = workpiece if spring is None else None
    part = add_robot(builder, scenario, folder, touched, remote=remote)
    if with_slope and part.robot.is_massless:
        allowed = "a model with masses for margins, which are about its dynamics"
        require(False, "robot.model", scenario.robot.model, allowed)
    if parametric:
        assert isinstance(part, Arm)
        part = replace(part, belief=part.belief.with_symbols())
    task.require_joints(part.robot.dimension)
    believed = part.belief.robot
    holder = held = carrier = turntable = None
    if scenario.holder is not None:
        order, built = task.manifold.layout.order, None if like is None else like.holder
        holder, carrier = add_holder(builder, scenario, order, folder, progress, built)
        held = holder.frame
    elif scenario.turntable is not None:
        period, order = scenario.controller.sampling_time, task.manifold.layout.order
        turntable = add_turntable(builder, scenario.turntable, order, period)
        held = turntable.frame
    begin = cache(
        lambda: (
            find_start(scenario.start, task, part, workpiece, mounting, held)
            if like is None
            else (like.start, like.initial_state)
        )
    )
    rest = cache(lambda: find_rest(task, part, *begin(), held))
    law = make_law(scenario.controller, believed, law_manifold(task, held), rest, scenario.faults)
    start, initial_state = begin()
    rubbing = friction_options(scenario, folder)
    friction = believed_friction(part, scenario.controller.friction.believed, rubbing)
    link_state = part.coordinates.link_rows @ initial_state
    start_posture = link_state[: part.robot.dimension]
    options = following_options(scenario)
    crossing = scenario.obstacles
    begun = CourseStart(rest().q_J, start.place)
    asked, chosen, lasts = scenario.reference, scenario.controller, scenario.duration
    plans = [each.plan for each in (holder, turntable) if each is not None]
    carrier_plan = plans[0] if plans else None
    keep_drive_limits(asked, chosen, lasts, task, law, begun, friction, progress, carrier_plan)
    waiting = None if like is None else like.waiting
    if like is None and crossing is not None:
        given, allowed = scenario.compliance.is_given, "left out where progress waits"
        require(not given, "compliance", "given", allowed)
        approach = Approach(start_posture, scenario.start.transition)
        waiting = plan_waiting(crossing, asked, chosen, task, law, begun, friction, approach)

    true_state = part.joint_state(builder)
    period, failures = scenario.controller.sampling_time, scenario.simulation
    measured = add_joint_state(
        builder,
        true_state,
        part.robot,
        EncoderOptions() if remote else scenario.encoders,
        failures.sensor_failure,
        period,
        scenario.encoder_period,
    )
    links = add_link_state(
        builder,
        part,
        scenario.controller,
        scenario.encoders,
        measured,
        true_state,
        start_posture,
        friction,
    )
    joint_state = links.joint_state
    override = part.override.get_output_port() if isinstance(part, RemoteArm) else None
    obstacles = {}
    if crossing is not None:
        told = add_told_obstacles if remote else add_obstacles
        obstacles = told(builder, crossing, period)
    tuning = None if scenario.operator is None else scenario.operator.tuning
    known = believed_robot(believed, scenario.encoders, period, friction)
    assembly = ControllerAssembly(
        builder, task, law, known, options, start_posture, waiting, tuning
    )
    check_trajectory(scenario)
    with naming_reference():
        assembly.add_place(joint_state, None if held is None else held.motion)
    stream, pen = assembly.stream, None
    if isinstance(task, StreamTask) and stream is not None:
        pen = task.add_source(builder, stream, period)
    if override is not None:
        assembly.connect("override", override)
    if "obstacles_measured" in obstacles:
        assembly.connect("obstacles", obstacles["obstacles_measured"])
    # what acts on the tool acts where the tool is, also if a law follows another point
    beside = assembly.projector.GetOutputPort("manifold_point")
    around = assembly.signals | {"joint_state": true_state}
    if held is None:
        around["manifold_point"] = beside
    operator = None
    if scenario.operator is not None:
        operator = add_operator(
            builder, scenario.operator, scenario.switched_regions, period, folder
        )
    afar = add_afar(builder, scenario, operator, task, start, paced=not remote)
    at_tool = operator if afar is None else None
    forces = add_surroundings(
        builder,
        part,
        task,
        outside(scenario),
        around,
        start,
        at_tool,
        mounting,
        spring,
        law_manifold(task, held),
        None if holder is None else holder.reaction,
    )
    if scenario.needs_sensor:
        states = {"joint_state": joint_state, "true_joint_state": true_state}
        failure = failures.force_sensor_failure
        forces |= add_sensor(builder, part, scenario.sensor, failure, period, states | forces)
        if mounting is not None:
            forces |= add_payload(
                builder, mounting, part.gravity, period, assembly.signals | forces
            )
        if holder is not None and holder.reaction is not None:
            holder.reaction.tell(builder, forces["wrench_measured"], assembly.world_pose)
    led = {} if operator is None else operator.requests
    if afar is not None:
        led = led | {"wrench_led": afar.lead(builder, forces)}
    controller, made = assembly.add_law(forces | led)
    signals = assembly.signals | obstacles | forces | made | links.signals
    if afar is not None:
        signals |= afar.connect(builder, task, believed, servo_lag(scenario), signals)
    if isinstance(task, StreamTask) and stream is not None:
        signals["true_place"] = task.add_true_place(builder, part.robot, true_state, stream, period)
    drive = {"drive": controller.GetOutputPort(controller.drive_port)}
    if links.drive_torque is not None:
        builder.Connect(drive["drive"], links.drive_torque)
    if isinstance(part, RemoteArm):
        builder.Connect(
            part.stop_request.get_output_port(), controller.GetInputPort("stop_request")
        )
    servo = None
    if not remote:
        further, servo = add_drives(
            builder,
            part,
            servo_options(scenario),
            scenario.driver,
            period,
            signals | drive,
            initial_state,
        )
        signals |= further
    stops = [] if remote else [signals["stop_category"]]
    stops += [signals["servo_stop_category"]] if "servo_stop_category" in signals else []
    signals |= add_friction(builder, part, true_state, rubbing, stops)
    logged = joint_state if remote else true_state
    signals |= states_to_log(logged, assembly.signals["joint_state"])
    if holder is not None and carrier is not None:
        stop_both(builder, controller, carrier)
        signals |= holder.signals
    if turntable is not None:
        signals |= turntable.signals
    discrete = part.drives.step is not None
    log = add_log(builder, signals, scenario.controller.sampling_time, discrete_plant=discrete)
    access = ControllerAccess(controller)
    source = measured.get_system().get_name(), measured.get_name()
    if scenario.simulation.fused:
        fuse_blocks(builder)
    planned = [] if task.drive_plan is None else task.drive_plan.said

    def warn() -> list[str]:
        return (
            task.warnings
            + scenario.model_error.warnings
            + planned
            + part.start_warnings(scenario.start, start_posture, start.target)
            + controller_warnings(scenario, task, part, law, link_state, rest())
            + ([] if holder is None else holder.warn())
        )

    diagram = builder.Build()
    diagram.set_name(scenario.name or "station")
    return Station(
        diagram,
        part,
        task,
        law,
        assembly.projector.get_name(),
        access,
        servo,
        log,
        initial_state,
        start,
        assembly.on_motors,
        source,
        warn,
        workpiece,
        operator,
        MODES if "mode" in signals else (),
        mounting,
        0 if remote else scenario.driver.ticks(period),
        holder,
        pen,
        waiting,
        None if afar is None else afar.link,
        turntable,
    )


def draw_station(settings: Scenario, folder: FilePath, station: Station) -> RobotDrawing | None:
    """Read what a station's robot looks like, or return None if that is known without files.

    Args:
        settings: The scenario that is to be run.
        folder: Where its relative file names start.
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
    """Return a diagram that draws a station's recorded motion while its time advances.

    Args:
        settings: The scenario that was run.
        station: Its station.
        drawing: What its robot looks like, from :func:`draw_station`.
        motion: What to draw.
        meshcat: Where to draw.
    """
    period, drawn = settings.simulation.frame_period, station.task.drawing
    look = None
    if station.workpiece is not None:
        look = station.workpiece.look(station.part.gravity)
    if isinstance(station.part, DeltaPart):
        robot = station.part.robot
        return build_delta_replay(robot, drawn, motion, meshcat, period, look)
    assert drawing is not None  # draw_station knows every other robot
    plates = None if station.mounting is None else mounting_look(station.mounting)
    held = None
    carrier = settings.holder or settings.turntable
    if carrier is not None:
        held = held_look(carrier.workpiece, drawing.holder)
    return build_replay(drawing, drawn, motion, meshcat, period, look, plates, held)
