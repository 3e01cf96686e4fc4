"""How long a run may be."""

from diagrams.scenario import Scenario
from diagrams.station import Station
from pfsc_drake.errors import InputError

MAX_TICKS = 1_000_000  # of the controller; 1000 s at 1 kHz
MAX_FRAMES = 50_000  # of a recording; almost half an hour at the default of 32 ms

# of six elastic axes on one core: wall clock time of a tick with its integration [s]
_SECONDS_PER_TICK = 2e-4
# of each logged number: in a container that doubles as it grows, and in the signals made of it
_COPIES = 4
_UNITS = (("years", 365.25 * 86400.0), ("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0))


def check_length(settings: Scenario, station: Station) -> None:
    """Refuse a run of more than MAX_TICKS sampling intervals of the controller.

    Args:
        settings: The scenario, with its duration.
        station: Its station.

    Raises:
        InputError: One line that says how long the run would take, and how much memory.
    """
    period, duration = station.controller.period, settings.duration
    ticks = duration / period
    if ticks <= MAX_TICKS:
        return
    sizes = (rows.stop - rows.start for rows in station.log.rows.values())
    memory = 8.0 * sum(sizes) * ticks * _COPIES
    raise InputError(
        f"duration = {duration:g} s: {ticks:.3g} sampling intervals, about "
        f"{_time(ticks * _SECONDS_PER_TICK)} and {memory / 1e9:.3g} GB of memory; "
        f"allowed: up to {MAX_TICKS * period:g} s (--duration, or duration: in the scenario)"
    )


def check_frames(duration: float, frame_period: float) -> None:
    """Refuse a recording of more than MAX_FRAMES frames.

    Args:
        duration: Simulated time [s].
        frame_period: Time between two frames [s].

    Raises:
        InputError: One line that says which period would do.
    """
    frames = duration / frame_period
    if frames > MAX_FRAMES:
        raise InputError(
            f"simulation.frame_period = {frame_period:g} s: {frames:.3g} frames in "
            f"{duration:g} s; allowed: up to {MAX_FRAMES} (frame_period from "
            f"{duration / MAX_FRAMES:.3g} s on, or --no-recording)"
        )


def _time(seconds: float) -> str:
    """A duration in the largest unit that it fills."""
    for unit, length in _UNITS:
        if not seconds < length:
            return f"{seconds / length:.3g} {unit}"
    return f"{seconds:.3g} s"
