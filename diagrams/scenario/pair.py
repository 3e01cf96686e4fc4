"""A scenario of two robots: the scenario of the workpiece robot, and excluded combinations."""

import dataclasses as dc

from diagrams.scenario.schema import Scenario
from diagrams.scenario.streamed import Streamed
from pfsc_drake.checks import require


def holder_scenario(scenario: Scenario) -> Scenario:
    """Return the scenario of the workpiece robot alone.

    Args:
        scenario: A scenario with ``holder``.
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


# blocks that need a fixed workpiece or a single robot
_BESIDE_HOLDER = (
    *("pushes", "hand", "operator", "hold_back", "servo", "driver", "compliance"),
    *("notch", "workpiece", "plate", "teleoperation", "obstacles"),
)


def check_carrier(scenario: Scenario, *, simulated: bool = True) -> None:
    """Refuse blocks that exclude a moving workpiece, if the scenario has one.

    Args:
        scenario: The scenario.
        simulated: Whether its station is simulated: not for margins, nor for a robot in another
            process.

    Raises:
        InputError: If there is such a block.
    """
    if scenario.holder is None and scenario.turntable is None:
        return
    plain, manifold = Scenario(), scenario.controller.manifold
    both = scenario.holder is not None and scenario.turntable is not None
    require(not both, "turntable", "given", "null where a robot holds the workpiece")
    carrier = "holder" if scenario.turntable is None else "turntable"
    allowed = "null for margins, and for a robot in another process"
    require(simulated, carrier, "given", allowed)
    for key in _BESIDE_HOLDER:
        is_set = getattr(scenario, key) != getattr(plain, key)
        require(not is_set, key, "given", f"left out with a {carrier}")
    allowed = f"path, trajectory or surface with a {carrier}"
    require(manifold != "space", "controller.manifold", manifold, allowed)
    controller = scenario.controller
    for i, pulse in enumerate(scenario.forces):
        allowed = f"empty with a {carrier}: forces act between workpiece and tool"
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
