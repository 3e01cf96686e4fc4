"""Parts of a station: each reads signals of the others by name, and adds its own.

A part is a function of a :class:`~diagrams.site.Site`. It adds nothing where the scenario has no
such part. Parts are added in the order of :data:`PARTS`; the inputs of controllers are connected
afterwards.
"""

from collections.abc import Callable

from diagrams.environment.leader import LeaderSide
from diagrams.environment.measured_obstacles import add_obstacles, add_reported_obstacles
from diagrams.environment.operator import add_operator
from diagrams.holder_station import HOLDER, Holder
from diagrams.robots.drives import add_drives
from diagrams.robots.force_sensor import add_force_sensor
from diagrams.robots.plant_friction import add_friction
from diagrams.robots.remote_arm import RemoteArm
from diagrams.site import Site
from diagrams.tasks.streaming import ScenarioStream
from diagrams.turntable_station import Turntable
from pfsc_drake.blocks.wiring_blocks import Hold


def _controller(site: Site) -> None:
    """Show the signals of the controller, and the states of the joints."""
    robot, controller = site.robot, site.robot.controller
    site.signals |= robot.signals
    site.show(**{name: robot.signals[name] for name in controller.logged})
    site.signals |= {"true_state": robot.true_state, "measured_state": robot.measured}
    site.logged |= robot.logged_states
    if site.remote:  # joint_state is the estimate itself
        site.logged.pop("found_joint_state", None)
    part = robot.part
    if isinstance(part, RemoteArm):
        site.signals |= {"override": part.override.get_output_port()}
        site.signals |= {"stop_request": part.stop_request.get_output_port()}


def _carrier(site: Site) -> None:
    """Connect the carrier of the workpiece with the controller, and both faults with each other."""
    carrier = site.carrier
    if isinstance(carrier, Turntable):
        added = carrier.add(site.builder, site.period)
        site.signals |= added
        frame = site.logged.pop("frame_jet")
        site.show(turntable_motion=added["turntable_motion"], turntable_frame_jet=frame)
    elif isinstance(carrier, Holder):
        other = carrier.robot.signals
        site.signals |= {"frame_jet": other["frame_jet"], "stop_request": other["fault"]}
        site.logged |= carrier.signals
        # a sample later: otherwise each would depend on the other
        hold = site.add(f"{HOLDER}stop", Hold(1), value=site.signals["fault"])
        holds = carrier.robot.controller
        holds.connect(site.builder, "stop_request", hold.GetOutputPort("held"))


def _obstacles(site: Site) -> None:
    if site.scenario.obstacles is not None:
        add = add_reported_obstacles if site.remote else add_obstacles
        site.show(**add(site.builder, site.scenario.obstacles, site.period))


def _waypoints(site: Site) -> None:
    task = site.task
    if isinstance(task, ScenarioStream):
        source, site.pen = task.add_source(site.builder, site.signals["stream"], site.period)
        site.signals["waypoints"] = source
        robot, path = site.robot.part.robot, site.signals["growing_path"]
        known = robot, site.signals["true_state"], path, site.period
        site.show(actual_projection=task.add_actual_projection(site.builder, *known))


def _operator(site: Site) -> None:
    scenario = site.scenario
    if scenario.operator is not None:
        regions = scenario.switched_regions
        operator = add_operator(
            site.builder, scenario.operator, regions, site.period, site.options.folder
        )
        site.operator, site.signals = operator, site.signals | operator.requests


def _leader(site: Site) -> None:
    scenario = site.scenario
    if scenario.teleoperation is not None:
        known = site.task, site.robot.start, site.period
        side = LeaderSide(scenario.teleoperation, scenario.hand, site.operator, *known)
        message, paced = site.signals["message"], not site.remote
        signals, site.leader = side.add(site.builder, message, paced=paced)
        site.signals["message_arrived"] = signals.pop("message_arrived")
        site.show(**signals)


def _environment(site: Site) -> None:
    ports, carrier = dict(site.signals), site.carrier
    if carrier is None:
        # forces act at the tool, also if a law follows another point
        ports["manifold_point"] = ports["closest_point"]
    operator = site.operator if site.scenario.teleoperation is None else None
    reaction = carrier.reaction if isinstance(carrier, Holder) else None
    site.show(**site.around.add(site.builder, ports, operator, reaction))


def _force_sensor(site: Site) -> None:
    scenario = site.scenario
    if scenario.needs_sensor:
        ports = {"true_joint_state": site.signals["true_state"]}
        ports |= {name: site.signals[name] for name in ("wrench_ext",) if name in site.signals}
        failure, part = scenario.simulation.force_sensor_failure, site.robot.part
        sensor = add_force_sensor(site.builder, part, scenario.sensor, failure, site.period, ports)
        site.show(wrench_sensor=sensor)


def _drives(site: Site) -> None:
    scenario, part = site.scenario, site.robot.part
    if site.remote:
        return
    servos, state = site.options.servo, site.robot.initial_state
    signals, site.servo = add_drives(
        site.builder, part, servos, scenario.driver, site.period, site.signals, state
    )
    site.show(**signals)


def _friction(site: Site) -> None:
    categories = ("stop_category", "servo_stop_category")
    stops = [site.signals[name] for name in categories if name in site.signals]
    rubbing = site.options.friction
    part, state = site.robot.part, site.signals["true_state"]
    site.show(**add_friction(site.builder, part, state, rubbing, [] if site.remote else stops))


PARTS: list[Callable[[Site], None]] = [
    *(_controller, _carrier, _obstacles, _waypoints, _operator, _leader),
    *(_environment, _force_sensor, _drives, _friction),
]
