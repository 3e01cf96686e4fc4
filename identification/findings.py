"""Identification of a robot's model from measured motions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.consistency.bounds import PhysicalBounds
from identification.consistency.nearest import (
    ConsistentParameters,
    estimate_consistent,
    nearest_consistent,
)
from identification.estimation.choice import FrictionChoice, choose_friction
from identification.estimation.friction_terms import FrictionTerms
from identification.estimation.information import MeasuredMotion
from identification.estimation.least_squares import Estimate, estimate
from identification.estimation.repetitions import Repetitions
from identification.estimation.results import FILE_NAME, load_estimate
from identification.estimation.validation import (
    PredictedTorque,
    TruthTest,
    compare_with_truth,
    predict,
)
from identification.measurement.periods import AveragedMotion
from identification.model.base import BaseParameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress


@dataclass(frozen=True, eq=False)
class Findings:
    """Results from repeated runs of an excitation.

    Attributes:
        runs: Estimates, one for each run.
        choice: Choice of friction terms; None without one.
        prediction: Prediction of a motion that was not used; None without one.
        truth: Ground truth of the base parameters, shape (n_b,); None for a real robot.
        notes: Properties of the signals that torques cannot verify, or doubtful ones, one sentence
            each.
    """

    runs: Repetitions
    choice: FrictionChoice | None = None
    prediction: PredictedTorque | None = None
    truth: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    @property
    def estimate(self) -> Estimate:
        """Estimate of the first run."""
        return self.runs.estimates[0]

    @property
    def truth_test(self) -> TruthTest | None:
        """Errors of the first run beside their covariance; None without ground truth.

        Friction does not count, because it changes from day to day.
        """
        if self.truth is None:
            return None
        return compare_with_truth(self.estimate, self.truth, friction=False)


def find_parameters(
    regressor: Regressor,
    base: BaseParameters,
    motions: Sequence[MeasuredMotion],
    validation: MeasuredMotion | None = None,
    *,
    choose: bool = True,
    truth: np.ndarray | None = None,
    progress: Progress | None = None,
) -> Findings:
    """Estimate the base parameters of a robot from each of several motions.

    Args:
        regressor: Regressor of the robot.
        base: Its base parameters.
        motions: Periods of one excitation, averaged; at least one.
        validation: Another motion, on which friction is chosen and which is predicted.
        choose: Whether to choose friction beyond Coulomb's and viscous.
        truth: Simulated parameters of the robot, shape (n,), if it is simulated.
        progress: Receives the completed fraction and the current step.

    Raises:
        InputError: If there is no motion, or one does not fit or does not excite the robot.
    """
    if not motions:
        raise InputError("estimate: no record; at least one is required")
    tell = progress or (lambda fraction, phase: None)
    choice, friction = None, FrictionTerms()
    if choose and validation is not None:
        tell(0.0, "choosing friction")
        choice = choose_friction(regressor, base, motions[0], validation)
        friction = choice.model
    estimates = []
    for run, motion in enumerate(motions):
        tell((1 + run) / (2 + len(motions)), f"estimating, run {run + 1} of {len(motions)}")
        estimates.append(estimate(regressor, base, motion, friction))
    runs = Repetitions(tuple(estimates))
    prediction = None if validation is None else predict(estimates[0], regressor, validation)
    known = None if truth is None else true_base(estimates[0], truth)
    tell(1.0, "done")
    return Findings(runs, choice, prediction, known)


def true_base(found: Estimate, parameters: np.ndarray) -> np.ndarray:
    """Return the error-free value of an estimate, shape (n_b,).

    Args:
        found: The estimate; the robot has only Coulomb and viscous friction.
        parameters: Simulated parameters of the robot, shape (n,).
    """
    return np.concatenate(
        [found.robot_base.values(parameters), np.zeros(len(found.friction.terms))]
    )


def stored_findings(
    subject: Subject, path: Path, other: AveragedMotion | None, simulated: bool
) -> Findings:
    """Return the findings stored in ``identification.h5``.

    Args:
        subject: The robot.
        path: The file, or its folder.
        other: A motion to predict, if any.
        simulated: Whether the robot's model is the ground truth.

    Raises:
        InputError: If the file cannot be read, or belongs to another robot.
    """
    file = path / FILE_NAME if path.is_dir() else path
    runs = load_estimate(file)
    first = runs.estimates[0]
    if first.robot != subject.name:
        raise InputError(f"{file}: of {first.robot}; must be of {subject.name}")
    prediction = None if other is None else predict(first, Regressor(subject), other)
    truth = true_base(first, true_parameters(subject)) if simulated else None
    return Findings(runs, None, prediction, truth)


def consistent_set(
    findings: Findings, bounds: PhysicalBounds, direct: bool
) -> ConsistentParameters:
    """Return the consistent set of an identification.

    Args:
        findings: Base parameters.
        bounds: Bounds of the bodies.
        direct: Whether in one step from the first motion, instead of from the mean of the runs.

    Raises:
        InputError: If no bodies within the bounds have the estimated parameters.
    """
    if direct:
        return estimate_consistent(findings.estimate, bounds)
    runs, robot = findings.runs, findings.estimate.robot_base
    own = slice(0, robot.rank)
    return nearest_consistent(robot, runs.mean[own], runs.covariance_of_mean[own, own], bounds)
