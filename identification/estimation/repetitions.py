"""Several repetitions of an experiment: Tab. C.3 and C.4 of the dissertation."""

from dataclasses import dataclass

import numpy as np

from identification.estimation.least_squares import Estimate
from identification.estimation.validation import mahalanobis, two_sided
from pfsc_drake.errors import InputError


@dataclass(frozen=True)
class SpreadTest:
    """Test whether runs differ as much as their covariance predicts.

    Attributes:
        chi_squared: ``sum_r (x_r - mean)' C^-1 (x_r - mean)``.
        degrees_of_freedom: ``R - 1`` times the number of used parameters.
        p_value: Probability of a chi-squared at least as far from the middle, on either side.
        median_ratio: Median of the ratios of empirical to predicted standard deviations.
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
        InputError: If there is none, or they have different parameters.
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
        """Parameters of each run, shape (R, n_b)."""
        return np.array([run.base_parameters for run in self.estimates])

    @property
    def mean(self) -> np.ndarray:
        """Mean of the runs, shape (n_b,)."""
        return np.mean(self.values, axis=0)

    @property
    def covariance(self) -> np.ndarray:
        """Predicted covariance of one run, mean of the runs, shape (n_b, n_b)."""
        return np.mean([run.covariance for run in self.estimates], axis=0)

    @property
    def standard_deviation(self) -> np.ndarray:
        """Standard deviations of the runs about their mean, shape (n_b,); NaN for one run."""
        if len(self.estimates) < 2:
            return np.full(self.mean.shape, np.nan)
        return np.std(self.values, axis=0, ddof=1)

    @property
    def predicted_standard_deviation(self) -> np.ndarray:
        """Predicted standard deviations of one run, shape (n_b,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def covariance_of_mean(self) -> np.ndarray:
        """Covariance of ``mean``, shape (n_b, n_b).

        The predicted one, larger if runs differ by more than it predicts, as friction does, which
        changes from day to day.
        """
        predicted = self.covariance / len(self.estimates)
        ratio = self.standard_deviation / self.predicted_standard_deviation
        wider = np.maximum(1.0, np.nan_to_num(ratio, nan=1.0))
        return predicted * np.outer(wider, wider)

    @property
    def noise_level(self) -> np.ndarray:
        """Standard deviation of single measured torques, RMS of the runs [Nm or N], shape (N,)."""
        return np.sqrt(np.mean([run.motion.torque_variance for run in self.estimates], axis=0))

    @property
    def error_rms(self) -> np.ndarray:
        """RMS of single measured torques less predicted ones, RMS of the runs, shape (N,)."""
        noise = np.mean([run.motion.torque_variance for run in self.estimates], axis=0)
        means = np.mean([run.motion.mean_torque_variance for run in self.estimates], axis=0)
        squares = np.mean([np.mean(run.residuals**2, axis=0) for run in self.estimates], axis=0)
        # single torques scatter about the mean ones
        return np.sqrt(squares + noise - means)

    @property
    def explained(self) -> np.ndarray:
        """Least share of the mean torques' variance that a run's model explains, shape (N,)."""
        shares = [
            1.0 - np.var(run.residuals, axis=0) / np.var(run.system.torques, axis=0)
            for run in self.estimates
        ]
        return np.min(shares, axis=0)

    def spread_test(self, friction: bool = True) -> SpreadTest:
        """Compare the spread of the runs with their covariance.

        Args:
            friction: Whether parameters of friction count, which may differ between runs, while
                those of the bodies stay the same.

        Raises:
            InputError: If there is only one run.
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
        ratio = np.median((self.standard_deviation / self.predicted_standard_deviation)[counts])
        return SpreadTest(value, freedom, two_sided(value, freedom), float(ratio))
