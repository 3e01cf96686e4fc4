"""The best excitation of a robot that can be found: local searches from many motions."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.excitation.criterion import InformationFigures, information
from identification.excitation.excitation_program import (
    ExcitationProblem,
    believed_parameters,
    excitation_problem,
    tightened,
)
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.limits import Given, JointLimits, chosen_limits
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

# what is kept of limits for what solvers leave of them
_SHARE, _MARGIN = 0.998, 0.002
# of the drives' limits; the rest is for the servo, and for a robot that is not as it is believed
_EFFORT = 0.9
_MOST_REPAIRS = 3
_REPAIR = 1.5  # times what was missing
_ITERATIONS = 40  # of a repair
_BEST = 2  # motions that others are tried near to
_FAR = 0.02  # excess that no repair takes away


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What a search has found.

    Attributes:
        trajectory: The best motion that keeps all limits.
        criterion: ``D`` or ``condition``.
        information: Its figures.
        verification: How much of the limits it takes.
        values: Figure of each local search from the best on, ``log det(X^T X)`` or the condition
            number, of fewer samples than ``information``; those outside the limits come last.
        seconds: How long the search took [s].
        warnings: What was not checked, one sentence each.
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
        """Figures of the motion, for its file."""
        return {
            "log_determinant": round(self.information.log_determinant, 3),
            "condition_number": round(self.information.condition_number, 1),
            "base_parameters": float(self.information.base_parameters),
        }


@dataclass(frozen=True)
class SearchOptions:
    """How an excitation is searched for.

    Attributes:
        criterion: ``D`` for the largest ``log det(X^T X)`` (2.79), ``condition`` for the smallest
            condition number of X.
        harmonics: Multiples of the fundamental frequency in use.
        period: T_f [s].
        starts: Number of motions to start from: half of them random, the others in two rounds near
            the best ones that have been found.
        seed: Seed of the first of them.
        iterations: Iterations of the solver per start, at most; a quarter of them whenever it goes
            on.
        workers: Number of processes; one for each core by default, 1 for no others than this.
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
    limits: JointLimits | Mapping[str, Given] | None = None,
    cell: Cell | str | Path | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Return an excitation that shows the base parameters of a robot as well as possible.

    Args:
        subject: The robot.
        options: How it is searched for.
        limits: Limits of the joints where not those of the model, see
            :func:`~identification.excitation.limits.chosen_limits`.
        cell: What stands around a serial robot; None for what is shipped with it.
        progress: Receives the fraction done and the best figure so far.

    Raises:
        InputError: If a value is out of range, the harmonics do not show all parameters, or no
            motion keeps all limits.
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
    believed = believed_parameters(subject)
    check_postures(subject, problem)
    check_excited(subject, problem, base)
    narrower = tightened(problem, _SHARE, {}, _MARGIN)
    found: list[LocalOptimum] = []
    with side_by_side(options.workers, starts) as run:
        for count in (starts - 2 * (starts // 4), starts // 4, starts // 4):
            near: list[np.ndarray | None] = [o.coefficients for o in found[:_BEST]] or [None]
            first = options.seed + len(found)
            tasks = [(first + i, iterations, near[i % len(near)]) for i in range(count)]
            for optimum in run(_search_from, narrower, tasks):
                found.append(optimum)
                best = _said(criterion, min(found, key=_rank).value)
                tell(len(found) / (starts + 1), f"{len(found)} of {starts} starts, {best}")
            found.sort(key=_rank)
    tell(starts / (starts + 1), "checking all limits")
    trajectory, verification = _first_that_keeps_all(
        found, narrower, lambda motion: verify(regressor, believed, joints, motion, cell, scene)
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
    """Search from a seed, by a number of iterations, near to coefficients or nowhere."""
    return LocalSearch(problem).run(*start)


def _unchecked(subject: Subject, cell: Cell, scene: RobotScene | None) -> list[str]:
    """Return what was not checked, one sentence each."""
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
    """Return the best motion that keeps all limits, if need be after some repairs."""
    complaint = "no local search came to an end"
    for optimum in found:
        if not np.isfinite(optimum.value):
            continue
        trajectory, verification = _repaired(optimum, problem, check)
        if verification.keeps_all:
            return trajectory, verification
        if complaint.startswith("no "):
            complaint = verification.problems[0]
    raise InputError(
        f"excitation: no motion from {len(found)} starts keeps all limits; of the best one, "
        f"{complaint}"
    )


def _repaired(
    optimum: LocalOptimum,
    problem: ExcitationProblem,
    check: Callable[[FourierTrajectory], Verification],
) -> tuple[FourierTrajectory, Verification]:
    """Return a motion within narrower and narrower limits, until it keeps the actual ones."""
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
        narrower = tightened(problem, share, margins)
        local = LocalSearch(narrower)
        coefficients = local.improve(coefficients, optimum.seed, _ITERATIONS).coefficients
    return trajectory, verification


def _figure(criterion: str, value: float) -> float:
    """Return a criterion as people know it."""
    return -value if criterion == "D" else float(np.exp(value))


def _said(criterion: str, value: float) -> str:
    name = "log det" if criterion == "D" else "condition number"
    return f"best {name} {_figure(criterion, value):.6g}"
