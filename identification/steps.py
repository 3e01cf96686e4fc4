"""Steps of an identification with files, for the command line."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from identification.consistency.nearest import ConsistentParameters, refuse_far
from identification.consistency.writing import WrittenModel, write_model
from identification.estimation.residuals import choose_bandwidth
from identification.estimation.validation import refuse_implausible
from identification.estimation.wiring import doubtful_signals
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.limits import JointLimits
from identification.excitation.recording import record_excitation
from identification.excitation.run_in import rest_to_rest
from identification.excitation.scene import cell_of
from identification.excitation.search import SearchResult
from identification.findings import (
    Findings,
    consistent_set,
    find_parameters,
    stored_findings,
)
from identification.measurement.columns import Reading
from identification.measurement.experiment import prepare_motion, run_experiment
from identification.measurement.files import read_record, write_record
from identification.measurement.imperfections import Imperfections
from identification.measurement.periods import AveragedMotion
from identification.model.base import BaseParameters, base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject, load_subject
from identification.options import BoundsOptions
from identification.output import make_folder
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.robot.models.files import models_directory
from reporting.processes import side_by_side

EXCITATION, RUN, RECORDING = "excitation.yaml", "excitation.csv", "excitation.html"
_RATE = 1000.0  # Hz, of the motion for a robot's controller


def save_excitation(
    subject: Subject, found: SearchResult, folder: Path, periods: int, limits: JointLimits
) -> str:
    """Write an excitation: coefficients, motion from rest to rest, and a page that plays it.

    Args:
        subject: The robot.
        found: Result of the search.
        folder: Folder of the files; created if it is missing.
        periods: Number of periods in a run.
        limits: Limits for run-in and run-out.

    Returns:
        Path of the page.
    """
    make_folder(folder)
    trajectory, joints = found.trajectory, subject.joint_names
    trajectory.save(
        folder / EXCITATION, subject.name, f"{found.criterion}-optimal", joints, found.figures
    )
    run = rest_to_rest(
        trajectory, limits.velocity, limits.acceleration, periods=periods, rate=_RATE
    )
    run.export_csv(folder / RUN, _RATE, list(subject.joint_units))
    return record_excitation(subject, trajectory, folder / RECORDING, cell_of(subject, None))


def load_excitation(subject: Subject, file: Path | None) -> FourierTrajectory:
    """Return the excitation of a file, or the best shipped one of the robot.

    Raises:
        InputError: If there is none, or the file cannot be read.
    """
    if file is not None:
        return FourierTrajectory.load(file)
    return FourierTrajectory.load(shipped_excitations(subject)[-1])


def shipped_excitations(subject: Subject) -> list[Path]:
    """Return the shipped excitation files of a robot, the best one last.

    Raises:
        InputError: If there is none.
    """
    files = sorted((models_directory() / subject.family).glob("excitation*.yaml"))
    if not files or files[-1].name != "excitation_optimal.yaml":
        raise InputError(
            f"--excitation: none is shipped for {subject.name}; make one with: "
            f"pfsc identify excite {subject.name}"
        )
    return files


def simulate_runs(
    subject: Subject,
    robot: str,
    trajectory: FourierTrajectory,
    imperfections: Imperfections | None,
    folder: Path,
    seeds: range,
    progress: Progress,
) -> list[Path]:
    """Simulate an experiment several times, and return the files with the measurements.

    A single run is simulated in this process, several on all cores.

    Args:
        subject: The robot.
        robot: Argument that it was loaded from.
        trajectory: The excitation.
        imperfections: Imperfections of all runs; None for those shipped with the robot.
        folder: Folder of the files; created if it is missing.
        seeds: Seed of each run.
        progress: Receives the completed fraction and the current step.
    """
    make_folder(folder)
    experiment = (robot, subject.tool, trajectory, imperfections, folder)
    runs = len(seeds)
    if runs == 1:
        return [_run(experiment, seeds[0], subject, progress)]
    progress(0.0, f"simulating {runs} runs")
    files = []
    with side_by_side(None, runs) as run:
        for file in run(_run, experiment, seeds):
            files.append(file)
            progress(len(files) / runs, f"{len(files)} of {runs} runs")
    return sorted(files, key=lambda file: int(file.stem.split("_")[1]))


def _run(
    experiment: tuple[str, bool, FourierTrajectory, Imperfections | None, Path],
    seed: int,
    subject: Subject | None = None,
    progress: Progress | None = None,
) -> Path:
    """Simulate a run, in a process of its own with the robot loaded again."""
    robot, tool, trajectory, imperfections, folder = experiment
    subject = subject or load_subject(robot, tool=tool)
    measured = run_experiment(subject, trajectory, imperfections, seed=seed, progress=progress)
    file = folder / f"run_{seed}.h5"
    write_record(file, measured.record, subject)
    return file


@dataclass(frozen=True)
class MeasuredFiles:
    """Files with measured motions, and options for reading them.

    Attributes:
        records: Runs of one excitation.
        validation: Measurement of another motion, which is not used to estimate.
        reading: Names and units that the files lack or spell otherwise.
        period: Period of the excitation [s], if files do not state it.
        skip: Periods at the start to leave out.
        bandwidth_hz: Bandwidth of the motion [Hz]; by default the least one with which the model
            explains the torques of the first record as well as with any.
    """

    records: Sequence[Path]
    validation: Path | None = None
    reading: Reading = field(default_factory=Reading)
    period: float | None = None
    skip: int = 1
    bandwidth_hz: float | None = None

    @property
    def paths(self) -> list[Path]:
        """All files, the one for validation last."""
        return [*self.records, *([self.validation] if self.validation else [])]

    def motions(
        self, regressor: Regressor, base: BaseParameters, progress: Progress
    ) -> tuple[list[AveragedMotion], AveragedMotion | None]:
        """Return the motions for the estimate, and the one for validation.

        Args:
            regressor: Regressor of the robot.
            base: Its base parameters.
            progress: Receives the completed fraction and the current step.

        Raises:
            InputError: If there is no record, or a file lacks required data.
        """
        if not self.records:
            raise InputError("estimate: no record; at least one is required")
        bandwidth_hz, motions = self.bandwidth_hz, []
        for k, path in enumerate(self.paths):
            progress(k / len(self.paths), f"reading {path.name}")
            record = read_record(path, regressor.subject, self.period, self.reading)
            if bandwidth_hz is None:
                bandwidth_hz = choose_bandwidth(
                    regressor,
                    base,
                    record,
                    self.period,
                    self.skip,
                    lambda _, phase: progress(0.0, phase),
                ).bandwidth_hz
            motions.append(
                prepare_motion(record, regressor, base, skip=self.skip, bandwidth_hz=bandwidth_hz)
            )
        other = motions.pop() if self.validation is not None else None
        return motions, other


def estimate_files(
    subject: Subject,
    files: MeasuredFiles,
    *,
    choose: bool = True,
    simulated: bool = False,
    progress: Progress,
) -> tuple[Findings, AveragedMotion | None]:
    """Return the findings from files with measured motions, and the motion for validation.

    Args:
        subject: The robot.
        files: The files, and options for reading them.
        choose: Whether to choose friction beyond Coulomb's and viscous.
        simulated: Whether the robot's model is the ground truth.
        progress: Receives the completed fraction and the current step.
    """
    regressor = Regressor(subject)
    base = base_parameters(regressor)
    motions, other = files.motions(
        regressor, base, lambda fraction, phase: progress(0.5 * fraction, phase)
    )
    findings = find_parameters(
        regressor,
        base,
        motions,
        other,
        choose=choose,
        truth=true_parameters(subject) if simulated else None,
        progress=lambda fraction, phase: progress(0.5 + 0.5 * fraction, phase),
    )
    for result in findings.runs.estimates:
        refuse_implausible(result)
    notes = doubtful_signals(regressor, base, motions[0], true_parameters(subject))
    return replace(findings, notes=tuple(notes)), other


def find_model(
    subject: Subject, source: Path, known: BoundsOptions, direct: bool, folder: Path
) -> tuple[ConsistentParameters, WrittenModel]:
    """Find the consistent set of a stored identification, and write its model.

    Args:
        subject: The robot.
        source: ``identification.h5``, or its folder.
        known: Bounds of the links.
        direct: Whether in one step from the first run's torques.
        folder: Folder of the files.

    Raises:
        InputError: If there are no bounds of the links, or no robot is near the estimate.
    """
    findings = stored_findings(subject, source, None, simulated=False)
    refuse_implausible(findings.estimate)
    found = consistent_set(findings, known.read(subject), direct)
    refuse_far(found, str(source))
    return found, write_consistent(subject, found, folder)


def write_consistent(subject: Subject, found: ConsistentParameters, folder: Path) -> WrittenModel:
    """Write the model of a consistent set, without friction terms that models do not have."""
    return write_model(subject, found.parameters[: len(true_parameters(subject))], folder)
