"""Several repetitions of an experiment: Tab. C.3 and C.4 of the dissertation."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from identification.estimation.least_squares import Estimate
from identification.estimation.validation import mahalanobis
from pfsc_drake.errors import InputError

_PERCENT = 100.0


@dataclass(frozen=True)
class ParameterRow:
    """A row of Tab. C.3, with what was predicted for it.

    Attributes:
        number: j, from 1.
        name: Name of the parameter that leads the combination.
        combination: What it is a combination of.
        mean: Mean of the runs, SI units.
        unit: Unit of the mean.
        relative_deviation: Standard deviation of the runs [% of the mean]; NaN for one run.
        predicted_deviation: The same as the covariance of a run has it, RMS of the runs.
        truth: True value; NaN if unknown.
    """

    number: int
    name: str
    combination: str
    mean: float
    unit: str
    relative_deviation: float
    predicted_deviation: float
    truth: float


@dataclass(frozen=True)
class TorqueRow:
    """A column of Tab. C.4.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the torques, ``Nm`` or ``N``.
        error_rms: RMS error of single measured torques less predicted ones, RMS of the runs.
        noise_level: Standard deviation of single measured torques, RMS of the runs.
        explained: Least share of the mean torques' variance that a run's model explains.
    """

    joint: str
    unit: str
    error_rms: float
    noise_level: float
    explained: float


@dataclass(frozen=True)
class SpreadTest:
    """Whether runs differ as much as their covariance predicts.

    Attributes:
        chi_squared: ``sum_r (x_r - mean)' C^-1 (x_r - mean)``.
        degrees_of_freedom: ``R - 1`` times the number of parameters that count.
        p_value: Probability of a chi-squared at least as far from the middle, on either side.
        median_ratio: Median of empirical by predicted standard deviations.
    """

    chi_squared: float
    degrees_of_freedom: int
    p_value: float
    median_ratio: float


@dataclass(frozen=True, eq=False)
class Repetitions:
    """Estimates of the same parameters from R runs.

    Attributes:
        estimates: One for each run, of the same robot, base and friction.

    Raises:
        InputError: If there is none, or they are of different parameters.
    """

    estimates: tuple[Estimate, ...]

    def __post_init__(self) -> None:
        if not self.estimates:
            raise InputError("repetitions: no estimate; at least one is required")
        first = self.estimates[0]
        for run, other in enumerate(self.estimates, start=1):
            if other.robot != first.robot or other.names != first.names:
                raise InputError(
                    f"repetitions: run {run} is of {other.base.rank} parameters of {other.robot}; "
                    f"must be the {first.base.rank} of {first.robot}, as in the first run"
                )

    @property
    def values(self) -> np.ndarray:
        """Of the parameters in each run, shape (R, n_b)."""
        return np.array([run.base_parameters for run in self.estimates])

    @property
    def mean(self) -> np.ndarray:
        """Of the runs, shape (n_b,)."""
        return np.mean(self.values, axis=0)

    @property
    def covariance(self) -> np.ndarray:
        """Predicted of one run, mean of the runs, shape (n_b, n_b)."""
        return np.mean([run.covariance for run in self.estimates], axis=0)

    @property
    def standard_deviation(self) -> np.ndarray:
        """Of the runs about their mean, shape (n_b,); NaN for one run."""
        if len(self.estimates) < 2:
            return np.full(self.mean.shape, np.nan)
        return np.std(self.values, axis=0, ddof=1)

    @property
    def predicted_standard_deviation(self) -> np.ndarray:
        """Of one run, shape (n_b,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def covariance_of_mean(self) -> np.ndarray:
        """Of ``mean``, shape (n_b, n_b).

        The predicted one, larger where runs differ by more than it predicts, as friction does
        that is another one each day.
        """
        predicted = self.covariance / len(self.estimates)
        ratio = self.standard_deviation / self.predicted_standard_deviation
        wider = np.maximum(1.0, np.nan_to_num(ratio, nan=1.0))
        return predicted * np.outer(wider, wider)

    def parameter_rows(self, truth: np.ndarray | None = None) -> list[ParameterRow]:
        """Return the rows of Tab. C.3.

        Args:
            truth: True base parameters where they are known, shape (n_b,).
        """
        base = self.estimates[0].base
        scale = _PERCENT / np.abs(self.mean)
        known = np.full(base.rank, np.nan) if truth is None else np.asarray(truth, dtype=float)
        columns = zip(
            base.short_names,
            base.names,
            self.mean.tolist(),
            base.units,
            (self.standard_deviation * scale).tolist(),
            (self.predicted_standard_deviation * scale).tolist(),
            known.tolist(),
            strict=True,
        )
        return [ParameterRow(number, *row) for number, row in enumerate(columns, start=1)]

    def torque_rows(self) -> list[TorqueRow]:
        """Return the columns of Tab. C.4."""
        first, rows = self.estimates[0], []
        noise = np.mean([run.motion.torque_variance for run in self.estimates], axis=0)
        means = np.mean([run.motion.mean_torque_variance for run in self.estimates], axis=0)
        squares = np.mean([np.mean(run.residuals**2, axis=0) for run in self.estimates], axis=0)
        explained = np.min([_explained(run) for run in self.estimates], axis=0)
        for j, (joint, unit) in enumerate(zip(first.joint_names, first.joint_units, strict=True)):
            # single torques scatter about the mean ones
            error = float(np.sqrt(squares[j] + noise[j] - means[j]))
            torque = "Nm" if unit == "rad" else "N"
            rows.append(
                TorqueRow(joint, torque, error, float(np.sqrt(noise[j])), float(explained[j]))
            )
        return rows

    def spread_test(self, friction: bool = True) -> SpreadTest:
        """Compare the spread of the runs with what their covariance predicts.

        Args:
            friction: Whether parameters of friction count, which may be others in each run
                while those of the bodies stay.

        Raises:
            InputError: If there is one run only.
        """
        runs = len(self.estimates)
        if runs < 2:
            raise InputError("repetitions: one run; at least two are required for a spread")
        names = self.estimates[0].short_names
        counts = [i for i, name in enumerate(names) if friction or ".f_" not in name]
        covariance = self.covariance[np.ix_(counts, counts)]
        deviations = (self.values - self.mean)[:, counts]
        value = sum(mahalanobis(deviation, covariance) for deviation in deviations)
        freedom = (runs - 1) * len(counts)
        tail = min(float(chi2.cdf(value, freedom)), float(chi2.sf(value, freedom)))
        ratio = np.median((self.standard_deviation / self.predicted_standard_deviation)[counts])
        return SpreadTest(value, freedom, 2.0 * tail, float(ratio))


def _explained(run: Estimate) -> np.ndarray:
    return 1.0 - np.var(run.residuals, axis=0) / np.var(run.system.torques, axis=0)
