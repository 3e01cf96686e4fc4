"""Identification study: excitation, measurement, estimation, and control with the result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure as Canvas

from experiments.scenario_file import ScenarioFile, read_scenario
from experiments.sweep.many import run_side_by_side
from experiments.sweep.worker import RunRow
from identification.consistency.bounds import bounds_of
from identification.consistency.nearest import ConsistentParameters
from identification.estimation.results import FILE_NAME, save_estimate
from identification.excitation.fourier import FourierTrajectory, shipped_excitation
from identification.excitation.limits import JointLimits, chosen_limits
from identification.excitation.search import SearchOptions, search
from identification.findings import Findings, consistent_set
from identification.measurement.imperfections import shipped_imperfections
from identification.model.subject import Subject, load_subject
from identification.report.identification_page import PageContent, write_page
from identification.steps import (
    EXCITATION,
    RECORDING,
    MeasuredFiles,
    estimate_files,
    save_excitation,
    simulate_runs,
    write_consistent,
)
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report, Table
from reporting.style import COLOURS, STYLE, WIDTH, Drawing, Figure, render

TRUE, WRONG, IDENTIFIED = "true", "wrong by Tab. C.3", "identified"
MODELS = (TRUE, WRONG, IDENTIFIED)
MOST = 1.5  # of the deviation with the true model
_ENCODERS = (
    "encoders={motor_increments: [4000000], link_increments: [4000000], difference_quotient: true}"
)
_ERROR = "model_error={random: {seed: 1, mass: 0.056, inertia: 0.056, friction: 0.05}}"
_DEVIATION, _FROM_REFERENCE = "max_path_deviation", "max_error_from_compliant_reference"
_SEED = 1
_DESCRIPTION = (
    "For each robot an experiment is simulated with friction, noise, encoders and a coloured "
    "disturbance. Base parameters, the nearest consistent model and its files are estimated from "
    "the measurements. Then scenarios run with three models of the controller: the true one, one "
    "with the deviations of Tab. C.3, and the identified one."
)


@dataclass(frozen=True)
class Drive:
    """Scenario of a run with the identified model.

    Attributes:
        scenario: Its name.
        model: Model file of the controller.
        metric: Metric of the comparison.
        overrides: Overrides of the scenario, for all models.
        friction: Whether the controller has a friction model.
    """

    scenario: str
    model: str
    metric: str = _DEVIATION
    overrides: tuple[str, ...] = ()
    friction: bool = True


@dataclass(frozen=True)
class CircularRun:
    """Identification of a robot, and runs with the result.

    Attributes:
        robot: Name of a shipped robot.
        drives: Scenarios by their labels on the page.
        starts: Starts of the search for an excitation.
        runs: Number of experiments.
        limits: Limits of the joints that replace the model's, see
            :func:`~identification.excitation.limits.chosen_limits`.
        validation: Name of another shipped motion; empty to search one.
    """

    robot: str
    drives: Mapping[str, Drive]
    starts: int = 4
    runs: int = 7
    limits: Mapping[str, float] = field(default_factory=dict)
    validation: str = ""


CIRCLES = (
    CircularRun(
        "comau_racer_1_4",
        {
            "pfc_comau_6r": Drive("pfc_comau_6r", "comau_racer_1_4_elastic.sdf", friction=False),
            "pfc_comau_6r, friction and encoders": Drive(
                "pfc_comau_6r",
                "comau_racer_1_4_elastic.sdf",
                overrides=(
                    "friction.file=comau_racer_1_4",
                    "controller.friction.source=model",
                    _ENCODERS,
                ),
            ),
            "pfc_compliant_6r": Drive(
                "pfc_compliant_6r",
                "comau_racer_1_4.sdf",
                _FROM_REFERENCE,
                ("controller.friction.source=model",),
            ),
        },
        validation="excitation",
    ),
    CircularRun(
        "franka_emika_panda",
        {
            "pfc_panda_7r": Drive("pfc_panda_7r", "franka_emika_panda.sdf", friction=False),
            "pfc_panda_7r, friction and encoders": Drive(
                "pfc_panda_7r",
                "franka_emika_panda.sdf",
                overrides=(
                    "friction.file=franka_emika_panda",
                    "controller.friction.source=model",
                    _ENCODERS,
                ),
            ),
        },
    ),
)


def write_identification(
    out: Path, progress: Callable[[str], None], circles: Sequence[CircularRun] = CIRCLES
) -> Report:
    """Identify robots, run scenarios with the results, and write a page for each robot.

    Args:
        out: Folder for the first robot, with a folder for the files of each step; further robots
            have folders in it.
        progress: Receives one line per step.
        circles: Identifications and their scenarios.

    Returns:
        The page of the first robot.

    Raises:
        InputError: If ``out`` cannot take the results.
    """
    first, *others = circles
    report = _identify(first, out, progress)
    for circle in others:
        page = _identify(circle, out / circle.robot, progress).path
        progress(f"{circle.robot}: open {page}")
    return report


def _identify(circle: CircularRun, out: Path, progress: Callable[[str], None]) -> Report:
    subject = load_subject(circle.robot, tool=False)
    with open_results(out, "identification") as results:
        say = _stepwise(circle.robot, progress)
        limits = chosen_limits(subject, circle.limits)
        found = search(
            subject, SearchOptions(starts=circle.starts, seed=_SEED), limits, progress=say
        )
        page = save_excitation(subject, found, out / "excitation", 5, limits)
        other = _other_motion(subject, circle, limits, say)
        faults = shipped_imperfections(subject.family).realistic()
        trajectory = FourierTrajectory.load(out / "excitation" / EXCITATION)
        name = circle.robot
        seeds, runs, validation = range(_SEED, _SEED + circle.runs), out / "runs", range(100, 101)
        records = simulate_runs(subject, name, trajectory, faults, runs, seeds, say)
        (unused,) = simulate_runs(subject, name, other, faults, out / "validation", validation, say)
        findings, motion = estimate_files(
            subject, MeasuredFiles(records, unused), simulated=True, progress=say
        )
        save_estimate(out / FILE_NAME, findings.estimate, findings.runs)
        consistent = consistent_set(findings, bounds_of(subject, None), direct=False)
        model = write_consistent(subject, consistent, out / "model")
        progress(f"{circle.robot}: model written, {len(model.files)} files")
        rows = run_side_by_side(_scenarios(circle, out / "model"), _row_listener(circle, progress))
        results.write(RECORDING, page)
        assert motion is not None  # the validation motion
        content = _content(circle, subject, findings, motion.t, consistent, rows)
        return write_page(results, content)


def _stepwise(robot: str, progress: Callable[[str], None]) -> Callable[[float, str], None]:
    """Return a progress listener that reports a line at the beginning of each step."""
    last = ""

    def report(fraction: float, phase: str) -> None:
        nonlocal last
        step = phase.split(",", maxsplit=1)[0]
        if step != last:
            last = step
            progress(f"{robot}: {phase}")

    return report


def _other_motion(
    subject: Subject,
    circle: CircularRun,
    limits: JointLimits,
    progress: Callable[[float, str], None],
) -> FourierTrajectory:
    if circle.validation:
        return FourierTrajectory.load(shipped_excitation(subject.family, circle.validation))
    found = search(
        subject, SearchOptions(starts=1, seed=100, iterations=40), limits, progress=progress
    )
    return found.trajectory


def _scenarios(circle: CircularRun, model: Path) -> dict[tuple[str, str], ScenarioFile]:
    folder = model.resolve()
    found = {}
    for name, drive in circle.drives.items():
        identified = [f"controller.model={folder / drive.model}", "model_error={}"]
        if drive.friction:
            identified.append(f"controller.friction.nominal.file={folder / 'parameters.yaml'}")
        models = {TRUE: ["model_error={}"], WRONG: [_ERROR], IDENTIFIED: identified}
        for kind, changes in models.items():
            found[name, kind] = read_scenario(drive.scenario, [*drive.overrides, *changes])
    return found


def _row_listener(
    circle: CircularRun, progress: Callable[[str], None]
) -> Callable[[tuple[str, str], RunRow], None]:
    def report(case: tuple[str, str], row: RunRow) -> None:
        value = row.value(circle.drives[case[0]].metric)
        progress(f"{case[0]:38s} {case[1]:20s} {row.reason or f'{value * 1e3:.4f} mm'}")

    return report


def _content(
    circle: CircularRun,
    subject: Subject,
    findings: Findings,
    other_t: np.ndarray,
    consistent: ConsistentParameters,
    rows: Mapping[tuple[str, str], RunRow],
) -> PageContent:
    metrics, table = Metrics(), []
    deviations = np.array(
        [
            [rows[name, kind].value(drive.metric) for kind in MODELS]
            for name, drive in circle.drives.items()
        ]
    )
    for (name, drive), values in zip(circle.drives.items(), deviations, strict=True):
        ratio = values[2] / values[0]
        source = f"{drive.metric}, identified by true model"
        key = name.replace(",", "").replace(" ", "_")
        metrics.add(f"{key}_ratio", ratio, "1", f"<= {MOST}", source)
        table.append([name, drive.metric, *(1e3 * values).tolist(), ratio])
    head = ["scenario", "metric", *(f"{kind} in mm" for kind in MODELS), "ratio"]
    caption = "Largest deviations by model of the controller; ratio of identified to true model."
    picture = _picture(list(circle.drives), deviations)
    return PageContent(
        subject,
        findings,
        other_t=other_t,
        consistent=consistent,
        recording=RECORDING,
        metrics=metrics,
        figures=[picture],
        tables=[Table("Control with the identified model", caption, head, table)],
        attributes={"circle": _DESCRIPTION},
    )


def _picture(names: Sequence[str], deviations: np.ndarray) -> Figure:
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, 0.9 * len(names) + 1.2))
        panel = canvas.subplots()
        heights = np.arange(len(names))[::-1].astype(float)
        for i, kind in enumerate(MODELS):
            panel.barh(
                heights + 0.27 * (1 - i),
                1e3 * deviations[:, i],
                height=0.25,
                color=COLOURS[i],
                label=kind,
            )
        panel.set(xscale="log", xlabel="largest deviation in mm")
        panel.set_yticks(heights, names)
        canvas.legend(loc="outside lower center", ncols=3, frameon=False)
        caption = "Control with the true, a wrong and the identified model of the same robot."
        return render(Drawing("circle", "Control with the identified model", caption, canvas))
