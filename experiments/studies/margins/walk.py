"""Where on its way a loop is looked at; how stiff a surface may be that it touches there."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.station import Station
from experiments.studies.margins.loop import STIFFEST, StationLoop, linearize
from pfsc_drake.control.margins import modes

# instants in motion, at equal distances along the way
MOVING = 8
_SAMPLES = 2000
_SLOW = 1e-3  # of the fastest reference: slower is rest
# s, between two looks at progress and faults
_CHUNK = 0.05
# ticks after which what waits for a force sensor to be tared has set off
_SETTLED = 5


@dataclass(frozen=True)
class Instant:
    """A state of the station on its way.

    Attributes:
        time: [s].
        eta: Where the reference is [m], one coordinate of a path, two of a surface.
        speed: Its speed [m/s], on a path with its sign.
        section: Context right after the tick.
    """

    time: float
    eta: tuple[float, ...]
    speed: float
    section: Context

    @property
    def place(self) -> str:
        """In words."""
        motion = f"at {abs(self.speed):.2g} m/s" if self.speed else "at rest"
        eta = ", ".join(f"{value:.3g}" for value in self.eta)
        return f"{motion}, eta = {eta if len(self.eta) == 1 else f'({eta})'} m"


@dataclass(frozen=True)
class Walk:
    """A run without model error.

    Attributes:
        instants: In order of time.
        fault: Whether a fault ended it.
        tared: Whether a force sensor was tared before it would have been.
    """

    instants: list[Instant]
    fault: bool
    tared: bool = False


def walk(
    loop: StationLoop,
    duration: float,
    progress: Callable[[float], None],
    *,
    only_start: bool = False,
) -> Walk:
    """Run a station and keep its state at rest and in motion.

    Args:
        loop: Its loop.
        duration: Length of the run [s].
        progress: Told the simulated time [s].
        only_start: Whether to keep the first instant alone.
    """
    station, simulator = loop.station, Simulator(loop.station.diagram)
    loop.configure(simulator)
    root, period = simulator.get_mutable_context(), loop.map.period
    station.set_start(root)
    simulator.Initialize()
    instants: list[Instant] = []
    chosen = _chosen_ticks(station, duration)
    tared = False
    for tick, eta, speed in chosen[:1] if only_start else chosen:
        now = round(root.get_time() / period)
        if tick <= now:
            continue
        stride = max(1, round(_CHUNK / period))
        for goal in [*range(now + stride, tick, stride), tick]:
            simulator.AdvanceTo(goal * period)
            progress(root.get_time())
            if loop.has_failed(root):
                return Walk(instants, True, tared)
        simulator.AdvancePendingEvents()
        if loop.needs_taring(root):
            loop.tare(root, np.zeros(6))
            tick, tared = tick + _SETTLED, True
            simulator.AdvanceTo(tick * period)
            if loop.has_failed(root):
                return Walk(instants, True, tared)
            simulator.AdvancePendingEvents()
        instants.append(Instant(tick * period, eta, speed, root.Clone()))
    return Walk(instants, False, tared)


def _chosen_ticks(station: Station, duration: float) -> list[tuple[int, tuple[float, ...], float]]:
    """Return ticks with place [m] and speed [m/s] of the reference."""
    motion, period = station.task.motion, station.controller.period
    assert motion is not None  # of a station's task
    last = max(int(duration / period + 1e-6) - 1, 1)
    times = np.linspace(period, last * period, _SAMPLES)
    inside = np.clip(times, *motion.domain)
    eta, velocity = np.moveaxis(motion.derivatives(inside, 1), 1, 0)
    speed = velocity[:, 0] if motion.dimension == 1 else np.linalg.norm(velocity, axis=1)
    speed = np.where(times > motion.domain[1], 0.0, speed)
    fastest = np.max(np.abs(speed))
    moving = np.abs(speed) > _SLOW * fastest if fastest > 0.0 else np.zeros(_SAMPLES, dtype=bool)
    # the end of every rest, where what came before has settled
    rests = np.flatnonzero(np.diff(moving.astype(int)) == 1).tolist()
    chosen = {*(rests or [0]), _SAMPLES - 1}
    if moving.any():
        way = np.cumsum(np.abs(speed))
        quantiles = (np.arange(MOVING) + 0.5) / MOVING
        chosen |= set(np.searchsorted(way, quantiles * way[-1]).tolist())
    else:  # led by somebody else
        chosen |= set(np.linspace(0, _SAMPLES - 1, MOVING + 2).astype(int).tolist())
    result = {}
    for sample in sorted(chosen):
        tick = min(max(round(times[sample] / period), 1), last)
        place = tuple(eta[sample].tolist())
        result[tick] = (tick, place, float(speed[sample] if moving[sample] else 0.0))
    return list(result.values())


# to which factor the stiffest surface that is borne is found
_FINEST = 1.05


@dataclass(frozen=True)
class TouchedSurface:
    """What of a surface that is pressed on the loop bears, the model being as the scenario says.

    Attributes:
        instant: Where: the place in contact with the slowest loop.
        force: With which the tool presses there [N].
        stiffness: Stiffness of the spring along the normal that the surface is there [N/m].
        borne: The largest multiple of it that keeps the loop stable; infinite if all that were
            tried do.
        frequency: Frequency of the mode that grows with a little more [rad/s].
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
