"""Teaching: from the results of a hand-guiding run to a path that is followed."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from experiments.finished_run import RunOutcome
from experiments.results.run_log import RunLog
from experiments.scenario_file import read_scenario
from experiments.simulated_run import RunOptions, run_scenario
from experiments.teaching.comparison import Fit, FollowedShape
from experiments.teaching.taught_figures import draw_pictures
from experiments.teaching.taught_path import (
    CSV_NAME,
    YAML_NAME,
    Taught,
    TeachingOptions,
    follow_text,
    read_run,
    taught_path,
)
from pfsc_drake.geometry import waypoints_text
from reporting.folder import ResultsFolder, check_folder, open_results
from reporting.metrics import Metrics
from reporting.page import Page, Report
from reporting.provenance import standard_attributes

KIND, FOLLOW = "teaching", "follow"
_DESCRIPTION = (
    "An operator guided the tool by hand. Waypoints are tool poses measured by encoders and model, "
    "selected by distance and angle; the path is the smoothest one within a tolerance of them."
)
SCENARIO, GUIDE = "teach_by_hand_6r", "guide"


@dataclass(frozen=True)
class TeachingOutcome:
    """Outcome of teaching.

    Attributes:
        report: The report page.
        waypoints: CSV file of the waypoints; None if it could not be written.
        scenario: YAML file of the scenario that follows them; None if it could not be written.
        fault: Fault of the run along the path, or None.
    """

    report: Report
    waypoints: Path | None
    scenario: Path | None
    fault: str | None = None


def teach(
    run: Path,
    out: Path,
    options: TeachingOptions | None = None,
    *,
    follow: bool = True,
    drawn: bool = True,
    progress: Callable[[str], None] = lambda line: None,
) -> TeachingOutcome:
    """Turn a hand-guiding run into a path, and follow it.

    Args:
        run: Folder of the run.
        out: Folder for ``taught.csv``, ``follow.yaml``, the page, and in ``follow`` the results
            of the run along the path.
        options: Options of teaching.
        follow: Whether to run along the path.
        drawn: Whether that run has figures and a recording.
        progress: Receives one line per step.

    Raises:
        InputError: If there is no such run, nothing was taught, no path fits, the robot cannot
            follow it, or a folder cannot take the results.
        KeyboardInterrupt: If the user stopped the run along the path.
    """
    chosen = options or TeachingOptions()
    check_folders(out, run)
    settings, log = read_run(run)
    taught = taught_path(settings, log, chosen)
    length, count = taught.path.length, len(taught.rows)
    progress(f"{count} waypoints, a path of {length:.4g} m")
    inputs = [run / "log.h5", run / "scenario.yaml"]
    with open_results(out, KIND, inputs) as results:
        comment = f"taught in {settings.name}: positions [m] and quaternions of the tool"
        csv = results.write(CSV_NAME, waypoints_text(taught.table, comment))
        scenario = results.write(YAML_NAME, follow_text(taught, chosen))
        outcome = None
        if follow and scenario is not None and results.explain_problems() is None:
            outcome = run_and_report(str(scenario), out / FOLLOW, progress, drawn=drawn)
        fault = None if outcome is None else outcome.fault
        report = _write_page(results, taught, chosen, outcome, out / FOLLOW)
        return TeachingOutcome(report, csv, scenario, fault)


def check_folders(out: Path, run: Path) -> None:
    """Check that folders can take the results, without changes.

    Args:
        out: Folder for the results.
        run: Folder of the hand-guiding run.

    Raises:
        InputError: If they cannot.
    """
    check_folder(out, KIND, [run / "log.h5", run / "scenario.yaml"])
    check_folder(out / FOLLOW, "run")


def run_and_report(
    scenario: str, out: Path, progress: Callable[[str], None], *, drawn: bool = True
) -> RunOutcome:
    """Run a scenario, see :func:`run_scenario`, and report lines about it.

    Args:
        scenario: Name or file.
        out: Folder for its results.
        progress: Receives one line before and after.
        drawn: Whether it has figures and a recording.

    Raises:
        InputError: If it is wrong.
        KeyboardInterrupt: If the user stopped it.
    """
    loaded = read_scenario(scenario, [])
    progress(f"running {loaded.name}")
    outcome = run_scenario(
        loaded,
        out=out,
        options=RunOptions(figures=drawn, recording=drawn),
        progress=_Quarters(loaded.name, progress),
    )
    if outcome.interrupted:
        raise KeyboardInterrupt
    for message in [*outcome.warnings, *filter(None, [outcome.fault, outcome.problem])]:
        progress(f"{loaded.name}: {message}")
    progress(f"{loaded.name}: open {outcome.report}")
    return outcome


class _Quarters:
    """Progress listener that reports a line at each quarter of a run."""

    def __init__(self, name: str, report: Callable[[str], None]) -> None:
        self._name, self._report = name, report
        self._duration, self._reported = 0.0, 0

    def expect(self, duration: float) -> None:
        """Set the simulated time at the end [s]."""
        self._duration = duration

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Update the simulated time [s] and the phase, e.g. ``simulating``."""
        if self._duration > 0.0 and 4.0 * simulated_time / self._duration >= self._reported + 1:
            self._reported += 1
            self._report(f"{self._name}: {simulated_time:.1f} of {self._duration:.1f} s")


def _write_page(
    results: ResultsFolder,
    taught: Taught,
    options: TeachingOptions,
    outcome: RunOutcome | None,
    folder: Path,
) -> Report:
    fit, followed, metrics = Fit(taught), None, Metrics()
    fit.add_to(metrics, options.velocity)
    if outcome is not None and outcome.problem is None:
        shape = FollowedShape(taught, RunLog.read(folder / "log.h5"))
        if shape.eta.size:
            followed = shape
            followed.add_to(metrics)
    results.write("metrics.json", metrics.to_json())
    pictures = draw_pictures(taught, fit, followed)
    warnings = []
    if "fault" in taught.log.attributes:
        warnings.append(f"during teaching: {taught.log.attributes['fault']}")
    return Page(
        kind="Teaching",
        title=f"Taught in {taught.settings.name}",
        description=_DESCRIPTION,
        scenario_yaml_text=follow_text(taught, options),
        metrics=metrics,
        figures=pictures,
        log_attributes=standard_attributes(taught.settings.name),
        fault=None if outcome is None else outcome.fault,
        warnings=warnings,
        commands={"follow the path again": f"pfsc run {results.path / YAML_NAME}"},
        cards=_cards(followed),
        details=f"Scenario {YAML_NAME}",
    ).write(results)


def _cards(followed: FollowedShape | None) -> list[str]:
    cards = ["fit_distance_max", "fit_distance_rms", "largest_jerk_through_all"]
    cards.append("largest_jerk_fitted")
    if followed is None:
        return cards
    return [
        *cards,
        "follow_deviation_seen",
        "follow_from_taught_max",
        "model_error_of_place",
        "model_error_left",
    ]


def write_teach_in(
    out: Path,
    progress: Callable[[str], None],
    scenario: str = SCENARIO,
    options: TeachingOptions | None = None,
    *,
    drawn: bool = True,
) -> Report:
    """Simulate hand guiding, follow the taught path, and write a page.

    Args:
        out: Folder for waypoints, scenario and page; hand guiding is in ``guide``, the run along
            the path in ``follow``.
        progress: Receives one line per step.
        scenario: Name or file of the hand-guiding scenario.
        options: Options of teaching.
        drawn: Whether the two runs have figures and recordings.

    Returns:
        The page.

    Raises:
        InputError: If a run is rejected; nothing has been run if a folder cannot take results.
        KeyboardInterrupt: If the user stopped a run.
    """
    check_folders(out, out / GUIDE)
    run_and_report(scenario, out / GUIDE, progress, drawn=drawn)
    return teach(out / GUIDE, out, options, drawn=drawn, progress=progress).report
