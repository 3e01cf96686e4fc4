"""What elastic laws do with what robots measure: both sides of joints, torques, motors alone."""

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

_MOVING, _AT_REST = "max_path_deviation", "static_path_deviation"
_SHOWN = (1e-4, 1e2)  # mm
_ELASTIC = "controller.law=elastic"
SOURCES: Mapping[str, tuple[str, ...]] = {
    "both sides measured": (_ELASTIC,),
    "motors and joint torques": (
        _ELASTIC,
        "encoders.sides=motor_and_torque",
        "controller.state=from_torque",
    ),
    "motors, torques observed": (
        _ELASTIC,
        "encoders.sides=motor",
        "controller.state=observed",
    ),
    "motors, a law for rigid joints": ("controller.law=rigid", "encoders.sides=motor"),
}
_FRICTION = "friction"  # as each subject says it
_OFF = (
    "model_error.mass=0.95",
    "model_error.stiffness=1.05",
    "encoders.torque={scale: 0.01, noise: 0.001}",
)
CONDITIONS: Mapping[str, tuple[str, ...]] = {
    "as modelled": (),
    "model and torques off": _OFF,
    "friction": (_FRICTION,),
    "all at once": (*_OFF, _FRICTION),
}
_DESCRIPTION = (
    "The elastic law takes the links' side of its joints from what is measured: both sides; the "
    "motors' side and the springs' torques; the motors' side alone, with torques observed from the "
    "motors' momentum; and beside it a law for rigid joints, on the motors. 'Off': masses 5 % too "
    "low, K_s 5 % too high, torque sensors with 1 % error of scale and noise of 0.1 % of their "
    "range. Friction is identified friction of the drives, with an observer of disturbances. Gains "
    "are those that torque sensors bear. Filled: the largest distance from path or surface; "
    "open: at rest."
)
# what one run is called by: scenario, condition, source
Case = tuple[str, str, str]


@dataclass(frozen=True)
class Subject:
    """A scenario with elastic joints.

    Attributes:
        scenario: Its name.
        poles: Four poles of all coordinates [1/s].
        friction: Its identified friction.
        kinds: Kinds of coordinates that have gains.
    """

    scenario: str
    poles: tuple[float, float, float, float] = (-40.0, -40.0, -250.0, -350.0)
    friction: str = "comau_racer_1_4"
    kinds: tuple[str, ...] = ("eta", "xi", "phi")

    @property
    def gains(self) -> tuple[str, ...]:
        """Gains of both laws, as overrides."""
        integral = {kind: ", integral_pole: -15" for kind in self.kinds if kind != "posture"}
        elastic = ", ".join(
            f"{kind}: {{poles: {list(self.poles)}{integral.get(kind, '')}}}" for kind in self.kinds
        )
        rigid = ", ".join(f"{kind}: {{poles: [-30, -30]}}" for kind in self.kinds)
        return f"controller.gains={{elastic: {{{elastic}}}, rigid: {{{rigid}}}}}", "targets={}"


_WITH_POSTURE = ("eta", "xi", "phi", "posture")
SUBJECTS = (
    Subject("pfc_elastic_6r"),
    Subject("sfc_elastic_6r"),
    Subject("pfc_elastic_7r", (-30.0, -30.0, -100.0, -100.0), "franka_emika_panda", _WITH_POSTURE),
)


def write_joint_sides(
    out: Path,
    progress: Callable[[str], None],
    subjects: Sequence[Subject] = SUBJECTS,
    conditions: Mapping[str, tuple[str, ...]] = CONDITIONS,
) -> Report:
    """Run all scenarios with all that may be measured, on all cores, and write a page.

    Args:
        out: Folder for the page.
        progress: Told one line per run, in the order in which they end.
        subjects: Scenarios.
        conditions: Overrides by name.

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page; nothing has been run then.
    """
    with open_results(out, "study") as results:

        def tell(case: Case, row: RunRow) -> None:
            progress(f"{case[0]:16s} {case[1]:22s} {case[2]:31s} {_said(row)}")

        rows = run_side_by_side(_scenarios(subjects, conditions), tell)
        metrics = Metrics()
        for (scenario, condition, source), row in rows.items():
            for name, when in ((_MOVING, "largest"), (_AT_REST, "at rest")):
                key = f"{scenario}, {condition}, {source}, {when}"
                metrics.add(key, row.value(name), "m", source=row.reason or None)
        return write_study_page(
            results,
            title="Which sides of joints are measured",
            description=_DESCRIPTION,
            overrides=_listing(subjects, conditions),
            metrics=metrics,
            figures=[_picture(rows)],
        )


def _scenarios(
    subjects: Sequence[Subject], conditions: Mapping[str, tuple[str, ...]]
) -> dict[Case, ScenarioFile]:
    scenarios = {}
    for subject in subjects:
        for condition, changes in conditions.items():
            suited = [
                part
                for x in changes
                for part in (
                    (f"friction.file={subject.friction}", "controller.friction.source=observer")
                    if x == _FRICTION
                    else (x,)
                )
            ]
            for source, own in SOURCES.items():
                overrides = [*subject.gains, *own, *suited]
                case = subject.scenario, condition, source
                scenarios[case] = read_scenario(subject.scenario, overrides)
    return scenarios


def _said(row: RunRow) -> str:
    if row.status != COMPLETED:
        return row.reason
    largest, rest = (row.value(name) * 1e3 for name in (_MOVING, _AT_REST))
    return f"{largest:8.3f} mm, {rest:8.4f} mm at rest"


def _listing(subjects: Sequence[Subject], conditions: Mapping[str, tuple[str, ...]]) -> list[str]:
    lines = [f"{name}: {' '.join(changes) or '-'}" for name, changes in conditions.items()]
    lines += [f"{name}: {' '.join(changes)}" for name, changes in SOURCES.items()]
    return lines + [f"{s.scenario}: {' '.join(s.gains)}; {s.friction}" for s in subjects]


def _picture(rows: Mapping[Case, RunRow]) -> Figure:
    scenarios = list(dict.fromkeys(case[0] for case in rows))
    conditions = list(dict.fromkeys(case[1] for case in rows))[::-1]
    step = 0.8 / len(SOURCES)
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(1.4 * WIDTH, 1.0 + 0.9 * len(conditions)))
        panels = canvas.subplots(1, len(scenarios), sharey=True, sharex=True, squeeze=False)[0]
        for panel, scenario in zip(panels, scenarios, strict=True):
            for k, (source, colour) in enumerate(zip(SOURCES, COLOURS, strict=False)):
                for height, condition in enumerate(conditions):
                    row = rows[scenario, condition, source]
                    y = height + 0.4 - (k + 0.5) * step
                    if row.status != COMPLETED:
                        across = panel.get_yaxis_transform()
                        panel.plot(0.96, y, "x", color=ALERT, ms=6, transform=across)
                        continue
                    largest, rest = (row.value(name) * 1e3 for name in (_MOVING, _AT_REST))
                    panel.plot([rest, largest], [y, y], color=colour, lw=1.0)
                    panel.plot(largest, y, "o", color=colour, ms=5)
                    panel.plot(rest, y, "o", color=colour, markerfacecolor="none", ms=5)
            panel.set(title=scenario, xscale="log", xlim=_SHOWN, xlabel="distance in mm")
            panel.set_yticks(range(len(conditions)), conditions)
        handles = [
            panels[0].plot([], [], "o-", color=colour)[0]
            for _, colour in zip(SOURCES, COLOURS, strict=False)
        ]
        handles.append(panels[0].plot([], [], "x", color=ALERT)[0])
        labels = [*SOURCES, "stopped by a fault"]
        canvas.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        caption = "By how much the tool leaves path or surface, by what is measured of the joints."
        return render(Drawing("joint_sides", "What is measured of elastic joints", caption, canvas))
