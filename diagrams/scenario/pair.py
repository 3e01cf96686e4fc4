"""A scenario of two robots: that of the one which holds the workpiece, and what does not go."""

import dataclasses as dc

from diagrams.scenario.schema import Scenario
from diagrams.scenario.streamed import Streamed
from pfsc_drake.checks import require


def holder_scenario(scenario: Scenario) -> Scenario:
    """Return the scenario of the robot that holds the workpiece alone.

    Args:
        scenario: One with a holder.
    """
    holder = scenario.holder
    assert holder is not None
    alone = dc.replace(scenario.simulation, sensor_failure=holder.sensor_failure)
    return Scenario(
        robot=holder.robot,
        path=holder.path,
        controller=holder.controller,
        model_error=holder.model_error,
        reference=holder.reference,
        start=holder.start,
        simulation=alone,
        friction=holder.friction,
        encoders=holder.encoders,
        faults=holder.faults,
        forces=scenario.forces,
    )


# what acts where the world's axes or one robot alone are meant
_BESIDE_HOLDER = (
    *("pushes", "hand", "operator", "hold_back", "servo", "driver", "compliance"),
    *("notch", "workpiece", "plate", "teleoperation", "obstacles"),
)


def check_carrier(scenario: Scenario, *, simulated: bool = True) -> None:
    """Refuse what does not go with a workpiece that moves, if it is one.

    Args:
        scenario: The scenario.
        simulated: Whether its station is for a simulation, not for margins nor a robot elsewhere.

    Raises:
        InputError: If there is something of the kind.
    """
    if scenario.holder is None and scenario.turntable is None:
        return
    plain, manifold = Scenario(), scenario.controller.manifold
    both = scenario.holder is not None and scenario.turntable is not None
    require(not both, "turntable", "given", "null where a holder has the workpiece")
    carrier = "holder" if scenario.turntable is None else "turntable"
    allowed = "null where margins are told, or a robot is driven elsewhere"
    require(simulated, carrier, "given", allowed)
    for key in _BESIDE_HOLDER:
        given = getattr(scenario, key) != getattr(plain, key)
        require(not given, key, "given", f"left out where a {carrier} has the workpiece")
    allowed = f"path, trajectory or surface where a {carrier} has the workpiece"
    require(manifold != "space", "controller.manifold", manifold, allowed)
    controller = scenario.controller
    for i, pulse in enumerate(scenario.forces):
        allowed = f"empty where a {carrier} has the workpiece: forces are between it and the tool"
        require(not pulse.link, f"forces[{i}].link", f"'{pulse.link}'", allowed)
    allowed = f"null, with a {carrier}"
    require(controller.delay is None, "controller.delay", controller.delay, allowed)
    speed, streamed = scenario.reference.speed, isinstance(scenario.path.shape, Streamed)
    require(speed == "asked", "reference.speed", speed, f"asked, with a {carrier}")
    known = f"a path that is known, with a {carrier}"
    require(not streamed, "path.shape", "!Streamed", known)
    if scenario.holder is not None:
        own = isinstance(scenario.holder.path.shape, Streamed)
        require(not own, "holder.path.shape", "!Streamed", known)
