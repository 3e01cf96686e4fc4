"""Path following beside what a user would take instead: many runs, one page."""

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath

import numpy as np

from experiments.studies.peers.contestants import CONTESTANTS
from experiments.studies.peers.lap import COMMON, SCENARIO, Lap
from experiments.studies.peers.picture import draw
from experiments.studies.peers.score import Score, score
from reporting.folder import open_results
from reporting.metrics import NOT_A_NUMBER, Metrics
from reporting.page import Page, Report, Table
from reporting.provenance import standard_attributes

DURATION = 6.3  # s
_WRONG = ("friction.file=franka_emika_panda", "model_error.mass=0.95")
_HAND_BEGINS = 5.2  # s, when the softest tool rests at the end of the path


def _force(force: str, begin: float) -> str:
    times = f"begin: {begin}, end: {begin + 0.6}, ramp: 0.1"
    return f"{{{times}, frame: manifold, force: {force}}}"


_BACK, _ASIDE = "[-50, 0, 0]", "[0, 60, 0]"
CALM, HAND = "undisturbed", "a hand goes 20 mm aside"
DISTURBANCES: Mapping[str, tuple[str, ...]] = {
    CALM: (),
    "masses 5 % too low, friction": _WRONG,
    "held back by 50 N": (f"forces=[{_force(_BACK, 1.0)}]",),
    "pushed aside by 60 N": (f"forces=[{_force(_ASIDE, 1.0)}]",),
    "all at once": (*_WRONG, f"forces=[{_force(_BACK, 0.8)}, {_force(_ASIDE, 1.4)}]"),
    HAND: (
        f"pushes=[{{link: tool_point, way: [0, 0, 0.02], begin: {_HAND_BEGINS}, duration: 0.5, "
        "hold: 0.4, stiffness: 5000, damping: 50, force_limit: 300, grip_ramp: 0.1}]",
    ),
}
_TITLE = "Path following beside what one would take instead"
_HEAD = (
    "law",
    "disturbance",
    "largest deviation in mm",
    "rms in mm",
    "largest turn in mrad",
    "time in s",
    "drives at most in %",
    "hand in N",
)
_CAPTION = f"{NOT_A_NUMBER}: the tool never stays within 5 mm of the end, or no hand holds it."
_DESCRIPTION = (
    "One lap of the circle of pfc_panda_7r, 1 m long, from rest to rest, at 0.4 m/s where a law is "
    "told a speed. Every law has the same plant, 1 ms of sampling, exact encoders, friction and "
    "torque limits. Path following, trajectory tracking and joint servos have both poles at -40 "
    "1/s; 'observer' adds an integral part and an observer of what the drives lose; 'yields' adds "
    "to that an impedance across the path, which feels by a force sensor. Impedance of 600 N/m and "
    "30 Nm/rad with damping 2 sqrt(K) on the tool's own velocity and errors clipped at 0.1 m is "
    "about what crisp_controllers begins with; that of 2000 N/m and 100 Nm/rad has damping that "
    "suits the arm's inertia and knows the target's velocity. Joint servos follow inverse "
    "kinematics along Drake's Toppra with 70 % of the limits of velocity, acceleration and torque, "
    "and the same slowed down to the time of the others. Deviation is the distance from the path, "
    "wherever the tool is along it; time is that from the beginning of the motion until the tool "
    "stays within 5 mm of the end; a hand of 5 N/mm takes hold of the tool once it rests there "
    "and goes 20 mm aside. 50 N along the path is what the drives of the wrist bear."
)


def write_peers(
    out: FilePath,
    progress: Callable[[str], None],
    disturbances: Mapping[str, tuple[str, ...]] = DISTURBANCES,
    duration: float = DURATION,
) -> Report:
    """Run all laws under all disturbances, and write a page.

    Args:
        out: Folder for the page.
        progress: Told one line per run.
        disturbances: Overrides by name.
        duration: Simulated time of each run [s].

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page (see
            :func:`reporting.folder.open_results`); nothing has been run then.
    """
    lap = Lap(duration)
    robot = lap.station.part.robot
    with open_results(out, "study") as results:
        found: dict[tuple[str, str], Score] = {}
        for disturbance, changes in disturbances.items():
            held_from = _HAND_BEGINS if disturbance == HAND else np.inf
            for name, contestant in CONTESTANTS.items():
                came = score(lap, robot, contestant.run(lap, changes), held_from)
                found[name, disturbance] = came
                progress(f"{disturbance}, {name}: {came}")
        metrics = Metrics()
        for (name, disturbance), came in found.items():
            for what, (value, unit) in came.numbers.items():
                key = f"{name}, {disturbance}: {what}"
                metrics.add(key, value, unit, source=came.fault or None)
        results.write("metrics.json", metrics.to_json())
        rows = [[*case, *came.cells] for case, came in found.items()]
        return Page(
            kind="Study",
            title=_TITLE,
            description=_DESCRIPTION,
            scenario_yaml_text="\n".join(_listing(disturbances)),
            metrics=metrics,
            figures=[draw(found)],
            log_attributes=standard_attributes(_TITLE),
            cards=[],
            tables=[Table("All runs", _CAPTION, _HEAD, rows)],
            details=f"What was changed in {SCENARIO}",
        ).write(results)


def _listing(disturbances: Mapping[str, tuple[str, ...]]) -> list[str]:
    lines = [" ".join(COMMON)]
    lines += [f"{name}: {' '.join(changes) or '-'}" for name, changes in disturbances.items()]
    return lines + [f"{name}: {contestant}" for name, contestant in CONTESTANTS.items()]
