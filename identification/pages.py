"""Pages of an identification in folders."""

from pathlib import Path

import numpy as np

from identification.consistency.bounds import PhysicalBounds, bounds_of
from identification.consistency.nearest import ConsistentParameters
from identification.estimation.results import FILE_NAME, save_estimate
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.recording import record_excitation
from identification.excitation.scene import cell_of
from identification.findings import Findings, consistent_set, stored_findings
from identification.measurement.experiment import prepare_motion
from identification.measurement.files import read_record
from identification.measurement.periods import AveragedMotion, friction_trend
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from identification.options import PageOptions
from identification.report.identification_page import PageContent, write_page
from identification.steps import RECORDING, MeasuredFiles, estimate_files
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from reporting.folder import ResultsFolder, open_results
from reporting.page import Report


def identify(
    subject: Subject,
    files: MeasuredFiles,
    folder: Path,
    shown: PageOptions,
    *,
    plain: bool,
    simulated: bool,
    progress: Progress,
) -> tuple[Findings, Report]:
    """Estimate base parameters from files, and write ``identification.h5`` and a page.

    Args:
        subject: The robot.
        files: Files with measured motions.
        folder: Folder of the results.
        shown: Further content of the page.
        plain: Whether there is Coulomb and viscous friction only.
        simulated: Whether the robot's model is the ground truth.
        progress: Receives the completed fraction and the current step.
    """
    findings, other = estimate_files(
        subject, files, choose=not plain, simulated=simulated, progress=progress
    )
    with open_results(folder, "identification", files.paths) as results:
        save_estimate(folder / FILE_NAME, findings.estimate, findings.runs)
        warnings = _warnings(findings)
        return findings, _write(results, subject, findings, other, shown, warnings)


def write_stored(
    subject: Subject,
    source: Path,
    validation: Path | None,
    shown: PageOptions,
    simulated: bool,
    folder: Path,
) -> Report:
    """Write a page about a stored identification.

    Args:
        subject: The robot.
        source: Folder with ``identification.h5``, or the file.
        validation: Record of a motion that was not used.
        shown: Further content of the page.
        simulated: Whether the robot's model is the ground truth.
        folder: Folder of the page.
    """
    other = None
    if validation is not None:
        other = prepare_motion(read_record(validation, subject), Regressor(subject))
    findings = stored_findings(subject, source, other, simulated)
    with open_results(folder, "identification") as results:
        return _write(results, subject, findings, other, shown, [])


def _write(
    results: ResultsFolder,
    subject: Subject,
    findings: Findings,
    other: AveragedMotion | None,
    shown: PageOptions,
    warnings: list[str],
) -> Report:
    content = PageContent(
        subject,
        findings,
        other_t=None if other is None else other.t,
        consistent=_consistent(subject, findings, shown.bounds),
        recording=_recording(subject, shown.excitation, results),
        warnings=warnings,
    )
    return write_page(results, content)


def _recording(subject: Subject, file: Path | None, results: ResultsFolder) -> str | None:
    """Write the page that plays an excitation, and return its name; None without one."""
    if file is None:
        return None
    page = record_excitation(subject, FourierTrajectory.load(file), cell=cell_of(subject, None))
    return RECORDING if results.write(RECORDING, page) else None


def _consistent(
    subject: Subject, findings: Findings, file: Path | None
) -> ConsistentParameters | None:
    """Return the consistent set, or None if there are no bounds of the links."""
    found: PhysicalBounds | None = None
    try:
        found = bounds_of(subject, file)
    except InputError:
        if file is not None:
            raise
    return None if found is None else consistent_set(findings, found, direct=False)


def _warnings(findings: Findings) -> list[str]:
    """Return the warnings, one sentence each."""
    warnings = list(findings.notes)
    for run, estimate in enumerate(findings.runs.estimates, start=1):
        if not isinstance(estimate.motion, AveragedMotion):
            continue
        trend = friction_trend(estimate.motion)
        for j in np.flatnonzero(trend.changes):
            warnings.append(
                f"run {run}: friction of {estimate.joint_names[j]} changed by "
                f"{trend.coulomb[j]:.3g} and {trend.viscous[j]:.3g} times the velocity from the "
                "first to the last period"
            )
        if run == 1 and estimate.coloured.any():
            names = ", ".join(np.array(estimate.joint_names)[estimate.coloured])
            warnings.append(f"the noise of {names} is coloured, which the covariance includes")
    return warnings
