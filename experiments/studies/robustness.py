"""Robustness study: all laws under model errors and disturbances, before and after measures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure as Canvas

from experiments.scenario_file import ScenarioFile, read_scenario
from experiments.studies.study_page import write_study_page
from experiments.sweep.many import run_side_by_side
from experiments.sweep.worker import COMPLETED, RunRow
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.style import ALERT, COLOURS, STYLE, WIDTH, Drawing, Figure, render

# exact model and measurement as the base
_BARE = ("model_error={}", "encoders={}")
_OBSERVED = ("controller.friction.source=observer",)
# unmodelled torques of links and tool, for robots without external forces
_TORQUE_OBSERVED = "controller.external_torque={source: observed, bandwidth: 60}"
_UNOBSERVED = ("controller.friction.source=none",)
_FRICTION = "friction"  # overrides of each subject
_ENCODERS = (
    "encoders={motor_increments: [4000000], link_increments: [4000000], difference_quotient: true}"
)
DISTURBANCES: Mapping[str, tuple[str, ...]] = {
    "as modelled": (),
    "masses 10 % too low": ("model_error.mass=0.9",),
    "masses 10 % too high": ("model_error.mass=1.1",),
    "K_s 10 % too low": ("model_error.stiffness=0.9",),
    "K_s 10 % too high": ("model_error.stiffness=1.1",),
    "tool 0.5 kg too light": ("model_error.tool_mass=-0.5",),
    "friction": (_FRICTION,),
    "all combined": (
        _FRICTION,
        "model_error.mass=0.95",
        "model_error.stiffness=1.05",
        _ENCODERS,
    ),
}
_SHOWN = (2e-5, 1e3)  # mm
BEFORE, AFTER = "before", "after"
_DESCRIPTION = (
    "In each row the nominal model has the stated error, with the same plant; friction is taken "
    "from Tab. C.3 (drives of the DELTA robot, identified friction for seven axes). Before: gains "
    "with equal poles, no friction compensation. After: the scenario's gains, and an observer of "
    "the drives' disturbance torque (300 1/s), for three elastic axes also of the external torque "
    "(60 1/s). 'All combined': friction, masses 5 % too low, K_s 5 % too high, and encoders of 4 "
    "million increments with difference quotients. Largest distances after the transition from "
    "the start to the path; for pfc_compliant_6r from the compliant reference."
)
# key of a run: scenario, disturbance, before or after
Case = tuple[str, str, str]


@dataclass(frozen=True)
class StudiedLaw:
    """Scenario of the study, with its measures against disturbances.

    Attributes:
        scenario: Its name.
        before: Overrides before the measures.
        after: Measures in addition to those of the scenario.
        elastic: Whether its joints have a stiffness.
        friction: Overrides without and with friction.
        metric: Name of the compared metric.
    """

    scenario: str
    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    elastic: bool = True
    metric: str = "max_path_deviation"
    friction: tuple[str, str] = ("friction={}", "friction.file=comau_racer_1_4")


def _equal_poles(law: str, **poles: float) -> str:
    kinds = ", ".join(
        f"{kind}: {{poles: [{', '.join([f'{p:g}'] * 4)}]}}" for kind, p in poles.items()
    )
    return f"controller.gains.{law}={{{kinds}}}"


SUBJECTS = (
    StudiedLaw(
        "pfc_elastic_6r",
        (_equal_poles("elastic", eta=-55, xi=-55, phi=-55), "start.transition=0"),
    ),
    StudiedLaw(
        "pfc_comau_6r_elastic",
        (_equal_poles("elastic", eta=-40, xi=-60, phi=-50), "start.transition=0"),
    ),
    StudiedLaw(
        "pfc_elastic_7r",
        (_equal_poles("elastic", eta=-55, xi=-55, phi=-55), "start.transition=0"),
        friction=("friction={}", "friction.file=franka_emika_panda"),
    ),
    StudiedLaw("pfc_elastic_3r", after=(_TORQUE_OBSERVED,)),
    StudiedLaw("pfc_viscoelastic_3r", after=(_TORQUE_OBSERVED,)),
    StudiedLaw("pfc_comau_6r"),
    # a DELTA robot has its own friction model
    StudiedLaw(
        "pfc_delta", elastic=False, friction=("drive_friction=false", "drive_friction=true")
    ),
    StudiedLaw("pfc_compliant_6r", elastic=False, metric="max_error_from_compliant_reference"),
)


def write_robustness(
    out: Path,
    progress: Callable[[str], None],
    subjects: Sequence[StudiedLaw] = SUBJECTS,
    disturbances: Mapping[str, tuple[str, ...]] = DISTURBANCES,
) -> Report:
    """Run all scenarios under all disturbances, on all cores, and write a page.

    Args:
        out: Folder for the page.
        progress: Receives one line per run, in the order in which they end.
        subjects: Scenarios.
        disturbances: Overrides by name.

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page (see
            :func:`reporting.folder.open_results`); nothing has been run then.
    """
    with open_results(out, "study") as results:
        metric = {subject.scenario: subject.metric for subject in subjects}

        def report(case: Case, row: RunRow) -> None:
            progress(f"{case[0]:22s} {case[1]:22s} {case[2]:7s} {_row_text(row, metric[case[0]])}")

        rows = run_side_by_side(_scenarios(subjects, disturbances), report)
        metrics = Metrics()
        for (scenario, disturbance, when), row in rows.items():
            key, value = f"{scenario}, {disturbance}, {when}", row.value(metric[scenario])
            metrics.add(key, value, "m", source=row.reason or None)
        return write_study_page(
            results,
            title="Robustness to model errors",
            description=_DESCRIPTION,
            overrides=_listing(subjects, disturbances),
            metrics=metrics,
            figures=[_picture(rows, metric)],
        )


def _scenarios(
    subjects: Sequence[StudiedLaw], disturbances: Mapping[str, tuple[str, ...]]
) -> dict[Case, ScenarioFile]:
    scenarios = {}
    for subject in subjects:
        for name, changes in disturbances.items():
            if name.startswith("K_s") and not subject.elastic:
                continue
            for when, own in {
                BEFORE: (*_UNOBSERVED, *subject.before),
                AFTER: (*_OBSERVED, *subject.after),
            }.items():
                without, with_friction = subject.friction
                suited = [with_friction if x == _FRICTION else x for x in changes]
                overrides = [*_BARE, without, *own, *suited, "targets={}"]
                scenarios[subject.scenario, name, when] = read_scenario(subject.scenario, overrides)
    return scenarios


def _row_text(row: RunRow, metric: str) -> str:
    if row.status != COMPLETED:
        return row.reason
    return f"{row.value(metric) * 1e3:8.3f} mm"


def _listing(
    subjects: Sequence[StudiedLaw], disturbances: Mapping[str, tuple[str, ...]]
) -> list[str]:
    lines = [f"{name}: {' '.join(changes) or '-'}" for name, changes in disturbances.items()]
    for s in subjects:
        lines.append(f"{s.scenario}, friction: {s.friction[1]}")
        lines.append(f"{s.scenario}, before: {' '.join((*_UNOBSERVED, *s.before))}")
        lines.append(f"{s.scenario}, after: {' '.join((*_OBSERVED, *s.after))}")
    return lines


def _picture(rows: Mapping[Case, RunRow], metric: Mapping[str, str]) -> Figure:
    scenarios = list(dict.fromkeys(case[0] for case in rows))
    names = list(dict.fromkeys(case[1] for case in rows))[::-1]
    columns = min(4, len(scenarios))
    lines = -(-len(scenarios) // columns)
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(1.4 * WIDTH, 0.6 + 3.0 * lines))
        panels = canvas.subplots(lines, columns, sharey=True, sharex=True, squeeze=False).ravel()
        for panel, scenario in zip(panels, scenarios, strict=False):
            for (own, name, when), row in rows.items():
                if own != scenario:
                    continue
                after, height = when == AFTER, names.index(name)
                colour = COLOURS[0] if after else COLOURS[1]
                if row.status == COMPLETED:
                    value = row.value(metric[scenario]) * 1e3
                    face = colour if after else "none"
                    panel.plot(value, height, "o", color=colour, markerfacecolor=face, ms=7)
                else:
                    across = panel.get_yaxis_transform()
                    panel.plot(0.97, height, "x", color=ALERT, ms=8, transform=across)
            panel.set(title=scenario, xscale="log", xlim=_SHOWN)
            panel.set_yticks(range(len(names)), names)
            panel.set_ylim(-0.6, len(names) - 0.4)
        for panel in panels[len(scenarios) :]:
            panel.set_visible(False)
        for panel in panels[max(0, len(scenarios) - columns) : len(scenarios)]:
            panel.set_xlabel("largest distance in mm")
        handles = [
            panels[0].plot([], [], "o", color=COLOURS[1], markerfacecolor="none")[0],
            panels[0].plot([], [], "o", color=COLOURS[0])[0],
            panels[0].plot([], [], "x", color=ALERT)[0],
        ]
        labels = ["before", "after", "stopped by a fault"]
        canvas.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        caption = "Largest deviation of the tool from the path, by error of the nominal model."
        return render(Drawing("robustness", "Deviation under disturbances", caption, canvas))
