"""Loop at rest with stiction: presliding friction as springs on the motors."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.scenario import Scenario
from experiments.studies.margins.box import smooth, without_error
from experiments.studies.margins.loop import StationLoop, linearize
from pfsc_drake.control.margins import modes

# rad or m, of gears: from stiff to soft
PRESLIDINGS = (1e-6, 1e-5, 1e-4)
# accuracy of the integration of bristles; the map has its own steps
_ACCURACY = 1e-6
# ticks after which all sampled systems have been updated
_TICKS = 5


@dataclass(frozen=True)
class StuckDrives:
    """Loop at the start, with all motors held by friction.

    Attributes:
        presliding: Displacement at which the motors would slide [rad or m].
        rate: Rate of the slowest or most unstable mode [1/s].
        frequency: Its frequency [rad/s].
        held: Whether torques are held at rest, so that the loop is open there.
    """

    presliding: float
    rate: float
    frequency: float
    held: bool


def stuck_drives(
    settings: Scenario, folder: Path, joints: int, progress: Callable[[str], None]
) -> StuckDrives | None:
    """Return the worst loop with stiction over several presliding displacements.

    Bristles within their limits are a spring ``f_c / delta`` and a damper, so that friction is
    differentiable at rest. The nominal model is exact.

    Args:
        settings: The scenario as read.
        folder: Base folder of relative file names.
        joints: Number of drives.
        progress: Progress listener.

    Returns:
        The loop; None without simulated or compensated friction.

    Raises:
        InputError: If the scenario cannot be built.
    """
    compensation = settings.controller.friction
    if not settings.friction.is_given or compensation.source == "none":
        return None
    smoothed = without_error(smooth(settings)[0])
    smoothed.friction = deepcopy(settings.friction)
    smoothed.controller.friction = deepcopy(compensation)
    smoothed.controller.friction.hold_at_rest = False
    smoothed.simulation.accuracy = _ACCURACY
    found = []
    for presliding in PRESLIDINGS:
        progress(f"stiction, presliding {1e6 * presliding:g} urad")
        smoothed.friction.presliding = [presliding] * joints
        loop = StationLoop(smoothed, folder)
        section = _start(loop)
        linear = linearize(loop, section, loop.variables_in_loop([section]))
        if linear is None:
            continue
        worst = modes(linear.A, loop.map.period)
        found.append(
            StuckDrives(
                presliding, worst.slowest, worst.slowest_frequency, compensation.hold_at_rest
            )
        )
    return max(found, key=lambda stuck: stuck.rate, default=None)


def _start(loop: StationLoop) -> Context:
    """Return the state right after the first ticks, before instabilities develop."""
    simulator = Simulator(loop.station.diagram)
    loop.configure(simulator)
    root = simulator.get_mutable_context()
    loop.station.set_start(root)
    simulator.Initialize()
    simulator.AdvanceTo(_TICKS * loop.map.period)
    if loop.needs_taring(root):
        loop.tare(root, np.zeros(6))
        simulator.AdvanceTo(2 * _TICKS * loop.map.period)
    simulator.AdvancePendingEvents()
    return root.Clone()


def sticking_sentence(stuck: StuckDrives) -> str:
    """Return a sentence about the loop with stiction.

    Args:
        stuck: The worst loop.
    """
    verb = "decays with" if stuck.rate <= 0.0 else "grows with"
    mode = f"{verb} {abs(stuck.rate):.3g} 1/s at {stuck.frequency / (2.0 * np.pi):.3g} Hz"
    where = f"with motors held by friction (presliding {1e6 * stuck.presliding:g} urad)"
    if stuck.rate <= 0.0:
        return f"At rest, {where}, the law's loop is stable: it {mode}."
    if stuck.held:
        return (
            f"At rest, {where}, the law's loop would be unstable: it {mode}; torques are held "
            "there (controller.friction.hold_at_rest)."
        )
    return (
        f"At rest, {where}, the loop is unstable: it {mode}; write "
        "controller.friction.hold_at_rest = true."
    )
