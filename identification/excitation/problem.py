"""What a search for an excitation needs to know, in a form that goes to other processes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from identification.excitation.clearance import (
    PostureLimits,
    delta_posture_limits,
    serial_posture_limits,
)
from identification.excitation.criterion import CRITERIA, BaseRegressorKernels
from identification.excitation.fourier import check_harmonics, check_period
from identification.excitation.limits import JointLimits, numbers
from identification.excitation.scene import Cell, RobotScene
from identification.model.base import base_parameters
from identification.model.parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

# of the largest velocity; Coulomb friction passes smoothly within, so that gradients exist
_SIGN_WIDTH = 0.01


@dataclass(frozen=True, eq=False)
class ExcitationProblem:
    """The optimization problem (2.79) of one robot.

    Attributes:
        period: T_f [s].
        harmonics: Multiples of the fundamental frequency in use.
        limits: Limits of the joints.
        kernels: Kernels of the criterion.
        torque: ``(q, v, a) -> tau``, predicted torques of the drives.
        posture: What the joint positions must keep to; None for nothing but the limits.
        criterion: ``D`` or ``condition``.
    """

    period: float
    harmonics: tuple[int, ...]
    limits: JointLimits
    kernels: BaseRegressorKernels
    torque: ca.Function
    posture: PostureLimits | None
    criterion: str

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return self.limits.velocity.size

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the coefficients, (N, 2M + 1)."""
        return self.dimension, 2 * len(self.harmonics) + 1


def excitation_problem(
    subject: Subject,
    limits: JointLimits,
    *,
    period: float = 10.0,
    harmonics: tuple[int, ...] = (1, 3, 5),
    criterion: str = "D",
    cell: Cell | None = None,
    scene: RobotScene | None = None,
    parameters: np.ndarray | None = None,
    torque_noise: np.ndarray | None = None,
) -> ExcitationProblem:
    """Return the problem of a robot.

    Args:
        subject: The robot.
        limits: Limits of its joints.
        period: T_f [s].
        harmonics: Multiples of the fundamental frequency in use.
        criterion: ``D`` or ``condition``.
        cell: What stands around a serial robot.
        scene: The same for Drake; made anew if there is a cell alone.
        parameters: Believed ones, for the torques, shape (n,); those of the model by default.
        torque_noise: Standard deviations of the measured torques, which weight the rows of the
            regressor, shape (N,) [Nm or N]; all one by default.

    Raises:
        InputError: If a value is out of range.
    """
    check_period(period)
    check_harmonics(harmonics)
    if criterion not in CRITERIA:
        raise InputError(f"criterion = {criterion!r}; must be one of {', '.join(CRITERIA)}")
    n = subject.dimension
    weights = None
    if torque_noise is not None:
        noise = numbers("torque_noise", torque_noise)
        if noise.shape != (n,) or not np.all((noise > 0.0) & np.isfinite(noise)):
            raise InputError(f"torque_noise = {noise.tolist()}; must be {n} positive numbers")
        weights = 1.0 / noise
    smooth = Regressor(subject, sign_width=_SIGN_WIDTH * float(limits.velocity.max()))
    base = base_parameters(Regressor(subject))
    believed = believed_parameters(subject, parameters)
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    tau = ca.densify(smooth.function(q, v, a) @ ca.DM(believed))
    posture: PostureLimits | None = None
    if subject.delta is not None:
        posture = delta_posture_limits(subject.delta)
    elif cell is not None:
        posture = serial_posture_limits(subject, cell, scene or RobotScene(subject, cell))
    return ExcitationProblem(
        period,
        tuple(harmonics),
        limits,
        BaseRegressorKernels.of(smooth, base, weights),
        ca.Function("torque", [q, v, a], [tau], ["q", "v", "a"], ["tau"]),
        posture,
        criterion,
    )


def believed_parameters(subject: Subject, given: np.ndarray | None = None) -> np.ndarray:
    """Return parameters to predict torques with, shape (n,).

    Args:
        subject: The robot.
        given: Those, shape (n,); by default what the model says, with no friction where unknown.

    Raises:
        InputError: If they are too few or too many, or not finite.
    """
    own = true_parameters(subject)
    if given is None:
        return np.nan_to_num(own)
    believed = numbers("parameters", given)
    if believed.shape != own.shape or not np.isfinite(believed).all():
        raise InputError(
            f"parameters: shape {believed.shape}; must be {own.size} finite numbers for "
            f"{subject.name}"
        )
    return believed


def tightened(
    problem: ExcitationProblem, share: float, margins: Mapping[str, float], margin: float = 0.0
) -> ExcitationProblem:
    """Return the problem with narrower limits, for what solvers leave of them.

    Args:
        problem: Problem of a robot.
        share: Share of the joint limits that is left.
        margins: Least values of posture limits by name, instead of zero [m or 1].
        margin: Margin at those that are not named [m or 1].
    """
    posture = problem.posture
    if posture is not None:
        q = ca.SX.sym("q", problem.dimension)
        least = ca.DM([margins.get(name, margin) for name in posture.names])
        g = posture.function(q) - least
        posture = replace(posture, function=ca.Function("g", [q], [g], ["q"], ["g"]))
    return replace(problem, limits=problem.limits.scaled(share), posture=posture)
