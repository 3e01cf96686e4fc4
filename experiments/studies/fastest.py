"""Study of time-optimal motions on ten paths: comparison with slowed motions and a finer grid."""

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
from pfsc_drake.control.planning.joint_trajectory import TrajectoryStart
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
# randomly deformed lemniscate: seeds, largest displacement [m] and number of waypoints
_SEEDS, _BENT, _WAYPOINTS = (1, 2, 3), 0.06, 14
# for rigid joints, as in the elastic laws
_TORQUE_LEAD = ("controller.torque_lead=true",)
PATHS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "lemniscate, six elastic axes": (_LEMNISCATE, ("reference.points=[0.96, 0.31, 1.99]",)),
    "tilted circle, seven elastic axes": ("pfc_elastic_7r", ("reference.points=[0.0, 1.25]",)),
    "circle, seven rigid axes": ("pfc_panda_7r", ("reference.points=[0.0, 1.0]", *_TORQUE_LEAD)),
    "lemniscate, visco-elastic": ("pfc_viscoelastic_3r", ()),
    # its drive friction is not modelled; constrained bodies have time steps of 1 ms
    "DELTA": ("pfc_delta", ("drive_friction=false", "robot.plant=analytic", *_TORQUE_LEAD)),
    "SCARA": ("pfc_scara_4r", _TORQUE_LEAD),
    "line on a surface": ("pfc_on_surface_6r", ()),
}
# start on the path, without further targets
_COMMON = (
    *("reference.speed=fastest", "reference.velocity=null", "reference.dwell=0.2"),
    *("start.offset=[0, 0]", "start.rotation_deg=[0, 0, 0]", "start.transition=0", "targets={}"),
)
_NOMINAL = "nominal model"
_ROBOTS: Mapping[str, tuple[str, ...]] = {
    _NOMINAL: ("encoders={}", "friction={}", "model_error={}", "driver={}"),
    "nominal masses 5 % too low": (
        *("encoders={}", "friction={}", "driver={}"),
        "model_error={mass: 0.95}",
    ),
}
# requested speeds and accelerations of slowed motions [m/s, m/s^2]
_REQUESTED = ((0.5, 5.0), (1.0, 10.0), (2.0, 20.0), (4.0, 40.0))
_FINER = 4
_GOAL = "the study's goal"
_DESCRIPTION = (
    "Paths of shipped scenarios and the randomly deformed lemniscate, travelled from rest to rest "
    "in minimum time within 70 % of the nominal drives' torques and torque rates. For comparison: "
    "the shortest motion with slow-down at drive limits, requested at 0.5 to 4 m/s, without rate "
    "limits; the fastest motion without rate limits; and the fastest motion on a grid four times "
    "as fine. In closed loop: distance from the path, and largest torque relative to the largest "
    "planned one, on the nominal robot and a heavier one."
)


@dataclass(frozen=True)
class Times:
    """Durations of motions along one path [s].

    Attributes:
        fastest: Fastest motion.
        any_rate: Fastest motion without limits of torque rates.
        finer: Fastest motion on a finer grid.
        slowed: Shortest motion with slow-down at drive limits.
        preparation: Processor time for building and planning [s].
    """

    fastest: float
    any_rate: float
    finer: float
    slowed: float
    preparation: float


@dataclass(frozen=True)
class Planned:
    """Motion to be planned.

    Attributes:
        path: Name of its path.
        kind: Attribute of :class:`Times` for its duration.
        scenario: Name of the scenario.
        overrides: Overrides of the scenario.
        finer: Refinement factor of the grid.
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
        progress: Receives one line for each path and run.

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
        rows = run_side_by_side(cases, lambda case, row: progress(_row_text(case, row)))
        return write_study_page(
            results,
            title="Time-optimal motions within drive limits",
            description=_DESCRIPTION,
            overrides=[" ".join(_COMMON), *(" ".join(changes) for changes in _ROBOTS.values())],
            metrics=_metrics(times, rows),
            figures=[_picture(times)],
        )


def _random_paths(folder: Path) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Return randomly deformed lemniscates."""
    curve = FourierCurve.bent_lemniscate()
    found: dict[str, tuple[str, tuple[str, ...]]] = {}
    theta = np.linspace(*curve.domain, _WAYPOINTS + 1)[:-1]
    for seed in _SEEDS:
        moved = np.random.default_rng(seed).uniform(-_BENT, _BENT, (_WAYPOINTS, 3))
        file = folder / f"bent_{seed}.csv"
        points = curve.derivatives(theta, 0)[:, 0] + moved
        np.savetxt(file, points, delimiter=",", header="x,y,z", comments="")
        shape = f"path.shape=!Waypoints {{file: {file}, closed: true}}"
        found[f"randomly deformed lemniscate, {seed}"] = (
            _LEMNISCATE,
            (shape, "reference.points=[0.2, 1.4]"),
        )
    return found


def _all_times(
    paths: Mapping[str, tuple[str, tuple[str, ...]]], progress: Callable[[str], None]
) -> dict[str, Times]:
    """Return the durations of motions along paths, planned on all cores."""
    motions = [motion for name, path in paths.items() for motion in _motions(name, *path)]
    # what is timed comes first, before anything of it is known; then long ones, so that all
    # processes end together
    motions.sort(key=lambda motion: (motion.kind != "fastest", -motion.finer))
    found: dict[str, dict[str, float]] = defaultdict(dict)
    with side_by_side(None, len(motions)) as run:
        for motion, seconds, preparation in run(plan_motion, None, motions):
            of_path = found[motion.path]
            # a motion that could not be planned has its requested duration
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
        for velocity, acceleration in _REQUESTED
    ]
    return [
        Planned(name, "finer", scenario, overrides, _FINER),
        Planned(name, "fastest", scenario, overrides),
        Planned(name, "any_rate", scenario, (*overrides, "reference.torque_rate=.inf")),
        *(Planned(name, "slowed", scenario, (*overrides, *changes)) for changes in slowed),
    ]


def plan_motion(_: None, motion: Planned) -> tuple[Planned, float, float]:
    """Plan a motion; return it, its duration [s], NaN if infeasible, and its preparation [s].

    Args:
        motion: The motion.
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
    found = read_scenario(scenario, [*_COMMON, *overrides, *_ROBOTS[_NOMINAL]])
    settings = load_typed(Scenario, found.data, found.source)
    return settings, build_station(settings, found.path.parent)


def _planner(settings: Scenario, station: Station, folder: Path) -> FastestPlanner:
    """Return a planner for the motion of a station."""
    task = make_task(settings, folder)
    start = TrajectoryStart(station.start_posture, station.start.projection)
    options = StationOptions(settings, folder).follower
    return FastestPlanner(options, task, station.law, start, None)


def _moving(plan: DrivePlan | None) -> float:
    """Return the duration of motion of a planned reference [s]."""
    assert plan is not None  # without hand guiding
    times = plan.times
    moves = np.abs(plan.motion.derivatives(times, 1)[:, 1]).max(axis=1) > 0.0
    return float(np.diff(times, append=times[-1])[moves].sum())


def _fits(plan: DrivePlan | None) -> bool:
    """Return whether the drives can follow a plan."""
    assert plan is not None  # without hand guiding
    return len(plan.times) > 0 and (plan.is_slowed or not plan.messages)


def _row_text(case: tuple[str, str], row: RunRow) -> str:
    result = row.reason or f"{row.value('max_path_deviation') * 1e6:8.1f} um"
    return f"{case[0]:34s} {case[1]:30s} {result}"


def _metrics(times: Mapping[str, Times], rows: Mapping[tuple[str, str], RunRow]) -> Metrics:
    metrics = Metrics()
    for name, found in times.items():
        metrics.add(f"{name}: time", found.fastest, "s")
        metrics.add(f"{name}: time without rate limits", found.any_rate, "s")
        metrics.add(f"{name}: time, slowed down", found.slowed, "s")
        metrics.add(f"{name}: time, finer grid", found.finer, "s")
        for what, value, unit, target in (
            ("time relative to slowed motion", found.fastest / found.slowed, "1", "< 0.9"),
            ("time relative to finer grid", found.fastest / found.finer, "1", "< 1.02"),
            ("preparation", found.preparation, "s", "< 20"),
        ):
            metrics.add(f"{name}: {what}", value, unit, target, source=_GOAL)
    for (name, robot), row in rows.items():
        key, failed = f"{name}, {robot}", row.reason or None
        metrics.add(f"{key}: deviation", row.value("max_path_deviation"), "m", source=failed)
        applied = row.value("given_torque_share") / row.value("planned_torque_share")
        metrics.add(f"{key}: torque relative to plan", applied, "1", source=failed)
        if robot == _NOMINAL:
            metrics.set_target(f"{key}: deviation", "< 5e-5", failed or _GOAL)
            metrics.set_target(f"{key}: torque relative to plan", "< 1.01", failed or _GOAL)
    return metrics


def _picture(times: Mapping[str, Times]) -> Figure:
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, 5.0))
        panel = canvas.subplots()
        heights = np.arange(len(times))[::-1].astype(float)
        columns = {
            "slowed down at drive limits": "slowed",
            "fastest": "fastest",
            "fastest, grid four times as fine": "finer",
            "fastest, without rate limits": "any_rate",
        }
        for k, (label, key) in enumerate(columns.items()):
            values = [getattr(found, key) for found in times.values()]
            at = heights + 0.2 * (1.5 - k)
            panel.barh(at, values, height=0.18, color=COLOURS[k], label=label)
        panel.set_yticks(heights, list(times))
        panel.set(xlabel="time from rest to rest in s")
        handles, labels = panel.get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
        caption = "Total time of all moves, at 70 % of the drives' torques."
        return render(Drawing("fastest", "Durations of motions along ten paths", caption, canvas))
