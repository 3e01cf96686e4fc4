"""Torques that shake elastic joints: sums of sines, and steps."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError


@dataclass(frozen=True, eq=False)
class Multisine:
    """``tau_i = sum_m A_im sin(2 pi f_im t + p_im)`` for N joints and M lines each.

    Attributes:
        amplitude: [Nm or N], shape (N, M).
        frequency: [Hz], shape (N, M).
        phase: [rad], shape (N, M).
    """

    amplitude: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray


def zippered_multisine(
    rms: np.ndarray,
    period: float,
    random: np.random.Generator,
    lowest: float = 4.0,
    highest: float = 90.0,
) -> Multisine:
    """Return sines of equal size whose frequencies the joints take in turns.

    No frequency belongs to two joints, so that what moves at one is by the drive of one joint.

    Args:
        rms: Root of the mean square of each joint's torque [Nm or N], shape (N,).
        period: All frequencies are multiples of its reciprocal [s].
        random: Of the phases.
        lowest: Frequency [Hz].
        highest: Frequency [Hz].

    Raises:
        InputError: If a value is not positive, or the frequencies are too few for the joints.
    """
    size = np.asarray(rms, dtype=float)
    if not (np.all(np.isfinite(size)) and np.all(size > 0.0)):
        raise InputError(f"torque to shake joints: rms = {size.tolist()}; must be positive")
    if not (0.0 < lowest < highest < np.inf and 0.0 < period < np.inf):
        raise InputError(
            f"torque to shake joints: {lowest:g} to {highest:g} Hz, period {period:g} s; must be "
            "positive and in this order"
        )
    lines = np.arange(np.ceil(lowest * period), np.floor(highest * period) + 1.0) / period
    each = lines.size // size.size
    if each < 2:
        raise InputError(
            f"torque to shake joints: {lines.size} multiples of {1.0 / period:g} Hz between "
            f"{lowest:g} and {highest:g} Hz; at least {2 * size.size} are required"
        )
    frequency = lines[: each * size.size].reshape(each, size.size).T
    amplitude = np.repeat((size * np.sqrt(2.0 / each))[:, None], each, axis=1)
    return Multisine(amplitude, frequency, random.uniform(0.0, 2.0 * np.pi, frequency.shape))


def random_steps(
    height: np.ndarray,
    hold: float,
    t: np.ndarray,
    random: np.random.Generator,
) -> np.ndarray:
    """Return torques that jump between random levels, shape (K, N) [Nm or N].

    Args:
        height: Largest magnitudes [Nm or N], shape (N,).
        hold: Time for which a level lasts [s].
        t: Instants [s], shape (K,).
        random: Of the levels.

    Raises:
        InputError: If a value is not positive.
    """
    size = np.asarray(height, dtype=float)
    if not (np.all(size > 0.0) and 0.0 < hold < np.inf):
        raise InputError(f"torque steps: height = {size.tolist()}, hold = {hold}; must be positive")
    step = np.floor(t / hold + 1e-9).astype(int)
    return np.asarray(random.uniform(-size, size, (step.max() + 1, size.size))[step])
