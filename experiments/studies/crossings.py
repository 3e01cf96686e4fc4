"""Study of random persons crossing a path: distance from the arm, time lost."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure as Canvas

from diagrams.scenario import Scenario
from experiments.scenario_file import ScenarioFile, read_scenario
from experiments.studies.study_page import write_study_page
from experiments.sweep.many import run_side_by_side
from experiments.sweep.worker import COMPLETED, RunRow
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.physics.moving_obstacle import ObstacleParameters, ObstacleWaypoint
from pfsc_drake.yaml.typed import load_typed
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.style import COLOURS, INK, STYLE, WIDTH, Drawing, Figure, render

SCENARIO = "pfc_crossing_6r"
COUNT, SEED = 300, 1
_DESCRIPTION = (
    "Persons cross the path of pfc_crossing_6r with random position, direction, speed and time; "
    "they may slow down, accelerate or pause, and walk when the run begins. Robot, model errors, "
    "friction, encoders, noise and delay of the obstacle sensor are as in the scenario; the seed "
    "of the sensor differs in each run. Excluded are persons who would collide with the arm at its "
    "start, run, or exceed the assumed acceleration. Distances are actual ones between the "
    "surfaces of person and arm."
)
# random ranges: position on the path [m], direction [deg], speed [m/s], time [s]
_POSITIONS, _DIRECTIONS, _SPEEDS, _TIMES = (-0.2, 0.6), (35.0, 80.0), (0.4, 1.4), (0.8, 3.4)
# m, of the walk: before and after the path with changed speed, and beyond the path
_AROUND, _AFTER = 0.4, 1.6
# s, duration of pauses; share of persons with a pause
_STILL, _STANDING = (0.3, 1.2), 0.25
# factor of the mean speed, on each of the three parts of a walk
_CHANGES = (0.75, 1.15)
# least distance from the arm at the start [m], and the arm's line in the plane
_FREE = 0.3
_START = np.array([[0.1, -0.11], [0.8, -0.7]])
# s; duration, begin of the walk, and final rest
_DURATION, _BEGIN, _STOOD = 6.0, -0.2, 1.0


def random_walk(
    rng: np.random.Generator, radius: float, watch: WatchParameters
) -> list[dict[str, Any]]:
    """Return a walk across the path that avoids the arm at the start.

    Args:
        rng: Source of random numbers.
        radius: Radius of the person [m].
        watch: Largest speed and acceleration, and the radius of the arm.

    Returns:
        Positions over time as in a scenario.
    """
    while True:
        across = np.array([0.8, rng.uniform(*_POSITIONS)])
        angle = np.deg2rad(rng.uniform(*_DIRECTIONS))
        ahead = np.array([-np.cos(angle), np.sin(angle)])
        ahead *= rng.choice([-1.0, 1.0])
        speeds = rng.uniform(*_SPEEDS) * rng.uniform(*_CHANGES, size=3)
        pauses = np.zeros(2)
        if rng.random() < _STANDING:
            pauses[rng.integers(2)] = rng.uniform(*_STILL)
        near = rng.uniform(*_TIMES) - _AROUND / speeds[1] - pauses[0]
        before = _AROUND + max(near - _BEGIN, 0.5) * speeds[0]
        stops = [across + distance * ahead for distance in (-before, -_AROUND, _AROUND, _AFTER)]
        if _distance(stops[0], stops[-1], *_START) < radius + watch.arm_radius + _FREE:
            continue
        walk = _timed(stops, speeds, pauses, near)
        person = ObstacleParameters(way=[ObstacleWaypoint(x["time"], x["position"]) for x in walk])
        hastiest = watch.largest_acceleration or np.inf
        if person.largest_speed <= watch.largest_speed and person.largest_acceleration <= hastiest:
            return walk


def _timed(
    stops: Sequence[np.ndarray], speeds: np.ndarray, pauses: np.ndarray, near: float
) -> list[dict[str, Any]]:
    """Return timed positions, with given time at the second one."""
    lengths = [float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(stops)]
    durations = np.array(lengths) / speeds
    times, time = [], near - durations[0]
    for k, stop in enumerate(stops):
        times.append((time, stop))
        if k in (1, 2) and pauses[k - 1] > 0.0:
            time += pauses[k - 1]
            times.append((time, stop))
        time += durations[k] if k < len(durations) else _STOOD
    # the person rests at the end
    times.append((time, stops[-1]))
    return [
        {"time": round(float(t), 4), "position": [*(round(float(c), 4) for c in p), 0.0]}
        for t, p in times
    ]


def _distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Return the distance of two lines in the plane, from samples of both."""
    shares = np.linspace(0.0, 1.0, 200)[:, None]
    one, other = a + shares * (b - a), c + shares * (d - c)
    return float(np.linalg.norm(one[:, None] - other[None], axis=2).min())


def random_crossings(count: int = COUNT, seed: int = SEED) -> dict[int, ScenarioFile]:
    """Return scenarios with a random crossing each, by number.

    Args:
        count: Number of crossings.
        seed: Seed of all crossings.
    """
    plain = read_scenario(SCENARIO, ["targets={}", f"duration={_DURATION}"])
    settings = load_typed(Scenario, plain.data, SCENARIO)
    assert settings.obstacles is not None  # the scenario has obstacles
    radius, watch = settings.obstacles.moving[0].radius, settings.obstacles.watch
    scenarios = {}
    for k in range(count):
        data = deepcopy(plain.data)
        walk = random_walk(np.random.default_rng((seed, k)), radius, watch)
        data["obstacles"]["moving"][0]["way"] = walk
        data["obstacles"].setdefault("sensor", {})["seed"] = k + 1
        scenarios[k] = replace(plain, data=data)
    return scenarios


def write_crossings(
    out: Path, progress: Callable[[str], None], count: int = COUNT, seed: int = SEED
) -> Report:
    """Run random crossings on all cores, and write a page.

    Args:
        out: Folder for the page.
        progress: Receives one line per run, in the order in which they end.
        count: Number of crossings.
        seed: Seed of all crossings.

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page; nothing has been run then.
    """
    with open_results(out, "study") as results:
        scenarios = random_crossings(count, seed)

        def report(number: int, row: RunRow) -> None:
            progress(f"{number:4d} {_row_text(row)}")

        rows = run_side_by_side(scenarios, report)
        return write_study_page(
            results,
            title="Random crossings",
            description=_DESCRIPTION,
            overrides=[f"{SCENARIO}, {count} crossings, seed {seed}"],
            metrics=summary(rows),
            figures=[_picture(rows)],
        )


def _row_text(row: RunRow) -> str:
    if row.status != COMPLETED:
        return f"{row.status}: {row.reason}"
    least, moving = row.value("least_distance"), row.value("least_distance_while_moving")
    waited = row.value("waited_time")
    return f"least {least:.3f} m, moving {moving:.3f} m, waited {waited:.2f} s"


def summary(rows: Mapping[int, RunRow]) -> Metrics:
    """Return the metrics of all crossings.

    Args:
        rows: Results by number.
    """
    metrics = Metrics()
    good = {k: row for k, row in rows.items() if row.status == COMPLETED}
    metrics.add("crossings", len(rows), "1")
    metrics.add("not_completed", len(rows) - len(good), "1")
    columns = {
        "least_distance": ("m", np.min),
        "least_distance_while_moving": ("m", np.min),
        "waited_time": ("s", np.max),
        "max_path_deviation": ("m", np.max),
        "largest_obstacle_speed": ("m/s", np.max),
    }
    for name, (unit, worst) in columns.items():
        values = np.array([row.value(name) for row in good.values()])
        if np.isfinite(values).any():
            # without motion of the tool there is no distance during motion
            values = values[np.isfinite(values)]
            metrics.add(f"worst {name}", float(worst(values)), unit)
            metrics.add(f"median {name}", float(np.median(values)), unit)
    waited = np.array([row.value("waited_time") for row in good.values()])
    metrics.add("crossings waited for", int(np.count_nonzero(waited > 0.3)), "1")
    return metrics


def _picture(rows: Mapping[int, RunRow]) -> Figure:
    good = [row for row in rows.values() if row.status == COMPLETED]
    values = {
        name: np.array([row.value(name) for row in good])
        for name in ("least_distance", "least_distance_while_moving", "waited_time")
    }
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, 3.4))
        left, right = canvas.subplots(1, 2)
        bins = np.linspace(0.0, 1.4, 57)
        for k, (name, label) in enumerate(
            {
                "least_distance": "at any time",
                "least_distance_while_moving": "while it moves",
            }.items()
        ):
            left.hist(values[name], bins, color=COLOURS[k], alpha=0.6, label=label)
        left.axvline(0.15, color=INK, linestyle="--", linewidth=1.1, label="margin")
        left.set(xlabel="least distance in m", ylabel="crossings")
        left.legend(frameon=False)
        right.plot(values["waited_time"], values["least_distance"], "o", color=COLOURS[0], ms=3)
        right.axhline(0.15, color=INK, linestyle="--", linewidth=1.1)
        right.set(xlabel="time lost in s", ylabel="least distance in m", ylim=(0.0, None))
        caption = (
            f"{len(rows)} random crossings: least actual distance between person and arm, and the "
            "final delay of the tool."
        )
        return render(Drawing("crossings", "Random crossings", caption, canvas))
