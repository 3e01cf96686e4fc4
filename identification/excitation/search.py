"""Search for the best excitation of a robot: local searches from many motions."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.excitation.criterion import InformationFigures, information
from identification.excitation.excitation_program import (
    ExcitationProblem,
    excitation_problem,
    nominal_parameters,
    tighten,
)
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.limits import JointLimits, LimitValues, chosen_limits
from identification.excitation.local_search import LocalOptimum, LocalSearch
from identification.excitation.scene import Cell, RobotScene, cell_of
from identification.excitation.verification import (
    Verification,
    check_excited,
    check_postures,
    verify,
)
from identification.model.base import base_parameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from reporting.processes import side_by_side

# remaining share of the limits, to allow for the solver's tolerance
_SHARE, _MARGIN = 0.998, 0.002
# of the drives' limits; the rest is for the servo and for model errors
_EFFORT = 0.9
_MOST_REPAIRS = 3
_REPAIR = 1.5  # factor of the excess
_ITERATIONS = 40  # of a repair
_BEST = 2  # motions that further starts are near to
_FAR = 0.02  # excess that repairs cannot remove


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Result of a search.

    Attributes:
        trajectory: The best motion within all limits.
        criterion: ``D`` or ``condition``.
        information: Values of its criteria.
        verification: Shares of the limits that it uses.
        values: Criterion of each local search from the best on, ``log det(X^T X)`` or the condition
            number, for fewer samples than ``information``; those outside the limits come last.
        seconds: Duration of the search [s].
        warnings: Omitted checks, one sentence each.
    """

    trajectory: FourierTrajectory
    criterion: str
    information: InformationFigures
    verification: Verification
    values: list[float]
    seconds: float
    warnings: list[str]

    @property
    def figures(self) -> dict[str, float]:
        """Values of the motion's criteria, for its file."""
        return {
            "log_determinant": round(self.information.log_determinant, 3),
            "condition_number": round(self.information.condition_number, 1),
            "base_parameters": float(self.information.base_parameters),
        }


@dataclass(frozen=True)
class SearchOptions:
    """Options of the search for an excitation.

    Attributes:
        criterion: ``D`` for the largest ``log det(X^T X)`` (2.79), ``condition`` for the smallest
            condition number of X.
        harmonics: Multiples of the fundamental frequency in use.
        period: T_f [s].
        starts: Number of initial motions: half of them random, the others in two rounds near the
            best ones so far.
        seed: Seed of the first of them.
        iterations: Largest number of the solver's iterations per start; a quarter of them when it
            continues.
        workers: Number of processes; one for each core by default; with 1, this process.
    """

    criterion: str = "D"
    harmonics: Sequence[int] = (1, 3, 5)
    period: float = 10.0
    starts: int = 16
    seed: int = 0
    iterations: int = 120
    workers: int | None = None


def search(
    subject: Subject,
    options: SearchOptions | None = None,
    limits: JointLimits | Mapping[str, LimitValues] | None = None,
    cell: Cell | str | Path | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Return an excitation that is optimal for the base parameters of a robot.

    Args:
        subject: The robot.
        options: Options of the search.
        limits: Limits of the joints that differ from the model's, see
            :func:`~identification.excitation.limits.chosen_limits`.
        cell: Environment of a serial robot; None for the shipped one.
        progress: Receives the completed fraction and the best value so far.

    Raises:
        InputError: If a value is out of range, the harmonics do not excite all parameters, or no
            motion is within all limits.
    """
    begin, options = time.perf_counter(), options or SearchOptions()
    criterion, starts, iterations = options.criterion, options.starts, options.iterations
    if starts < 1 or iterations < 1:
        raise InputError(f"starts = {starts}, iterations = {iterations}; must be 1 or more")
    tell = progress or (lambda fraction, phase: None)
    tell(0.0, "preparing the search")
    joints = chosen_limits(subject, limits)
    is_serial = subject.chain is not None and subject.block is not None
    cell = cell_of(subject, cell)
    scene = RobotScene(subject, cell) if is_serial else None
    problem = excitation_problem(
        subject,
        replace(joints, effort=_EFFORT * joints.effort),
        period=options.period,
        harmonics=tuple(options.harmonics),
        criterion=criterion,
        cell=cell if is_serial else None,
        scene=scene,
    )
    regressor = Regressor(subject)
    base = base_parameters(regressor)
    parameters = nominal_parameters(subject)
    check_postures(subject, problem)
    check_excited(subject, problem, base)
    narrower = tighten(problem, _SHARE, {}, _MARGIN)
    found: list[LocalOptimum] = []
    with side_by_side(options.workers, starts) as run:
        for count in (starts - 2 * (starts // 4), starts // 4, starts // 4):
            near: list[np.ndarray | None] = [o.coefficients for o in found[:_BEST]] or [None]
            first = options.seed + len(found)
            tasks = [(first + i, iterations, near[i % len(near)]) for i in range(count)]
            for optimum in run(_search_from, narrower, tasks):
                found.append(optimum)
                best = _figure_text(criterion, min(found, key=_rank).value)
                tell(len(found) / (starts + 1), f"{len(found)} of {starts} starts, {best}")
            found.sort(key=_rank)
    tell(starts / (starts + 1), "checking all limits")
    trajectory, verification = _first_that_keeps_all(
        found, narrower, lambda motion: verify(regressor, parameters, joints, motion, cell, scene)
    )
    return SearchResult(
        trajectory,
        criterion,
        information(regressor, base, trajectory),
        verification,
        [_figure(criterion, optimum.value) for optimum in found],
        time.perf_counter() - begin,
        _unchecked(subject, cell, scene),
    )


def _search_from(
    problem: ExcitationProblem, start: tuple[int, int, np.ndarray | None]
) -> LocalOptimum:
    """Search from a seed, by a number of iterations, near to coefficients or anywhere."""
    return LocalSearch(problem).run(*start)


def _unchecked(subject: Subject, cell: Cell, scene: RobotScene | None) -> list[str]:
    """Return the omitted checks, one sentence each."""
    if scene is None:
        return []
    none = f"{subject.name}: no obstacles are known; links are checked against each other alone"
    return scene.warnings or ([] if cell.obstacles else [none])


def _rank(optimum: LocalOptimum) -> tuple[bool, float, int]:
    return optimum.excess > _FAR, optimum.value, optimum.seed


def _first_that_keeps_all(
    found: Sequence[LocalOptimum],
    problem: ExcitationProblem,
    check: Callable[[FourierTrajectory], Verification],
) -> tuple[FourierTrajectory, Verification]:
    """Return the best motion within all limits, if necessary after some repairs."""
    complaint = "no local search has finished"
    for optimum in found:
        if not np.isfinite(optimum.value):
            continue
        trajectory, verification = _repair(optimum, problem, check)
        if verification.keeps_all:
            return trajectory, verification
        if complaint.startswith("no "):
            complaint = verification.problems[0]
    raise InputError(
        f"excitation: no motion from {len(found)} starts keeps all limits; of the best one, "
        f"{complaint}"
    )


def _repair(
    optimum: LocalOptimum,
    problem: ExcitationProblem,
    check: Callable[[FourierTrajectory], Verification],
) -> tuple[FourierTrajectory, Verification]:
    """Return a motion within narrower and narrower limits, until it satisfies the actual ones."""
    share, margins = 1.0, dict.fromkeys(problem.posture.names if problem.posture else (), 0.0)
    coefficients = optimum.coefficients
    for repair in range(_MOST_REPAIRS + 1):
        trajectory = FourierTrajectory.from_coefficients(
            coefficients, problem.period, problem.harmonics
        )
        verification = check(trajectory)
        if verification.keeps_all or repair == _MOST_REPAIRS or optimum.excess > _FAR:
            break
        excess = max(float(values.max()) for values in verification.shares.values()) - 1.0
        share -= _REPAIR * max(excess, 0.0)
        for name in margins:
            margins[name] += _REPAIR * max(verification.missing(name), 0.0)
        narrower = tighten(problem, share, margins)
        local = LocalSearch(narrower)
        coefficients = local.improve(coefficients, optimum.seed, _ITERATIONS).coefficients
    return trajectory, verification


def _figure(criterion: str, value: float) -> float:
    """Return a criterion in its usual form."""
    return -value if criterion == "D" else float(np.exp(value))


def _figure_text(criterion: str, value: float) -> str:
    name = "log det" if criterion == "D" else "condition number"
    return f"best {name} {_figure(criterion, value):.6g}"
