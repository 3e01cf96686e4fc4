"""Identification from scripts and notebooks, with the same steps as the command line."""

import html
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from identification.consistency.writing import WrittenModel
from identification.estimation.least_squares import Estimate
from identification.findings import Findings
from identification.measurement.columns import Reading
from identification.measurement.imperfections import shipped_imperfections
from identification.model.subject import Subject, load_subject
from identification.options import BoundsOptions, PageOptions
from identification.output import check_folder
from identification.pages import identify
from identification.report.tables import torque_table
from identification.steps import (
    MeasuredFiles,
    find_model,
    load_excitation,
    simulate_runs,
)
from pfsc_drake.errors import WriteError
from reporting.progress import fraction_display
from reporting.provenance import FIGURES, listed_results


@dataclass(frozen=True)
class Identification:
    """Result of an identification, and the folder in which it is saved.

    A notebook shows the residual torques of the model, beside their noise.

    Attributes:
        robot: Argument that it was loaded from.
        folder: Folder with ``identification.h5``, the page and its figures.
        findings: All results: runs, choice of friction, prediction.
    """

    robot: str
    folder: Path
    findings: Findings

    @property
    def estimate(self) -> Estimate:
        """Base parameters of the first run: ``base_parameters``, ``covariance``, ``names``."""
        return self.findings.estimate

    @property
    def deviation(self) -> np.ndarray:
        """Their standard deviations, shape (n_b,), SI units."""
        return np.sqrt(np.diag(self.estimate.covariance))

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings, one sentence each."""
        return self.findings.notes

    @property
    def report(self) -> Path:
        """The page for the browser."""
        return self.folder / "report.html"

    @property
    def figures(self) -> dict[str, Path]:
        """Images by name."""
        names = [name for name in listed_results(self.folder) if FIGURES in name]
        return {Path(name).stem: self.folder / name for name in names}

    def _repr_html_(self) -> str:
        """Return notes and the table of torques."""
        table = torque_table(self.findings)
        head = "".join(f"<th>{html.escape(title)}</th>" for title in table.head)
        rows = "".join(
            f"<tr>{''.join(f'<td>{_cell(value)}</td>' for value in row)}</tr>" for row in table.rows
        )
        notes = "".join(f"<div>⚠ {html.escape(note)}</div>" for note in self.notes)
        return f"{notes}<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def simulate(
    robot: str,
    *,
    out: str | Path,
    excitation: str | Path | None = None,
    runs: int = 7,
    seed: int = 1,
    realistic: bool = False,
    tool: bool = False,
    quiet: bool = False,
) -> list[Path]:
    """Simulate an experiment: rotors, friction, servo, encoders, noise; return its files.

    Args:
        robot: Shipped robot, SDF or URDF file, or scenario with a robot.
        out: Folder for the files.
        excitation: ``excitation.yaml`` of the motion; None for the shipped one.
        runs: Number of runs.
        seed: Seed of the first run.
        realistic: Whether disturbances are coloured and friction differs from run to run.
        tool: Whether the shipped robot carries its tool.
        quiet: Whether to show no progress.

    Raises:
        InputError: If there is no such robot, or no excitation for it.
    """
    subject, folder = _begin(robot, out, tool)
    trajectory = load_excitation(subject, _path(excitation))
    faults = shipped_imperfections(subject.family)
    faults = faults.realistic() if realistic else faults
    with _progress("experiment", quiet) as progress:
        seeds = range(seed, seed + runs)
        return simulate_runs(subject, robot, trajectory, faults, folder, seeds, progress)


def estimate(
    robot: str,
    records: str | Path | Sequence[str | Path],
    *,
    out: str | Path,
    validation: str | Path | None = None,
    period: float | None = None,
    skip: int = 1,
    bandwidth: float | None = None,
    plain: bool = False,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    scales: Mapping[str, float] | None = None,
    bounds: str | Path | None = None,
    simulated: bool = False,
    tool: bool = False,
    quiet: bool = False,
) -> Identification:
    """Estimate base parameters from measured motions, and write ``identification.h5`` and a page.

    Args:
        robot: As in :func:`simulate`.
        records: Runs of one excitation: CSV, HDF5 or MAT files.
        out: Folder for the results.
        validation: Record of another motion, to choose friction and to predict.
        period: Period of the motion [s], if the files do not state it.
        skip: Periods at the start to leave out.
        bandwidth: Bandwidth of the motion [Hz]; None to choose it from the torques.
        plain: Whether there is Coulomb and viscous friction only.
        names: Signals by their names in the files.
        units: Units that the files do not state, by signal.
        scales: SI units per unit of the file, by signal.
        bounds: Bounds of the links (YAML); None for those shipped with the robot, if any.
        simulated: Whether the robot's model is the ground truth, to compare with.
        tool: As in :func:`simulate`.
        quiet: Whether to show no progress.

    Raises:
        InputError: If a file lacks required data, or contains data that no such robot can produce.
        WriteError: If results could not be written.
    """
    subject, folder = _begin(robot, out, tool)
    files = MeasuredFiles(
        [Path(one) for one in ([records] if isinstance(records, str | Path) else records)],
        _path(validation),
        Reading(dict(names or {}), dict(units or {}), dict(scales or {})),
        period,
        skip,
        bandwidth,
    )
    with _progress(subject.name, quiet) as progress:
        findings, report = identify(
            subject,
            files,
            folder,
            PageOptions(_path(bounds)),
            plain=plain,
            simulated=simulated,
            progress=progress,
        )
    if report.problem is not None:
        raise WriteError(report.problem)
    return Identification(robot, folder, findings)


def consistent_model(
    found: Identification | str | Path,
    robot: str = "",
    *,
    out: str | Path,
    bounds: str | Path | None = None,
    direct: bool = False,
    tool: bool = False,
) -> WrittenModel:
    """Find the nearest physically consistent parameters, and write them as SDF, URDF and YAML.

    Args:
        found: Identification, or its folder or ``identification.h5``.
        robot: As in :func:`simulate`; by default the robot of the identification.
        out: Folder for the files.
        bounds: Bounds of the links (YAML); None for those shipped with the robot.
        direct: Whether in one step from the first run's torques.
        tool: As in :func:`simulate`.

    Raises:
        InputError: If there are no bounds of the links, or no robot is near the estimate.
    """
    source, robot = (
        (found.folder, robot or found.robot)
        if isinstance(found, Identification)
        else (Path(found), robot)
    )
    subject, folder = _begin(robot, out, tool)
    return find_model(subject, source, BoundsOptions(_path(bounds)), direct, folder)[1]


def _begin(robot: str, out: str | Path, tool: bool) -> tuple[Subject, Path]:
    """Return the robot, and the checked folder for results."""
    logging.getLogger("drake").setLevel(logging.CRITICAL)
    folder = Path(out).expanduser()
    subject = load_subject(robot, tool=tool)
    check_folder(folder)
    return subject, folder


def _path(file: str | Path | None) -> Path | None:
    return None if file is None else Path(file)


@contextmanager
def _progress(title: str, quiet: bool) -> Iterator[Callable[[float, str], None]]:
    if quiet:
        yield lambda _, __: None
        return
    with fraction_display(Console(), title) as progress:
        yield progress


def _cell(value: str | float) -> str:
    return html.escape(value) if isinstance(value, str) else f"{value:.4g}"
