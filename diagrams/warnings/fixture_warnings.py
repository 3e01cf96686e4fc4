"""What is said beforehand of regions that give way, and of paths that attract."""

import math
from collections.abc import Mapping, Sequence

from diagrams.scenario.virtual_fixtures import FixtureParameters
from pfsc_drake.control.fixtures.fixture_parameters import bearable_stiffness
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.fixtures.lead import ServoLead
from pfsc_drake.controller.tasks.space_task import SpaceTask


def stiff_fixtures(fixtures: FixtureParameters, task: SpaceTask) -> list[str]:
    """Return which soft regions and guides may ring behind servos, one sentence each.

    Args:
        fixtures: What the regions and guides are.
        task: Task of the tool.
    """
    motion, lead = task.admittance, task.lead
    if not isinstance(lead, ServoLead):
        return []
    lag = lead.lag
    most = bearable_stiffness(motion, lag)
    springs = {
        f"regions[{number}]": (region.stiffness, "region", "softer or hard")
        for number, region in enumerate(fixtures.regions)
        if region.stiffness is not None
    }
    for number, guide in enumerate(fixtures.guides):
        springs[f"guides[{number}]"] = guide.stiffness, "guide", "softer"
    return [
        f"fixtures.{key}.stiffness = {stiffness:g} N/m: compliance.tangential with "
        f"{motion.damping:g} N s/m bears {most:.2g} N/m where servos and bus, {1e3 * lag:.2g} ms, "
        f"are later than believed by a fifth or a tick; a stiffer {kind} may ring: make it "
        f"{cure}, or the damping larger"
        for key, (stiffness, kind, cure) in springs.items()
        if stiffness > most
    ]


def firm_guides(guides: Mapping[str, Guide], forces: Sequence[float]) -> list[str]:
    """Return which guides a hand is too weak to leave, one sentence each.

    Args:
        guides: The paths that attract, by name.
        forces: Largest forces of the hands [N].
    """
    largest = max(forces, default=math.inf)
    return [
        f"fixtures.guides[{number}] ({name}): {guide.largest_force:.3g} N are needed to leave it, "
        f"and the hand has {largest:.3g} N: less stiffness or reach lets it go"
        for number, (name, guide) in enumerate(guides.items())
        if guide.largest_force > largest
    ]
