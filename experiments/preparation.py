"""Preparation of a run: all checks of the input before anything moves."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from diagrams.builder import build_station, draw_station
from diagrams.drawing.robot_geometry import RobotDrawing
from diagrams.integration import Integration
from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.integration import choose_integration
from experiments.results.requirements import check_targets
from experiments.scenario_file import ScenarioFile
from pfsc_drake.checks import require
from pfsc_drake.errors import InputError, nearest_file, shorten
from pfsc_drake.yaml.dumping import dump_typed
from pfsc_drake.yaml.reading import resolve_files
from pfsc_drake.yaml.source import Source
from pfsc_drake.yaml.typed import collected_renames, load_typed
from reporting.progress import ProgressListener

MAX_TICKS = 1_000_000  # of the controller; 1000 s at 1 kHz
MAX_FRAMES = 50_000  # of a recording; almost half an hour at the default of 32 ms
# of six elastic axes on one core: wall clock time of a tick with its integration [s]
_SECONDS_PER_TICK = 2e-4
# of each logged number: in a container that doubles as it grows, in signals, and in figures
_COPIES = 8
_MEMORY = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")  # bytes of this machine
LONGEST_SESSION = 600.0  # s, of a live one, unless it is given
_UNITS = (("years", 365.25 * 86400.0), ("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0))


@dataclass(frozen=True)
class PreparedRun:
    """A run that is ready to start.

    Attributes:
        settings: The scenario as resolved.
        text: The same as YAML.
        station: The station.
        integration: Integration of its plant.
        drawing: Geometry of the robot for drawing, if needed.
        warnings: Warnings, one sentence each.
    """

    settings: Scenario
    text: str
    station: Station
    integration: Integration
    drawing: RobotDrawing | None
    warnings: list[str]


def prepare(
    scenario: ScenarioFile,
    duration: float | None,
    *,
    recording: bool,
    progress: ProgressListener,
    live: bool = False,
) -> PreparedRun:
    """Build a scenario's station and perform all checks before the run.

    Args:
        scenario: The scenario as read.
        duration: Simulated time [s] instead of the scenario's, or of a live session's
            LONGEST_SESSION or what the memory of this machine allows.
        recording: Whether the motion will be recorded.
        progress: Progress listener.
        live: Whether a person takes the place of the simulated operator.

    Raises:
        InputError: If the scenario is wrong.
    """
    with collected_renames() as renames:
        settings = load_typed(Scenario, scenario.data, scenario.source)
    folder = scenario.path.parent
    with naming(scenario.source):
        unattended = settings.operator is not None and not settings.operator.inputs and not live
        require(not unattended, "operator.inputs", "''", "a file that a live session has recorded")
        station = _build(settings, folder, progress)
        if live and duration is None:
            duration = min(LONGEST_SESSION, _longest(station))
        settle(settings, scenario.name, station, duration, recording=recording)
        progress(0.0, "choosing the integration")
        station, integration = _integrated(settings, folder, station)
        drawing, warnings = look_at(settings, folder, station, recording=recording)
    resolve_files(settings, folder)
    text = dump_typed(settings)
    return PreparedRun(settings, text, station, integration, drawing, renames + warnings)


def look_at(
    settings: Scenario, folder: Path, station: Station, *, recording: bool
) -> tuple[RobotDrawing | None, list[str]]:
    """Return the geometry of a station's robot for drawing, and all warnings before the run.

    The geometry is needed for a recording, and for the distance to obstacles.

    Args:
        settings: The scenario.
        folder: Base folder of relative file names.
        station: Its station.
        recording: Whether the motion will be recorded.
    """
    needed = recording or settings.obstacles is not None
    drawing = draw_station(settings, folder, station) if needed else None
    return drawing, station.warnings + (drawing.warnings if drawing else [])


def settle(
    settings: Scenario, name: str, station: Station, duration: float | None, *, recording: bool
) -> None:
    """Set name and times of a scenario, and check the entries that depend on them.

    Args:
        settings: The scenario, which is changed.
        name: Name for a scenario without one.
        station: Its station.
        duration: Duration [s] instead of the scenario's.
        recording: Whether the motion will be recorded.

    Raises:
        InputError: If targets are wrong, or the run is too long.
    """
    check_targets(settings, station)
    settings.name = settings.name or name
    length = settings.duration or station.reference_duration
    settings.duration = duration or length
    settings.judged_after = settings.judged_after or length
    check_length(settings, station)
    if recording:
        check_frames(settings.duration, settings.simulation.frame_period)


def _build(settings: Scenario, folder: Path, progress: ProgressListener) -> Station:
    def report(fraction: float, phase: str) -> None:
        progress(0.0, f"{phase}, {fraction:.0%}")

    return build_station(settings, folder, report)


def _integrated(settings: Scenario, folder: Path, station: Station) -> tuple[Station, Integration]:
    """Choose the integration, and return a station built for it, with the integration.

    The settings then name scheme and step, so that the resolved scenario reproduces the run.
    """
    integration = choose_integration(station, settings.simulation, settings.reference.dwell)
    longest = min(settings.simulation.max_step, station.controller.period)
    settings.simulation = integration.applied_to(settings.simulation)
    if integration.step < longest:  # friction depends on the step
        station = build_station(settings, folder, like=station)
    return station, integration


@contextmanager
def naming(source: Source) -> Iterator[None]:
    """Prefix error messages with the scenario's file, and the line of the key they begin with."""
    try:
        yield
    except InputError as error:
        raise source.refusal([str(error)]) from None
    except OSError as error:  # of a file that the scenario names
        name = shorten(str(error.filename), 100)
        nearest = (
            nearest_file(Path(str(error.filename))) if isinstance(error, FileNotFoundError) else ""
        )
        raise source.refusal([f"cannot read {name}: {error.strerror}{nearest}"]) from None


def check_length(settings: Scenario, station: Station) -> None:
    """Reject a run that takes too many sampling intervals or too much memory.

    Args:
        settings: The scenario, with its duration.
        station: Its station.

    Raises:
        InputError: With the computing time and memory that the run would need.
    """
    period, duration, longest = station.controller.period, settings.duration, _longest(station)
    if duration <= longest:
        return
    ticks = duration / period
    raise InputError(
        f"duration = {duration:g} s: {ticks:.3g} sampling intervals, about "
        f"{_time(ticks * _SECONDS_PER_TICK)} and {ticks * _tick_memory(station) / 1e9:.3g} GB of "
        f"memory; allowed: up to {longest:g} s (--duration, or duration: in the scenario)"
    )


def _longest(station: Station) -> float:
    """Return the longest duration of a run on this machine [s]."""
    ticks = min(MAX_TICKS, _MEMORY // _tick_memory(station))
    return ticks * station.controller.period


def _tick_memory(station: Station) -> float:
    """Return the memory of a sampling interval up to the drawing of figures [B]."""
    return 8.0 * _COPIES * sum(rows.stop - rows.start for rows in station.log.rows.values())


def check_frames(duration: float, frame_period: float) -> None:
    """Reject a recording of more than MAX_FRAMES frames.

    Args:
        duration: Simulated time [s].
        frame_period: Time between two frames [s].

    Raises:
        InputError: With an admissible period.
    """
    frames = duration / frame_period
    if frames > MAX_FRAMES:
        raise InputError(
            f"simulation.frame_period = {frame_period:g} s: {frames:.3g} frames in "
            f"{duration:g} s; allowed: up to {MAX_FRAMES} (frame_period from "
            f"{duration / MAX_FRAMES:.3g} s on, or --no-recording)"
        )


def _time(seconds: float) -> str:
    """Return a duration in the largest unit that it exceeds."""
    for unit, length in _UNITS:
        if not seconds < length:
            return f"{seconds / length:.3g} {unit}"
    return f"{seconds:.3g} s"
