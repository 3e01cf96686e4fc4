"""The fastest motion on ten paths: against motions that are slowed down, and a finer grid."""

import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure as Canvas

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from diagrams.scenario_task import make_task
from diagrams.station import Station
from diagrams.station_options import StationOptions
from experiments.scenario_file import find_scenario, read_scenario
from experiments.studies.study_page import write_study_page
from experiments.sweep.many import run_side_by_side
from experiments.sweep.worker import RunRow
from pfsc_drake.control.planning.joint_course import CourseStart
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.controller.planning.fastest_motion import FastestPlanner
from pfsc_drake.geometry import FourierCurve
from pfsc_drake.yaml.typed import load_typed
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.processes import side_by_side
from reporting.style import COLOURS, STYLE, WIDTH, Drawing, Figure, render

_LEMNISCATE = "pfc_elastic_6r"
# the lemniscate bent at random: seeds, and how far its waypoints are moved [m]
_SEEDS, _BENT, _WAYPOINTS = (1, 2, 3), 0.06, 14
# of rigid joints, as the elastic laws do it anyway
_LED = ("controller.torque_lead=true",)
PATHS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "lemniscate, six elastic axes": (_LEMNISCATE, ("reference.points=[0.96, 0.31, 1.99]",)),
    "tilted circle, seven elastic axes": ("pfc_elastic_7r", ("reference.points=[0.0, 1.25]",)),
    "circle, seven rigid axes": ("pfc_panda_7r", ("reference.points=[0.0, 1.0]", *_LED)),
    "lemniscate, visco-elastic": ("pfc_viscoelastic_3r", ()),
    # friction of its drives is nothing that is believed; bodies that are tied move in steps of 1 ms
    "DELTA": ("pfc_delta", ("drive_friction=false", "robot.plant=analytic", *_LED)),
    "SCARA": ("pfc_scara_4r", _LED),
    "line on a surface": ("pfc_on_surface_6r", ()),
}
# on the path from the start, and nothing but the motion to be told of
_COMMON = (
    *("reference.speed=fastest", "reference.velocity=null", "reference.dwell=0.2"),
    *("start.offset=[0, 0]", "start.rotation_deg=[0, 0, 0]", "start.transition=0", "targets={}"),
)
_AS_BELIEVED = "as believed"
_ROBOTS: Mapping[str, tuple[str, ...]] = {
    _AS_BELIEVED: ("encoders={}", "friction={}", "model_error={}", "driver={}"),
    "masses believed 5 % too low": (
        *("encoders={}", "friction={}", "driver={}"),
        "model_error={mass: 0.95}",
    ),
}
# what a motion that is slowed down was asked for [m/s, m/s^2]
_ASKED = ((0.5, 5.0), (1.0, 10.0), (2.0, 20.0), (4.0, 40.0))
_FINER = 4
_GOAL = "the study's goal"
_DESCRIPTION = (
    "Paths of shipped scenarios and the lemniscate bent at random, gone along from rest to rest in "
    "the least time that 70 % of the believed drives' torques and of their rates allow. Beside "
    "it: the shortest of the motions that are slowed down where they do not fit, asked for at "
    "0.5 to 4 m/s, which know no rates; the fastest when rates are left alone; and the fastest on "
    "a grid four times as fine. Then the closed loop: distance from the path, and the largest "
    "torque by the largest that was planned, on the robot that is believed and a heavier one."
)


@dataclass(frozen=True)
class Times:
    """How long motions along one path take [s].

    Attributes:
        fastest: The fastest.
        any_rate: The fastest if rates of torques are not limited.
        finer: The fastest on a finer grid.
        slowed: The shortest that is slowed down where it does not fit.
        preparation: What building and planning took of a processor [s].
    """

    fastest: float
    any_rate: float
    finer: float
    slowed: float
    preparation: float


@dataclass(frozen=True)
class Planned:
    """A motion that is to be planned.

    Attributes:
        path: Name of its path.
        kind: What its duration is of :class:`Times`.
        scenario: Name of the scenario.
        overrides: What of it is different.
        finer: By how much the grid is finer.
    """

    path: str
    kind: str
    scenario: str
    overrides: tuple[str, ...]
    finer: int = 1


def write_fastest(out: Path, progress: Callable[[str], None]) -> Report:
    """Plan and run the fastest motion along ten paths, and write a page.

    Args:
        out: Folder for the page.
        progress: Told one line for each path and run.

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page (see
            :func:`reporting.folder.open_results`); nothing has been run then.
    """
    with open_results(out, "study") as results, TemporaryDirectory() as folder:
        paths = {**PATHS, **_random_paths(Path(folder))}
        times = _all_times(paths, progress)
        cases = {
            (name, robot): read_scenario(scenario, [*_COMMON, *overrides, *changes])
            for name, (scenario, overrides) in paths.items()
            for robot, changes in _ROBOTS.items()
        }
        rows = run_side_by_side(cases, lambda case, row: progress(_said(case, row)))
        return write_study_page(
            results,
            title="As fast as the drives allow",
            description=_DESCRIPTION,
            overrides=[" ".join(_COMMON), *(" ".join(changes) for changes in _ROBOTS.values())],
            metrics=_metrics(times, rows),
            figures=[_picture(times)],
        )


def _random_paths(folder: Path) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Return the lemniscate bent at random."""
    curve = FourierCurve.bent_lemniscate()
    found: dict[str, tuple[str, tuple[str, ...]]] = {}
    theta = np.linspace(*curve.domain, _WAYPOINTS + 1)[:-1]
    for seed in _SEEDS:
        moved = np.random.default_rng(seed).uniform(-_BENT, _BENT, (_WAYPOINTS, 3))
        file = folder / f"bent_{seed}.csv"
        points = curve.derivatives(theta, 0)[:, 0] + moved
        np.savetxt(file, points, delimiter=",", header="x,y,z", comments="")
        shape = f"path.shape=!Waypoints {{file: {file}, closed: true}}"
        found[f"lemniscate bent at random, {seed}"] = (
            _LEMNISCATE,
            (shape, "reference.points=[0.2, 1.4]"),
        )
    return found


def _all_times(
    paths: Mapping[str, tuple[str, tuple[str, ...]]], progress: Callable[[str], None]
) -> dict[str, Times]:
    """Return how long motions along paths take, planned on all cores."""
    motions = [motion for name, path in paths.items() for motion in _motions(name, *path)]
    # what is timed comes first, before anything of it is known; then long ones, so that all
    # processes end together
    motions.sort(key=lambda motion: (motion.kind != "fastest", -motion.finer))
    found: dict[str, dict[str, float]] = defaultdict(dict)
    with side_by_side(None, len(motions)) as run:
        for motion, seconds, preparation in run(plan_motion, None, motions):
            of_path = found[motion.path]
            # one that could not be planned is as it was asked for
            of_path[motion.kind] = np.fmin(of_path.get(motion.kind, np.nan), seconds)
            if motion.kind == "fastest":
                of_path["preparation"] = preparation
            progress(f"{motion.path:34s} {motion.kind:10s} {seconds:6.3f} s")
    return {name: Times(**found[name]) for name in paths}


def _motions(name: str, scenario: str, overrides: tuple[str, ...]) -> list[Planned]:
    """Return the motions along a path."""
    slowed = [
        (
            *("reference.speed=asked", f"reference.velocity={velocity}"),
            f"reference.acceleration={acceleration}",
        )
        for velocity, acceleration in _ASKED
    ]
    return [
        Planned(name, "finer", scenario, overrides, _FINER),
        Planned(name, "fastest", scenario, overrides),
        Planned(name, "any_rate", scenario, (*overrides, "reference.torque_rate=.inf")),
        *(Planned(name, "slowed", scenario, (*overrides, *changes)) for changes in slowed),
    ]


def plan_motion(_: None, motion: Planned) -> tuple[Planned, float, float]:
    """Return a motion, how long it takes [s], NaN if it does not fit, and its preparation [s].

    Args:
        motion: What to plan.
    """
    begin = time.process_time()
    settings, station = _built(motion.scenario, *motion.overrides)
    preparation = time.process_time() - begin
    plan = station.task.drive_plan
    if motion.finer > 1:
        folder = find_scenario(motion.scenario).parent
        plan = _planner(settings, station, folder).plan(motion.finer)
    fits = motion.kind != "slowed" or _fits(plan)
    return motion, _moving(plan) if fits else np.nan, preparation


def _built(scenario: str, *overrides: str) -> tuple[Scenario, Station]:
    """Return the settings of a scenario, and its station."""
    found = read_scenario(scenario, [*_COMMON, *overrides, *_ROBOTS[_AS_BELIEVED]])
    settings = load_typed(Scenario, found.data, str(found.path))
    return settings, build_station(settings, found.path.parent)


def _planner(settings: Scenario, station: Station, folder: Path) -> FastestPlanner:
    """Return what plans the motion of a station anew."""
    task = make_task(settings, folder)
    start = CourseStart(station.start_posture, station.start.place)
    options = StationOptions(settings, folder).follower
    return FastestPlanner(options, task, station.law, start, None)


def _moving(plan: DrivePlan | None) -> float:
    """Return how long a planned reference moves [s]."""
    assert plan is not None  # no hand leads here
    times = plan.times
    moves = np.abs(plan.motion.derivatives(times, 1)[:, 1]).max(axis=1) > 0.0
    return float(np.diff(times, append=times[-1])[moves].sum())


def _fits(plan: DrivePlan | None) -> bool:
    """Return whether the drives can follow a plan."""
    assert plan is not None  # no hand leads here
    return len(plan.times) > 0 and (plan.is_slowed or not plan.said)


def _said(case: tuple[str, str], row: RunRow) -> str:
    result = row.reason or f"{row.value('max_path_deviation') * 1e6:8.1f} um"
    return f"{case[0]:34s} {case[1]:30s} {result}"


def _metrics(times: Mapping[str, Times], rows: Mapping[tuple[str, str], RunRow]) -> Metrics:
    metrics = Metrics()
    for name, found in times.items():
        metrics.add(f"{name}: time", found.fastest, "s")
        metrics.add(f"{name}: time, rates left alone", found.any_rate, "s")
        metrics.add(f"{name}: time, slowed", found.slowed, "s")
        metrics.add(f"{name}: time, finer grid", found.finer, "s")
        for what, value, unit, target in (
            ("time by that of slowed", found.fastest / found.slowed, "1", "< 0.9"),
            ("time by that of the finer grid", found.fastest / found.finer, "1", "< 1.02"),
            ("preparation", found.preparation, "s", "< 20"),
        ):
            metrics.add(f"{name}: {what}", value, unit, target, source=_GOAL)
    for (name, robot), row in rows.items():
        key, failed = f"{name}, {robot}", row.reason or None
        metrics.add(f"{key}: deviation", row.value("max_path_deviation"), "m", source=failed)
        given = row.value("given_torque_share") / row.value("planned_torque_share")
        metrics.add(f"{key}: torque by plan", given, "1", source=failed)
        if robot == _AS_BELIEVED:
            metrics.set_target(f"{key}: deviation", "< 5e-5", failed or _GOAL)
            metrics.set_target(f"{key}: torque by plan", "< 1.01", failed or _GOAL)
    return metrics


def _picture(times: Mapping[str, Times]) -> Figure:
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, 5.0))
        panel = canvas.subplots()
        places = np.arange(len(times))[::-1].astype(float)
        columns = {
            "slowed down where it does not fit": "slowed",
            "fastest": "fastest",
            "fastest, grid four times as fine": "finer",
            "fastest, rates of torques left alone": "any_rate",
        }
        for k, (label, key) in enumerate(columns.items()):
            values = [getattr(found, key) for found in times.values()]
            at = places + 0.2 * (1.5 - k)
            panel.barh(at, values, height=0.18, color=COLOURS[k], label=label)
        panel.set_yticks(places, list(times))
        panel.set(xlabel="time from rest to rest in s")
        handles, labels = panel.get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
        caption = "Time of all moves together, at 70 % of the drives' torques."
        return render(Drawing("fastest", "Times of motions along ten paths", caption, canvas))
