"""What a log and a person are told of a tool that is led by hand."""

from diagrams.scenario import Scenario
from diagrams.tasks.space_guidance import lead_of
from pfsc_drake.control.fixtures.parameters import bearable_stiffness
from pfsc_drake.control.fixtures.record import Mode
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.following.fixtures import free_motion

# names of the values of the logged signal ``mode``
MODES = tuple(mode.name.lower() for mode in Mode)


def stiff_regions(scenario: Scenario) -> list[str]:
    """Return which soft regions may ring behind servos, one sentence each.

    Args:
        scenario: The scenario.
    """
    fixtures, servos = scenario.fixtures, RELATIVE_DEGREE[scenario.controller.law] == 1
    if fixtures is None or not servos or scenario.controller.manifold != "space":
        return []
    motion = free_motion(scenario.compliance, scenario.controller.sampling_time)
    lag = lead_of(scenario).lag
    most = bearable_stiffness(motion, lag)
    return [
        f"fixtures.regions[{number}].stiffness = {region.stiffness:g} N/m: compliance.tangential "
        f"with {motion.damping:g} N s/m bears {most:.2g} N/m where servos and bus, "
        f"{1e3 * lag:.2g} ms, are later than believed by a fifth or a tick; a stiffer region may "
        "ring: make it softer or hard, or the damping larger"
        for number, region in enumerate(fixtures.regions)
        if region.stiffness is not None and region.stiffness > most
    ]
