"""Margins of a scenario's closed loop along its path, nominal and over a box of model errors."""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydrake.systems.framework import Context

from diagrams.period_map import RestSlope
from diagrams.robots.part import RobotPart
from diagrams.scenario import Scenario
from diagrams.station_options import StationOptions
from experiments.studies.margins.box import (
    Error,
    ErrorBox,
    corners,
    single_errors,
    smooth,
    without_error,
)
from experiments.studies.margins.loop import LinearLoop, StationLoop, linearize
from experiments.studies.margins.result import Case, DriveMargins, MarginAnalysis, OperatingPoint
from experiments.studies.margins.sticking import stuck_drives
from experiments.studies.margins.walk import Instant, TouchedSurface, Walk, touched_surface, walk
from pfsc_drake.control.margins import (
    BrokenLoop,
    common_disc_margin,
    delay_margin,
    disc_margins,
    modes,
)
from pfsc_drake.errors import InputError
from reporting.progress import ProgressListener

# number of weakest instants at which all corners of the box are tried
_CORNER_INSTANTS = 2


def analyse(
    settings: Scenario,
    folder: Path,
    box: ErrorBox,
    progress: ProgressListener,
    *,
    only_start: bool = False,
) -> MarginAnalysis:
    """Linearize a scenario's loop along its path and over a box of model errors.

    Args:
        settings: The scenario as read.
        folder: Base folder of relative file names.
        box: Errors to tolerate in addition to the scenario's own.
        progress: Progress listener.
        only_start: Whether to analyse the start only, without corners of the box; takes a third of
            the time.

    Raises:
        InputError: If the scenario cannot be built.
    """
    smoothed, removed = smooth(settings)
    progress(0.0, "building")
    exact_loop = StationLoop(without_error(smoothed), folder)
    station = exact_loop.station
    duration = settings.duration or station.reference_duration
    progress.expect(duration)
    remarks: list[str] = []
    singles, wrong_together = _feasible_errors(box, smoothed, station.part, folder, remarks)
    run = walk(
        exact_loop,
        duration,
        lambda time: progress(time, "evaluating the path"),
        only_start=only_start,
    )
    if not run.instants:
        raise InputError("the law has a fault before its first tick; run the scenario for details")
    study = _Study(smoothed, folder, exact_loop, run, progress, duration)
    errs = smoothed.model_error.is_given or bool(smoothed.controller.model)
    progress(0.0, "differentiating")
    study.is_parametric = exact_loop.parametrize(smoothed, folder)
    own = study.build(Error()) if errs or study.is_parametric else exact_loop
    sections = [run.instants[i] for i in {0, len(run.instants) // 2}]
    study.chosen = own.variables_in_loop([study.section(own, instant) for instant in sections])
    nominal, loops = study.case(own, Error(), run.instants)
    analysis = MarginAnalysis(
        period=own.map.period,
        joints=station.robot.names,
        box=box,
        nominal=nominal,
        drives_are_servos=own.drives_are_servos,
        remarks=_remarks(removed, run, own) + remarks,
    )
    if not only_start:
        analysis.surface = study.touched_surface(own, nominal)
        joints = station.robot.dimension
        analysis.stuck = stuck_drives(settings, folder, joints, lambda what: progress(0.0, what))
    for instant, loop in zip(run.instants, loops, strict=True):
        progress(instant.time, "margins of the drives")
        if loop is not None:
            analysis.margins.append(_drive_margins(instant, loop, own.map.period))
    unknown = settings.sensor.unknown_mass if settings.compliance.needs_sensor else 0.0
    if unknown > 0.0:
        with _reporting("sensor.unknown_mass", analysis.remarks):
            case, _ = study.case(own, Error((), unknown), run.instants)
            analysis.singles.append(Case(case.error, "unknown_mass", case.points))
    for key, error in singles:
        with _reporting(f"model_error.{key}", analysis.remarks):
            case, _ = study.case(study.build(error), error, run.instants)
            analysis.singles.append(Case(error, key, case.points))
    weak = _weakest_instants(analysis)
    known = {case.key for case in analysis.singles}
    for error in () if only_start else wrong_together:
        if all(key in known for key, _ in error.parts):
            analysis.corners.append(study.case(study.build(error), error, weak)[0])
    progress(duration, "done")
    return analysis


def _feasible_errors(
    box: ErrorBox, settings: Scenario, part: RobotPart, folder: Path, remarks: list[str]
) -> tuple[list[tuple[str, Error]], list[Error]]:
    """Return the physically possible errors of the box, single and combined.

    Args:
        box: The box.
        settings: The scenario.
        part: Its robot.
        folder: Base folder of relative file names.
        remarks: Receives a sentence about each omitted error.
    """
    elastic, singles = not part.robot.is_rigid, []
    for key, error in single_errors(box, elastic):
        try:
            _check_nominal_model(part, error.applied_to(settings), folder)
        except InputError as refusal:
            remarks.append(f"{error}: omitted, {refusal}")
        else:
            singles.append((key, error))
    known = [one for _, error in singles for one in error.parts]
    together = []
    for error in corners(box, elastic):
        with contextlib.suppress(InputError):
            if all(one in known for one in error.parts):
                _check_nominal_model(part, error.applied_to(settings), folder)
                together.append(error)
    return singles, together


def _check_nominal_model(part: RobotPart, settings: Scenario, folder: Path) -> None:
    joint = settings.sensor.joint if settings.needs_sensor else None
    part.check_nominal_model(StationOptions(settings, folder).nominal_model_source, joint)


@dataclass
class _Study:
    """Data shared by all loops of a study."""

    settings: Scenario
    folder: Path
    exact_loop: StationLoop
    run: Walk
    progress: ProgressListener
    duration: float
    is_parametric: bool = False
    chosen: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    # slopes of systems other than blocks, by time of the instant
    plants: dict[float, Sequence[RestSlope]] = field(default_factory=dict)

    def build(self, error: Error) -> StationLoop:
        self.progress(0.0, f"linearizing, {error}")
        erring = error.applied_to(self.settings)
        if self.is_parametric:
            return self.exact_loop.with_nominal_model(erring, self.folder)
        return StationLoop(erring, self.folder, self.exact_loop)

    def section(self, loop: StationLoop, instant: Instant, unknown: float = 0.0) -> Context:
        """Return an instant as a state of a loop's own station, with an unknown mass [kg]."""
        if loop.station is self.exact_loop.station and unknown == 0.0:
            return instant.section
        section, load = (
            loop.map.adopted(instant.section),
            self.exact_loop.external_load(instant.section),
        )
        if unknown > 0.0:
            loop.hang(section, self.settings.sensor.joint, unknown)
        if load is not None:
            loop.tare(section, load)
        return section

    def case(
        self, loop: StationLoop, error: Error, instants: Sequence[Instant]
    ) -> tuple[Case, list[LinearLoop | None]]:
        """Return the modes of a loop along its path, and the linear loop at each instant."""
        loops = []
        for instant in instants:
            self.progress(instant.time, f"linearizing, {error}")
            section = self.section(loop, instant, error.unknown_mass)
            is_same = loop.rest_is_physics and error.unknown_mass == 0.0
            plant = self.plants.get(instant.time, ()) if is_same else ()
            loops.append(linearize(loop, section, self.chosen, plant))
            if is_same and loops[-1] is not None:
                self.plants[instant.time] = loops[-1].rest
        points = [
            OperatingPoint(instant, None if linear is None else modes(linear.A, loop.map.period))
            for instant, linear in zip(instants, loops, strict=True)
        ]
        return Case(error, "", points), loops

    def touched_surface(self, loop: StationLoop, nominal: Case) -> TouchedSurface | None:
        """Return the stiffness margin of a touched surface at the slowest loop, if there is one."""
        pressed = [
            point
            for point in nominal.points
            if self.exact_loop.pressed_force(point.instant.section) > 0.0
        ]
        if not pressed:
            return None
        instant = max(pressed, key=lambda point: point.rate).instant
        return touched_surface(
            loop,
            instant,
            self.section(loop, instant),
            self.chosen,
            lambda phase: self.progress(instant.time, phase),
        )


def _drive_margins(instant: Instant, loop: LinearLoop, period: float) -> DriveMargins:
    A, holds = loop.A, loop.holds
    broken = BrokenLoop(A, holds, period)
    return DriveMargins(
        instant,
        disc_margins(broken),
        common_disc_margin(broken),
        delay_margin(A, holds, period),
    )


def _weakest_instants(analysis: MarginAnalysis) -> list[Instant]:
    """Return the instants with the worst single errors, and the first at rest."""
    instants = [point.instant for point in analysis.nominal.points]
    cases = [analysis.nominal, *analysis.singles]
    rates = np.max([[point.rate for point in case.points] for case in cases], axis=0)
    order = np.argsort(-rates)[:_CORNER_INSTANTS]
    return [instants[i] for i in sorted({0, *order.tolist()})]


@contextlib.contextmanager
def _reporting(key: str, remarks: list[str]) -> Iterator[None]:
    """Omit a parameter that a robot does not have, with a remark."""
    try:
        yield
    except InputError as error:
        remarks.append(f"{key} is omitted: {error}")


def _remarks(removed: Sequence[str], run: Walk, loop: StationLoop) -> list[str]:
    remarks = []
    if run.tared:
        remarks.append(
            "At the start the force sensor would not be tared yet; the analysis assumes it is."
        )
    if loop.spring is not None:
        remarks.append(
            "The contact with the workpiece is a spring along its normal, without friction and "
            "damping."
        )
    elif loop.station.workpiece is not None:
        remarks.append(
            "Contact forces of the plant lag by one step; this lag is neglected, so that rates "
            "near "
            "zero are not reliable."
        )
    if removed:
        remarks.append(f"Omitted, as not differentiable or external: {', '.join(removed)}.")
    if run.fault:
        time = run.instants[-1].time
        remarks.append(
            f"With a perfect model the run ends with a fault soon after t = {time:.3g} s; "
            "later instants were not analysed."
        )
    return remarks
