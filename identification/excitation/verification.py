"""Checks before a search, and verification of the limits of its motion.

Joint limits hold between samples, too: by a bound of the second derivative. Torques are computed by
the model with the exact sign of the velocities. Distances are computed by Drake's engine, see
:mod:`~identification.excitation.swept_clearance`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from identification.excitation.balls import ends, points_of_last_link
from identification.excitation.excitation_program import ExcitationProblem
from identification.excitation.fourier import FourierTrajectory, fourier_basis
from identification.excitation.limits import JointLimits, used_shares
from identification.excitation.local_search import random_start
from identification.excitation.posture_clearance import delta_posture_limits, height_of
from identification.excitation.scene import Cell, RobotScene
from identification.excitation.swept_clearance import SweptClearance, swept_clearance
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

_POSTURES = 5000
_MOTIONS = 5
_SAMPLES = 400
# least singular value of the information matrix with columns of length one
_EXCITED = 1e-6
_NAMED = 6  # parameters in a message
_TAKES_PART = 0.2  # of the largest element of a direction


def check_postures(subject: Subject, problem: ExcitationProblem) -> None:
    """Refuse limits without allowed postures.

    Args:
        subject: The robot.
        problem: Its problem.

    Raises:
        InputError: If none of many random postures is within all limits; it names the hardest one.
    """
    lower, upper = problem.limits.position.T
    random = np.random.default_rng(0)
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
    percentage = 100.0 * float(np.mean(table[:, hardest] <= 0.0))
    raise InputError(
        f"{subject.name}: none of {_POSTURES} random postures keeps all limits; hardest to keep is "
        f"the {names[hardest]}: {percentage:.2g} % do, least excess {table[:, hardest].min():.3g}"
    )


def check_excited(subject: Subject, problem: ExcitationProblem, base: BaseParameters) -> None:
    """Refuse harmonics with which random motions do not excite all parameters.

    Args:
        subject: The robot.
        problem: Its problem.
        base: Its base parameters.

    Raises:
        InputError: If some are not excited; it names them.
    """
    t = np.arange(_SAMPLES) * problem.period / _SAMPLES
    bases = fourier_basis(t, problem.period, problem.harmonics)
    forward = problem.kernels[0].map(_SAMPLES)
    best, direction = -1.0, np.zeros(base.rank)
    for i in range(_MOTIONS):
        coefficients = random_start(problem, np.random.default_rng(i))
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
        f"harmonics = {list(problem.harmonics)}: too few to excite all {base.rank} base parameters "
        f"of {subject.name}; not distinguished: {names}; more harmonics are needed"
    )


_INSTANTS = 10_000  # per period
# tolerance at the limit, relative to it
_ROUNDING = 1e-9
_UNSURE = 0.002  # m, of distances between instants


@dataclass(frozen=True, eq=False)
class Verification:
    """Shares of the limits that one period of a motion uses.

    Attributes:
        shares: ``position`` (of the distance from the middle to a limit), ``velocity``,
            ``acceleration``, ``effort``: largest share per joint, 1 being the limit, each (N,).
        margins: Least distances to the other limits by name [m or 1]: heights above the cell's
            ``tool_above``; for a DELTA robot the limits of its workspace.
        clearance: Distances to obstacles and between links; None for robots without.
        required: Required distance [m].
        problems: Violated limits, one sentence each.
    """

    shares: Mapping[str, np.ndarray]
    margins: Mapping[str, float]
    clearance: SweptClearance | None
    required: float
    problems: list[str]

    def missing(self, name: str) -> float:
        """Return the violation of a posture limit [m or 1]; distances count as one limit."""
        if name in self.margins:
            return -self.margins[name]
        return 0.0 if self.clearance is None else self.required - self.clearance.guaranteed

    @property
    def keeps_all(self) -> bool:
        """Whether all limits are satisfied."""
        return not self.problems


def verify(
    regressor: Regressor,
    parameters: np.ndarray,
    limits: JointLimits,
    trajectory: FourierTrajectory,
    cell: Cell,
    scene: RobotScene | None,
) -> Verification:
    """Return the shares of the limits that a motion uses.

    Args:
        regressor: Regressor of the robot, with the exact sign of the velocities in Coulomb
            friction.
        parameters: Parameters of the nominal model, for the torques, shape (n,).
        limits: Limits of the joints.
        trajectory: The motion.
        cell: Environment of a serial robot.
        scene: Robot and cell in Drake; None for a robot without shapes.
    """
    subject = regressor.subject
    t = np.arange(_INSTANTS) * trajectory.period / _INSTANTS
    motion = trajectory.motion(t)
    tau = regressor.matrix(*motion) @ parameters
    shares = dict(used_shares(limits, motion, tau))
    between = _between_samples(trajectory, t[1])
    largest = (limits.reach, limits.velocity, limits.acceleration)
    for i, key in enumerate(("position", "velocity", "acceleration")):
        shares[key] = shares[key] + between[i] / largest[i]
    problems = [
        f"{key} of {subject.joint_names[j]}: {100.0 * share[j]:.4g} % of the limit"
        for key, share in shares.items()
        for j in np.flatnonzero(share > 1.0 + _ROUNDING)
    ]
    margins: dict[str, float] = {}
    clearance, required = None, cell.clearance
    if subject.delta is not None:
        workspace = delta_posture_limits(subject.delta)
        least = workspace.values(motion[0]).min(axis=0)
        margins = dict(zip(workspace.names, least.tolist(), strict=True))
    elif scene is not None and subject.chain is not None:
        if np.isfinite(cell.tool_above):
            tips = ends(subject)
            points = points_of_last_link(subject.chain, list(tips.values())).sample(motion[0])
            heights = points[..., 2].min(axis=0) - cell.tool_above
            margins = dict(zip(map(height_of, tips), heights.tolist(), strict=True))
        clearance = swept_clearance(subject.chain, scene, trajectory, required, _UNSURE)
        if clearance.least < required - _ROUNDING or clearance.guaranteed < required - _UNSURE:
            problems.append(
                f"distance of {clearance.pair}: {clearance.least:.4g} m at t = "
                f"{clearance.time:.4g} s; {required:g} m are required"
            )
    problems += [
        f"{name}: falls short by {-margin:.4g}"
        for name, margin in margins.items()
        if margin < -_ROUNDING
    ]
    return Verification(shares, margins, clearance, required, problems)


def _between_samples(trajectory: FourierTrajectory, step: float) -> np.ndarray:
    """Return by how much q, v, a may be larger between samples than at them, shape (3, N)."""
    w = 2.0 * np.pi / trajectory.period * np.array(trajectory.harmonics)
    amplitudes = np.hypot(trajectory.a, trajectory.b)
    # the second derivative of v's harmonics is w^2 times them
    return np.array([amplitudes @ w ** (order + 1) for order in range(3)]) * step**2 / 8.0
