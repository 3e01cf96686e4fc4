"""How stiff a surface that is pressed on may be."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context

from experiments.studies.margins.loop import STIFFEST, StationLoop, linearize
from experiments.studies.margins.walk import Instant
from pfsc_drake.control.margins import modes

# to which factor the stiffest surface that is borne is found
_FINEST = 1.05


@dataclass(frozen=True)
class TouchedSurface:
    """What of a surface that is pressed on the loop bears, the model being as the scenario says.

    Attributes:
        instant: Where: the place in contact with the slowest loop.
        force: With which the tool presses there [N].
        stiffness: Of the spring along the normal that the surface is there [N/m].
        borne: The largest multiple of it that keeps the loop stable; infinite if all that were
            tried do.
        frequency: Of what grows with a little more [rad/s].
    """

    instant: Instant
    force: float
    stiffness: float
    borne: float
    frequency: float


def touched_surface(
    loop: StationLoop,
    instant: Instant,
    section: Context,
    chosen: np.ndarray,
    progress: Callable[[str], None],
) -> TouchedSurface:
    """Find the stiffest surface that a loop bears, up to a limit.

    The force is the same on all of them.

    Args:
        loop: The loop.
        instant: Where it is in contact.
        section: The same as a state of its own station.
        chosen: The variables in the loop, in increasing order.
        progress: Told what is done.
    """
    assert loop.spring is not None
    stiffness, force = loop.spring.stiffness, loop.pressed_force(section)
    borne, frequency, factor, step = 0.0, 0.0, 1.0, 2.0
    while borne < STIFFEST and step > _FINEST:
        progress(f"a surface {factor:.3g} times as stiff")
        linear = linearize(loop, loop.stiffened(section, factor * stiffness), chosen)
        found = None if linear is None else modes(linear.A, loop.map.period)
        if found is not None and found.is_stable:
            borne = factor
        else:
            frequency = 0.0 if found is None else found.slowest_frequency
            if borne == 0.0:
                break
            step = float(np.sqrt(step))
        factor = borne * step
    borne = np.inf if borne >= STIFFEST else borne
    return TouchedSurface(instant, force, stiffness, borne, frequency)
