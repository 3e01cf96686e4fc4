"""Analysed instants of a loop along its path, and stiffness margin of a touched surface."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.station import Station
from experiments.studies.margins.loop import STIFFEST, StationLoop, linearize
from pfsc_drake.control.margins import modes

# instants in motion, at equal distances along the path
MOVING = 8
_SAMPLES = 2000
_SLOW = 1e-3  # of the fastest reference: slower is rest
# s, between two checks of progress and faults
_CHUNK = 0.05
# ticks after taring until systems that wait for it have started
_SETTLED = 5


@dataclass(frozen=True)
class Instant:
    """State of the station along its path.

    Attributes:
        time: Time [s].
        eta: Position of the reference [m], one coordinate of a path, two of a surface.
        speed: Its speed [m/s], on a path with its sign.
        section: Context right after the tick.
    """

    time: float
    eta: tuple[float, ...]
    speed: float
    section: Context

    @property
    def location(self) -> str:
        """Speed and position in words."""
        motion = f"at {abs(self.speed):.2g} m/s" if self.speed else "at rest"
        eta = ", ".join(f"{value:.3g}" for value in self.eta)
        return f"{motion}, eta = {eta if len(self.eta) == 1 else f'({eta})'} m"


@dataclass(frozen=True)
class Walk:
    """Simulated run without model error.

    Attributes:
        instants: In order of time.
        fault: Whether a fault ended it.
        tared: Whether a force sensor was tared early.
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
    """Simulate a station and store its state at rest and in motion.

    Args:
        loop: Its loop.
        duration: Length of the run [s].
        progress: Receives the simulated time [s].
        only_start: Whether to store the first instant only.
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
    """Return ticks with position [m] and speed [m/s] of the reference."""
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
    # the end of every rest, where transients have settled
    rests = np.flatnonzero(np.diff(moving.astype(int)) == 1).tolist()
    chosen = {*(rests or [0]), _SAMPLES - 1}
    if moving.any():
        travel = np.cumsum(np.abs(speed))
        quantiles = (np.arange(MOVING) + 0.5) / MOVING
        chosen |= set(np.searchsorted(travel, quantiles * travel[-1]).tolist())
    else:  # motion commanded by an operator
        chosen |= set(np.linspace(0, _SAMPLES - 1, MOVING + 2).astype(int).tolist())
    result = {}
    for sample in sorted(chosen):
        tick = min(max(round(times[sample] / period), 1), last)
        position = tuple(eta[sample].tolist())
        result[tick] = (tick, position, float(speed[sample] if moving[sample] else 0.0))
    return list(result.values())


# resolution of the largest factor
_FINEST = 1.05


@dataclass(frozen=True)
class TouchedSurface:
    """Stiffness margin of a touched surface, with the scenario's model.

    Attributes:
        instant: Instant in contact with the slowest loop.
        force: Contact force [N].
        stiffness: Stiffness of the contact along the normal [N/m].
        largest_factor: Largest factor of the stiffness with a stable loop; infinite if no limit was
            found.
        frequency: Frequency of the unstable mode beyond it [rad/s].
    """

    instant: Instant
    force: float
    stiffness: float
    largest_factor: float
    frequency: float


def touched_surface(
    loop: StationLoop,
    instant: Instant,
    section: Context,
    chosen: np.ndarray,
    progress: Callable[[str], None],
) -> TouchedSurface:
    """Find the stiffest surface with a stable loop, up to a limit, at the same contact force.

    Args:
        loop: The loop.
        instant: Instant in contact.
        section: Its state in the loop's own station.
        chosen: The variables in the loop, in increasing order.
        progress: Progress listener.
    """
    assert loop.spring is not None
    stiffness, force = loop.spring.stiffness, loop.pressed_force(section)
    largest_factor, frequency, factor, step = 0.0, 0.0, 1.0, 2.0
    while largest_factor < STIFFEST and step > _FINEST:
        progress(f"a surface {factor:.3g} times as stiff")
        linear = linearize(loop, loop.stiffened(section, factor * stiffness), chosen)
        found = None if linear is None else modes(linear.A, loop.map.period)
        if found is not None and found.is_stable:
            largest_factor = factor
        else:
            frequency = 0.0 if found is None else found.slowest_frequency
            if largest_factor == 0.0:
                break
            step = float(np.sqrt(step))
        factor = largest_factor * step
    largest_factor = np.inf if largest_factor >= STIFFEST else largest_factor
    return TouchedSurface(instant, force, stiffness, largest_factor, frequency)
