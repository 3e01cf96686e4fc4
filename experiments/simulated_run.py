"""One run: from a scenario file to log, metrics, figures, recording and report."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from experiments.finished_run import FinishedRun, RunOutcome, steady_clock, write_outcome
from experiments.preparation import PreparedRun, prepare
from experiments.scenario_file import ScenarioFile
from experiments.simulation import simulate
from experiments.studies.margins.analysis import analyse
from experiments.studies.margins.box import ErrorBox
from experiments.studies.margins.result import MarginAnalysis
from reporting.folder import check_folder, open_results
from reporting.interruption import watch_interruption
from reporting.progress import ProgressListener


@dataclass(frozen=True)
class RunOptions:
    """Options of a run beside its scenario, on the command line and in the API.

    Attributes:
        duration: Simulated time [s] instead of the scenario's.
        after_fault: Simulated time after a fault [s].
        margins: Whether to compute the margins of the loop at the start.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
    """

    duration: float | None = None
    after_fault: float = 0.0
    margins: bool = False
    figures: bool = True
    recording: bool = True


def run_scenario(
    scenario: ScenarioFile,
    *,
    out: Path,
    options: RunOptions,
    progress: ProgressListener,
    warn: Callable[[str], None] = lambda sentence: None,
) -> RunOutcome:
    """Run a scenario and write all results into a folder.

    Args:
        scenario: The scenario as read.
        out: Folder for the results, see :func:`reporting.folder.open_results`.
        options: Options beside the scenario.
        progress: Progress listener.
        warn: Called with each warning that is known before anything moves; they are among those
            of the outcome, too.

    Raises:
        InputError: If the scenario is wrong or the folder cannot be used; nothing has moved then.
    """
    progress(0.0, "preparing")
    inputs = scenario.inputs()
    check_folder(out, "run", inputs)
    recording = options.recording
    prepared = prepare(scenario, options.duration, recording=recording, progress=progress)
    for sentence in prepared.warnings:
        warn(sentence)
    analysis = _analyse(prepared, scenario.path.parent, progress) if options.margins else None
    with watch_interruption() as interrupted, open_results(out, "run", inputs) as results:
        results.write("scenario.yaml", prepared.text)
        progress.expect(prepared.settings.duration)
        with steady_clock():
            result = simulate(
                prepared.station,
                prepared.settings.simulation,
                prepared.settings.duration,
                progress,
                interrupted,
                options.after_fault,
            )
        run = FinishedRun(prepared, scenario.name, result, analysis)
        return write_outcome(
            run, results, progress, interrupted, figures=options.figures, recording=recording
        )


def _analyse(prepared: PreparedRun, folder: Path, progress: ProgressListener) -> MarginAnalysis:
    """Compute margins of the loop at the start."""
    return analyse(prepared.settings, folder, ErrorBox(), _BeforeStart(progress), only_start=True)


class _BeforeStart:
    """Progress listener for the time before the simulation starts."""

    def __init__(self, progress: ProgressListener) -> None:
        self._progress = progress

    def expect(self, duration: float) -> None:
        """Ignore the duration, which belongs to the run."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        self._progress(0.0, phase)
