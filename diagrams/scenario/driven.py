"""What is left of a scenario where the robot stands elsewhere."""

from copy import deepcopy

from diagrams.scenario.checks import require
from diagrams.scenario.schema import Scenario

# blocks of a plant, and what is around it
_OF_THE_PLANT = (
    "forces",
    "pushes",
    "hand",
    "hold_back",
    "friction",
    "drive_friction",
    "notch",
    "workpiece",
)
# laws that want no more of a joint than a driver tells
_OF_ONE_SIDE = ("rigid", "velocity_servo")
_ONE_SIDE = "from_torque or observed: a robot tells one side of its joints"
_TRANSITION = 0.5  # s


# drivers limit how fast torques change: a stop that asks for more swings itself up
_STOP_SHARE, _HOLD_BANDWIDTH = 0.35, 40.0
# with springs between drives and links, so that a stop bears two ticks that nobody knows of
_HOLD_OF_SPRINGS = 20.0


def driven(scenario: Scenario) -> tuple[Scenario, list[str]]:
    """Return a scenario without what belongs to the plant, and what was changed, in words.

    Args:
        scenario: The scenario.

    Raises:
        InputError: If it needs what only a simulation knows.
    """
    left, plain = deepcopy(scenario), Scenario()
    for key in ("plate", "operator"):
        given = getattr(scenario, key) is not None
        require(not given, key, "given", "null where the robot stands elsewhere")
    controller = scenario.controller
    finds_links = controller.law in _OF_ONE_SIDE or controller.state != "measured"
    require(finds_links, "controller.state", controller.state, _ONE_SIDE)
    source = scenario.controller.external_torque.source
    allowed = "none, measured or observed; forces are known in simulation only"
    require(source != "known", "controller.external_torque.source", source, allowed)
    ignored = [key for key in _OF_THE_PLANT if getattr(scenario, key) != getattr(plain, key)]
    for key in ignored:
        setattr(left, key, getattr(plain, key))
    if scenario.encoders != plain.encoders:
        ignored.append("encoders")
    for key in ("sensor_failure", "force_sensor_failure"):
        if getattr(scenario.simulation, key) != getattr(plain.simulation, key):
            setattr(left.simulation, key, getattr(plain.simulation, key))
            ignored.append(f"simulation.{key}")
    said = [f"left to the robot: {', '.join(ignored)}"] if ignored else []
    faults = left.faults
    rigid = controller.law in _OF_ONE_SIDE
    holding = _HOLD_BANDWIDTH if rigid else _HOLD_OF_SPRINGS
    if faults.effort_share > _STOP_SHARE or faults.hold_bandwidth > holding:
        faults.effort_share = min(faults.effort_share, _STOP_SHARE)
        faults.hold_bandwidth = min(faults.hold_bandwidth, holding)
        said.append(
            f"faults.effort_share = {faults.effort_share:g}, faults.hold_bandwidth = "
            f"{faults.hold_bandwidth:g} rad/s: a robot's torques change no faster than its driver "
            "lets them"
        )
    if not rigid and controller.delay is None:
        left.controller.delay = controller.sampling_time
        said.append(
            f"controller.delay = {controller.sampling_time:g} s: a link to a robot costs a tick"
        )
    if left.start.transition == 0.0 and left.controller.manifold != "space":
        left.start.transition = _TRANSITION
        said.append(f"start.transition = {_TRANSITION:g} s: a robot starts smoothly")
    return left, said
