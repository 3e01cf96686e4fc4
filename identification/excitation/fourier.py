"""Periodic motions of all joints as Fourier series.

With the fundamental frequency ``w_f = 2 pi / T_f`` and the harmonics k in use, joint i moves by

    q_i(t)   = q_i0 + sum_k a_ik / (k w_f) sin(k w_f t) - b_ik / (k w_f) cos(k w_f t)
    q_i'(t)  =        sum_k a_ik cos(k w_f t)           + b_ik sin(k w_f t)

which is Swevers' form of (2.78): the coefficients are amplitudes of the velocity. The dissertation
prints the sum without the factors ``1 / (k w_f)``; its Tab. C.2 satisfies the limits of Tab. C.1
only with them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from identification.output import write_text
from pfsc_drake.errors import InputError, shorten
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.yaml.fields import REQUIRED
from pfsc_drake.yaml.reading import dump_yaml
from pfsc_drake.yaml.typed import load_file

# tolerance of a number of samples from an integer
_ROUNDING = 1e-6
_MOST_HARMONICS = 100
_DIGITS = 9  # of coefficients in a file


@dataclass(frozen=True, eq=False)
class FourierTrajectory:
    """One period of an excitation of N joints, with M harmonics.

    Attributes:
        q_0: Offsets of the joints [rad or m], shape (N,).
        a: Velocity amplitudes of the cosines [rad/s or m/s], shape (N, M).
        b: Velocity amplitudes of the sines [rad/s or m/s], shape (N, M).
        period: T_f [s].
        harmonics: Multiples k of the fundamental frequency, M different positive integers.

    Raises:
        InputError: If a shape, the period or a harmonic is out of range, or a value not finite.
    """

    q_0: np.ndarray
    a: np.ndarray
    b: np.ndarray
    period: float
    harmonics: tuple[int, ...]

    def __post_init__(self) -> None:
        """Check all values."""
        check_period(self.period)
        check_harmonics(self.harmonics)
        q_0, a, b = (np.array(value, dtype=float) for value in (self.q_0, self.a, self.b))
        shape = (q_0.size, len(self.harmonics))
        if q_0.ndim != 1 or not q_0.size or a.shape != shape or b.shape != shape:
            raise InputError(
                f"excitation: q_0, a, b have shapes {q_0.shape}, {a.shape}, {b.shape}; allowed: "
                f"(N,), (N, M), (N, M) for N joints and M = {len(self.harmonics)} harmonics"
            )
        for name, value in (("q_0", q_0), ("a", a), ("b", b)):
            if not np.isfinite(value).all():
                raise InputError(f"excitation: {name} = {value.tolist()}; must be finite numbers")
            object.__setattr__(self, name, value)
        object.__setattr__(self, "harmonics", tuple(int(k) for k in self.harmonics))

    @classmethod
    def from_coefficients(
        cls, coefficients: np.ndarray, period: float, harmonics: Sequence[int]
    ) -> "FourierTrajectory":
        """Return the trajectory of coefficients in the form of :attr:`coefficients`."""
        table = np.asarray(coefficients, dtype=float)
        return cls(table[:, 0], table[:, 1::2], table[:, 2::2], period, tuple(harmonics))

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return self.q_0.size

    @cached_property
    def coefficients(self) -> np.ndarray:
        """The unknowns ``nu`` of (2.79), joint by joint: rows ``[q_i0, a_i1, b_i1, ..]``.

        Shape (N, 2M + 1).
        """
        table = np.empty((self.dimension, 2 * len(self.harmonics) + 1))
        table[:, 0], table[:, 1::2], table[:, 2::2] = self.q_0, self.a, self.b
        return table

    def motion(self, t: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return positions, velocities and accelerations.

        Args:
            t: Times [s], shape (K,); the motion is periodic.

        Returns:
            q, v, a, each of shape (K, N) [rad or m, per s, per s^2].
        """
        bases = fourier_basis(t, self.period, self.harmonics)
        q, v, a = (basis @ self.coefficients.T for basis in bases)
        return q, v, a

    def sample_times(self, rate: float) -> np.ndarray:
        """Return the times of one period at a sampling rate, without its end [s], shape (K,).

        Args:
            rate: Rate of samples [Hz].

        Raises:
            InputError: If the period is not a multiple of the sampling time.
        """
        return np.arange(samples_per_period(self.period, rate)) / rate

    def save(
        self,
        path: str | Path,
        robot: str = "",
        source: str = "",
        joints: Sequence[str] = (),
        figures: Mapping[str, float] | None = None,
    ) -> None:
        """Write the coefficients as YAML.

        Args:
            path: Path of the file, which is replaced.
            robot: Name of the robot.
            source: Source of the coefficients.
            joints: Names of the joints.
            figures: Values of its criteria, by name.

        Raises:
            InputError: If the file cannot be written.
        """
        content = {
            "robot": robot,
            "source": source,
            "joints": list(joints),
            "period": float(self.period),
            "harmonics": list(self.harmonics),
            "q_0": np.round(self.q_0, _DIGITS).tolist(),
            "a": np.round(self.a, _DIGITS).tolist(),
            "b": np.round(self.b, _DIGITS).tolist(),
            "figures": dict(figures or {}),
        }
        write_text(Path(path), dump_yaml(content))

    @classmethod
    def load(cls, path: str | Path) -> "FourierTrajectory":
        """Return the trajectory of a file from :meth:`save`.

        Raises:
            InputError: If the file cannot be read, a key is missing or unknown, or a value is out
                of range; one line that names the file.
        """
        file = load_file(ExcitationFile, path)
        try:
            return file.trajectory()
        except InputError as error:
            raise InputError(f"{path}: {error}") from None


@dataclass
class ExcitationFile:
    """Content of an excitation file; see :class:`FourierTrajectory`.

    Attributes:
        robot: Name of the robot.
        source: Source of the coefficients.
        joints: Names of the joints, or none.
        period: T_f [s].
        harmonics: Multiples of the fundamental frequency.
        q_0: ``[N]`` offsets [rad or m].
        a: ``[N, M]`` velocity amplitudes of the cosines [rad/s or m/s].
        b: ``[N, M]`` velocity amplitudes of the sines [rad/s or m/s].
        figures: Values of its criteria, by name.
    """

    period: float = field(default=1.0, metadata=REQUIRED)
    harmonics: list[int] = field(default_factory=lambda: [1], metadata=REQUIRED)
    q_0: np.ndarray = field(default_factory=lambda: np.zeros(1), metadata=REQUIRED)
    a: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)), metadata=REQUIRED)
    b: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)), metadata=REQUIRED)
    robot: str = ""
    source: str = ""
    joints: list[str] = field(default_factory=list)
    figures: dict[str, float] = field(default_factory=dict)

    def trajectory(self) -> FourierTrajectory:
        """Return the trajectory; raises InputError if shapes or values do not fit."""
        if self.joints and len(self.joints) != np.size(self.q_0):
            raise InputError(
                f"joints: {len(self.joints)} names for {np.size(self.q_0)} offsets q_0; "
                "must be as many, or none"
            )
        return FourierTrajectory(self.q_0, self.a, self.b, self.period, tuple(self.harmonics))


def shipped_excitation(robot: str = "comau_racer_1_4", name: str = "excitation") -> Path:
    """Return the file of a shipped excitation.

    Args:
        robot: Name of the shipped robot.
        name: ``excitation`` (Tab. C.2) or ``excitation_optimal``.

    Raises:
        InputError: If there is no such file.
    """
    file = models_directory() / robot / f"{name}.yaml"
    known = sorted(path.stem for path in models_directory().glob(f"{robot}/excitation*.yaml"))
    if file.stem not in known:
        allowed = ", ".join(known) or "none for this robot"
        raise InputError(f"excitation {shorten(name)!r} of {shorten(robot)!r}: allowed: {allowed}")
    return file


def fourier_basis(
    t: ArrayLike, period: float, harmonics: Sequence[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the factors of the rows of coefficients, see :class:`FourierTrajectory`.

    Args:
        t: Times [s], shape (K,).
        period: T_f [s].
        harmonics: Multiples of the fundamental frequency, M of them.

    Returns:
        Matrices for position, velocity and acceleration, each of shape (K, 2M + 1).
    """
    w = 2.0 * np.pi / period * np.asarray(harmonics, dtype=float)
    phase = np.asarray(t, dtype=float)[:, None] * w
    sine, cosine = np.sin(phase), np.cos(phase)
    bases = []
    for constant, with_a, with_b in (
        (1.0, sine / w, -cosine / w),
        (0.0, cosine, sine),
        (0.0, -w * sine, w * cosine),
    ):
        basis = np.full((len(phase), 2 * w.size + 1), constant)
        basis[:, 1::2], basis[:, 2::2] = with_a, with_b
        bases.append(basis)
    return bases[0], bases[1], bases[2]


def samples_per_period(period: float, rate: float) -> int:
    """Return the number of samples in a period.

    Args:
        period: T_f [s].
        rate: Rate of samples [Hz].

    Raises:
        InputError: If it is not an integer.
    """
    if not (np.isfinite(rate) and rate > 0.0):
        raise InputError(f"sampling rate = {rate!r} Hz; must be a positive number")
    samples = period * rate
    if round(samples) < 1 or abs(samples - round(samples)) > _ROUNDING * samples:
        raise InputError(
            f"period = {period:g} s: {samples:.9g} samples at {rate:g} Hz; must be a multiple of "
            f"the sampling time, {1.0 / rate:g} s"
        )
    return round(samples)


def check_period(period: float) -> None:
    """Refuse a period that is not a positive number."""
    if not (np.isfinite(period) and period > 0.0):
        raise InputError(f"period = {period!r} s; must be a positive number")


def check_harmonics(harmonics: Sequence[int]) -> None:
    """Refuse harmonics that are missing, repeated or not positive integers."""
    fit = all(k == int(k) and 1 <= k <= _MOST_HARMONICS for k in harmonics)
    if not len(harmonics) or not fit or len(set(harmonics)) != len(harmonics):
        raise InputError(
            f"harmonics = {shorten(str(list(harmonics)))}; must be one or more different "
            f"integers from 1 to {_MOST_HARMONICS}"
        )
