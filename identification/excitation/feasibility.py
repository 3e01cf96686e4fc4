"""What can be said against a search before it starts."""

import numpy as np
from numpy.typing import ArrayLike

from identification.excitation.cell import Cell
from identification.excitation.criterion import BaseRegressorKernels
from identification.excitation.fourier import fourier_basis
from identification.excitation.local_search import random_motion_about
from identification.excitation.problem import ExcitationProblem
from identification.excitation.scene import RobotScene
from identification.model.base import BaseParameters
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

_POSTURES = 5000
_MOTIONS = 5
_SAMPLES = 400
# least singular value of the information matrix with columns of length one
_EXCITED = 1e-6
_NAMED = 6  # parameters in a message
_TAKES_PART = 0.2  # of the largest element of a direction


def check_start_posture(
    subject: Subject,
    problem: ExcitationProblem,
    posture: ArrayLike,
    cell: Cell,
    scene: RobotScene | None,
) -> np.ndarray:
    """Return the posture that a motion is to be about, shape (N,).

    Args:
        subject: The robot.
        problem: Its problem.
        posture: Joint positions [rad or m], shape (N,).
        cell: What stands around it.
        scene: The same for Drake; None of a robot without.

    Raises:
        InputError: If it has another shape, is outside the limits or in collision.
    """
    q = np.asarray(posture, dtype=float)
    if q.shape != (subject.dimension,) or not np.isfinite(q).all():
        raise InputError(f"posture = {q.tolist()}; must be {subject.dimension} finite numbers")
    for name, value, (lower, upper) in zip(
        subject.joint_names, q, problem.limits.position, strict=True
    ):
        if not lower < value < upper:
            raise InputError(
                f"posture: {name} = {value:g}; must be within its limits, {lower:g} to {upper:g}"
            )
    if scene is not None:
        nearest = scene.clearance(q[None])
        if nearest.least < cell.clearance:
            raise InputError(
                f"posture: {nearest.pair} are {nearest.least:.3g} m apart; must be at least "
                f"{cell.clearance:g} m"
            )
    if problem.posture is not None:
        values = problem.posture.values(q[None])[0]
        for name, value in zip(problem.posture.names, values, strict=True):
            if value < 0.0 and not name.startswith("clearance"):
                raise InputError(f"posture: {name} falls short by {-value:.3g}; must be kept")
    return q


def check_postures(subject: Subject, problem: ExcitationProblem, seed: int = 0) -> None:
    """Refuse limits that leave a robot nowhere to be.

    Args:
        subject: The robot.
        problem: Its problem.
        seed: Of random postures.

    Raises:
        InputError: If none of many random postures keeps all limits; it names what is hardest.
    """
    lower, upper = problem.limits.position.T
    random = np.random.default_rng(seed)
    q = random.uniform(lower, upper, (_POSTURES, subject.dimension))
    still = np.zeros_like(q)
    tau = np.array(problem.torque.map(len(q))(q.T, still.T, still.T)).T
    missing = [np.abs(tau) - problem.limits.effort]
    names = [f"effort limit of {name}, holding still" for name in subject.joint_names]
    if problem.posture is not None:
        missing.append(-problem.posture.values(q))
        names += problem.posture.names
    table = np.concatenate(missing, axis=1)
    if np.any(table.max(axis=1) <= 0.0):
        return
    hardest = int(np.argmax(np.mean(table > 0.0, axis=0)))
    kept = 100.0 * float(np.mean(table[:, hardest] <= 0.0))
    raise InputError(
        f"{subject.name}: none of {_POSTURES} random postures keeps all limits; hardest to keep is "
        f"the {names[hardest]}: {kept:.2g} % do, the least excess is {table[:, hardest].min():.3g}"
    )


def check_excited(
    subject: Subject, problem: ExcitationProblem, base: BaseParameters, seed: int = 0
) -> None:
    """Refuse harmonics with which random motions do not show all parameters.

    Args:
        subject: The robot.
        problem: Its problem.
        base: Its base parameters.
        seed: Of the random motions.

    Raises:
        InputError: If some are not shown; it names them.
    """
    kernels: BaseRegressorKernels = problem.kernels
    t = np.arange(_SAMPLES) * problem.period / _SAMPLES
    bases = fourier_basis(t, problem.period, problem.harmonics)
    forward = kernels.forward.map(_SAMPLES)
    best, direction = -1.0, np.zeros(base.rank)
    for i in range(_MOTIONS):
        coefficients = random_motion_about(problem, np.random.default_rng(seed + i))
        motion = [(basis @ coefficients.T).T for basis in bases]
        Y = np.array(forward(*motion)).reshape(subject.dimension, _SAMPLES, base.rank)
        X = Y.reshape(-1, base.rank)
        lengths = np.linalg.norm(X, axis=0)
        if not np.all(lengths > 0.0):
            continue
        _, values, V_T = np.linalg.svd(X / lengths, full_matrices=False)
        if values[-1] > best:
            best, direction = float(values[-1]), V_T[-1]
    if best >= _EXCITED:
        return
    order = np.argsort(-np.abs(direction))[:_NAMED]
    shown = np.abs(direction[order]) > _TAKES_PART * np.abs(direction).max()
    names = ", ".join(base.short_names[i] for i in order[shown])
    raise InputError(
        f"harmonics = {list(problem.harmonics)}: too few to show all {base.rank} base parameters "
        f"of {subject.name}; not told apart: {names}; more harmonics are needed"
    )
