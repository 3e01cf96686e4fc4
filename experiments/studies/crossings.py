"""Many persons who walk across a path at random, and how near they come to the arm."""

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
from pfsc_drake.physics.moving_obstacle import ObstacleParameters, Stride
from pfsc_drake.yaml.typed import load_typed
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.style import COLOURS, INK, STYLE, WIDTH, Drawing, Figure, render

SCENARIO = "pfc_crossing_6r"
COUNT, SEED = 300, 1
_DESCRIPTION = (
    "Persons walk across the path of pfc_crossing_6r at random: where they cross it, in which "
    "direction, how fast, when, whether they slow down, hurry or stand still on the way for a "
    "while; they walk when the run begins. Robot, model errors, friction, encoders, noise and "
    "delay of the obstacle's sensor are those of the scenario; the seed of the sensor is another "
    "one each time. Left out are only those who would walk into the arm where it stands at the "
    "start, who would run, or whose changes of speed are hastier than is reckoned with. Distances "
    "are the true ones, between the surfaces of person and arm."
)
# of what is random: place on the path [m], direction [deg], speed [m/s], when [s]
_PLACES, _DIRECTIONS, _SPEEDS, _TIMES = (-0.2, 0.6), (35.0, 80.0), (0.4, 1.4), (0.8, 3.4)
# m, of the way around the path on which the speed changes, and after the path
_AROUND, _AFTER = 0.4, 1.6
# s, for which some stand still; the share of these
_STILL, _STANDING = (0.3, 1.2), 0.25
# times the mean speed, on each of the three parts of a way
_CHANGES = (0.75, 1.15)
# least distance from the arm at the start [m], and where that is in the plane
_FREE = 0.3
_START = np.array([[0.1, -0.11], [0.8, -0.7]])
# s; since when they walk; and how long they stand in the end
_DURATION, _BEGIN, _STOOD = 6.0, -0.2, 1.0


def random_way(
    rng: np.random.Generator, radius: float, watch: WatchParameters
) -> list[dict[str, Any]]:
    """Return a way across the path that does not come near the arm at the start.

    Args:
        rng: Source of random numbers.
        radius: Of the person [m].
        watch: What nobody exceeds, and the radius of the arm.

    Returns:
        Places as a scenario has them.
    """
    while True:
        across = np.array([0.8, rng.uniform(*_PLACES)])
        angle = np.deg2rad(rng.uniform(*_DIRECTIONS))
        ahead = np.array([-np.cos(angle), np.sin(angle)])
        ahead *= rng.choice([-1.0, 1.0])
        speeds = rng.uniform(*_SPEEDS) * rng.uniform(*_CHANGES, size=3)
        pauses = np.zeros(2)
        if rng.random() < _STANDING:
            pauses[rng.integers(2)] = rng.uniform(*_STILL)
        near = rng.uniform(*_TIMES) - _AROUND / speeds[1] - pauses[0]
        before = _AROUND + max(near - _BEGIN, 0.5) * speeds[0]
        stops = [across + way * ahead for way in (-before, -_AROUND, _AROUND, _AFTER)]
        if _distance(stops[0], stops[-1], *_START) < radius + watch.arm_radius + _FREE:
            continue
        way = _timed(stops, speeds, pauses, near)
        walk = ObstacleParameters(way=[Stride(x["time"], x["position"]) for x in way])
        hastiest = watch.largest_acceleration or np.inf
        if walk.largest_speed <= watch.largest_speed and walk.largest_acceleration <= hastiest:
            return way


def _timed(
    stops: Sequence[np.ndarray], speeds: np.ndarray, pauses: np.ndarray, near: float
) -> list[dict[str, Any]]:
    """Return places with times, of which the one at the second place is given."""
    ways = [float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(stops)]
    lasts = np.array(ways) / speeds
    times, time = [], near - lasts[0]
    for k, stop in enumerate(stops):
        times.append((time, stop))
        if k in (1, 2) and pauses[k - 1] > 0.0:
            time += pauses[k - 1]
            times.append((time, stop))
        time += lasts[k] if k < len(lasts) else _STOOD
    # he stands where his way ends
    times.append((time, stops[-1]))
    return [
        {"time": round(float(t), 4), "position": [*(round(float(c), 4) for c in p), 0.0]}
        for t, p in times
    ]


def _distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Return the distance of two lines in the plane, by many points of both."""
    shares = np.linspace(0.0, 1.0, 200)[:, None]
    one, other = a + shares * (b - a), c + shares * (d - c)
    return float(np.linalg.norm(one[:, None] - other[None], axis=2).min())


def random_crossings(count: int = COUNT, seed: int = SEED) -> dict[int, ScenarioFile]:
    """Return scenarios with a random crossing each, by number.

    Args:
        count: How many.
        seed: Of all of them.
    """
    plain = read_scenario(SCENARIO, ["targets={}", f"duration={_DURATION}"])
    settings = load_typed(Scenario, plain.data, SCENARIO)
    assert settings.obstacles is not None  # that is what it is for
    radius, watch = settings.obstacles.moving[0].radius, settings.obstacles.watch
    scenarios = {}
    for k in range(count):
        data = deepcopy(plain.data)
        way = random_way(np.random.default_rng((seed, k)), radius, watch)
        data["obstacles"]["moving"][0]["way"] = way
        data["obstacles"].setdefault("sensor", {})["seed"] = k + 1
        scenarios[k] = replace(plain, data=data)
    return scenarios


def write_crossings(
    out: Path, progress: Callable[[str], None], count: int = COUNT, seed: int = SEED
) -> Report:
    """Run random crossings on all cores, and write a page.

    Args:
        out: Folder for the page.
        progress: Told one line per run, in the order in which they end.
        count: How many.
        seed: Of all of them.

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page; nothing has been run then.
    """
    with open_results(out, "study") as results:
        scenarios = random_crossings(count, seed)

        def tell(number: int, row: RunRow) -> None:
            progress(f"{number:4d} {_said(row)}")

        rows = run_side_by_side(scenarios, tell)
        return write_study_page(
            results,
            title="Random crossings",
            description=_DESCRIPTION,
            overrides=[f"{SCENARIO}, {count} ways, seed {seed}"],
            metrics=summary(rows),
            figures=[_picture(rows)],
        )


def _said(row: RunRow) -> str:
    if row.status != COMPLETED:
        return f"{row.status}: {row.reason}"
    least, moving = row.value("least_distance"), row.value("least_distance_while_moving")
    waited = row.value("waited_time")
    return f"least {least:.3f} m, moving {moving:.3f} m, waited {waited:.2f} s"


def summary(rows: Mapping[int, RunRow]) -> Metrics:
    """Return what came of all crossings.

    Args:
        rows: By number.
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
            # one who never lets the tool move has no distance while it moves
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
            f"{len(rows)} random crossings: least true distance between person and arm, and the "
            "time that the tool is late in the end."
        )
        return render(Drawing("crossings", "Random crossings", caption, canvas))
