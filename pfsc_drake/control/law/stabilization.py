"""Stabilization of the integrator chains after exact linearization."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pfsc_drake.errors import InputError


@dataclass(frozen=True)
class CoordinateGains:
    """Gains of one coordinate: ``v = y_p^(r) - sum_k a_{k+1} e^(k) - a_0 integral(e)``.

    The error ``e = y - y_p`` then obeys the polynomial
    ``s^r + a_r s^(r-1) + ... + a_1`` (times s, plus ``a_0``, with an integral part),
    see (3.34), (3.61), (3.67), (3.86).

    The position of a free coordinate is not controlled: ``a_1`` is zero, and the error of its
    velocity obeys ``s^(r-1) + a_r s^(r-2) + ... + a_2``. So an operator guides a tool along a path
    on a backdrivable robot, without a sensor (Tab. 5.2).

    Attributes:
        proportional: ``a_1 .. a_r`` in the dissertation's order, 1/s^r .. 1/s.
        integral: ``a_0`` [1/s^(r+1)]; 0 for none.
        is_free: Whether the coordinate is free.
    """

    proportional: tuple[float, ...]
    integral: float = 0.0
    is_free: bool = False

    @property
    def polynomial(self) -> np.ndarray:
        """Characteristic polynomial, highest power first; of the velocity for a free coordinate."""
        tail = [*self.proportional[: 0 if self.is_free else None : -1]]
        return np.array([1.0, *tail, self.integral] if self.integral else [1.0, *tail])

    @property
    def poles(self) -> np.ndarray:
        """Poles of the error dynamics [1/s]."""
        return np.roots(self.polynomial)

    @property
    def rightmost_pole(self) -> complex:
        """Slowest pole, or the most unstable one [1/s]."""
        poles = self.poles
        return complex(poles[np.argmax(poles.real)])


def gains_from_poles(
    poles: Sequence[float | complex], integral_pole: float = 0.0
) -> CoordinateGains:
    """Return the gains for r poles, and one more with an integral part.

    Args:
        poles: Poles without the integral part [1/s].
        integral_pole: Pole of the integral part, which removes constant errors at this rate [1/s];
            0 for none.

    Raises:
        InputError: If there are no poles, or complex ones do not come in conjugate pairs.
    """
    if len(poles) == 0:
        raise InputError("poles: none given; a law of relative degree r needs r")
    every = [*poles, integral_pole] if integral_pole else list(poles)
    polynomial = np.poly(np.array(every, dtype=complex))
    if np.max(np.abs(polynomial.imag)) > 1e-9 * np.max(np.abs(polynomial)):
        raise InputError(f"poles {list(poles)}: complex poles must come in conjugate pairs")
    coefficients = [float(a) for a in polynomial.real[:0:-1]]
    if integral_pole:
        return CoordinateGains(tuple(coefficients[1:]), coefficients[0])
    return CoordinateGains(tuple(coefficients))


def check_gains(gains: CoordinateGains, relative_degree: int, name: str) -> None:
    """Refuse gains of error dynamics that are not stable.

    Args:
        gains: Gains of one coordinate.
        relative_degree: ``r`` of the law.
        name: Name of the coordinate, for the message.

    Raises:
        InputError: If their number is not r, the polynomial is not Hurwitz, or a free coordinate
            has an ``a_1``, an integral part or no other gain.
    """
    if gains.is_free and (relative_degree < 2 or gains.integral or gains.proportional[0]):
        raise InputError(
            f"{name}: free with a_0 = {gains.integral:g} and gains {list(gains.proportional)}; a "
            "free coordinate has no a_0, a_1 = 0, and a law of relative degree 2 or more"
        )
    if len(gains.proportional) != relative_degree:
        raise InputError(
            f"{name}: {len(gains.proportional)} gains given; "
            f"a law of relative degree {relative_degree} needs {relative_degree}"
        )
    if not np.all(np.isfinite(gains.polynomial)):
        raise InputError(f"{name}: gains {list(gains.polynomial)} must be finite numbers")
    rightmost = gains.rightmost_pole
    if rightmost.real >= 0.0:
        raise InputError(
            f"{name}: gains a_0 = {gains.integral:g}, a_1.. = "
            f"{[float(f'{a:g}') for a in gains.proportional]} are not Hurwitz, pole at "
            f"{rightmost:.4g} 1/s; all poles must have negative real parts"
        )


class Stabilization:
    """Linear control law of all coordinates (3.33), (3.52), (3.61), (3.67), (3.86).

    Args:
        gains: Gains of each of the m coordinates.
        relative_degree: ``r``.
        names: Names of the coordinates, for messages.

    Raises:
        InputError: If gains have the wrong number, or a loop would not be stable.
    """

    def __init__(
        self, gains: Sequence[CoordinateGains], relative_degree: int, names: Sequence[str]
    ) -> None:
        for coordinate, name in zip(gains, names, strict=True):
            check_gains(coordinate, relative_degree, f"gains of {name}")
        self.relative_degree = relative_degree
        # row k holds a_{k+1} of all coordinates
        self.proportional = np.array([g.proportional for g in gains]).T
        self.integral = np.array([g.integral for g in gains])
        self.is_free = np.array([g.is_free for g in gains])
        self.has_integral_part = bool(np.any(self.integral))

    def virtual_input(self, Y: Sequence, reference: Sequence, integral: Any) -> Any:
        """Return ``v``, shape (m,).

        Args:
            Y: Derivatives 0..r-1 of the virtual output, each (m,); arrays or expressions.
            reference: Derivatives 0..r of its reference, each (m,).
            integral: Integral of the error [m s or rad s], shape (m,).
        """
        v = reference[self.relative_degree] - self.integral * integral
        for gains, y, y_p in zip(self.proportional, Y, reference, strict=False):
            v = v - gains * (y - y_p)
        return v


class LoopGains(NamedTuple):
    """All gains of a law.

    Attributes:
        outputs: Gains of the virtual output's m coordinates.
        posture: Gains of the N joints' deviations from the posture reference, for redundant
            joints.
    """

    outputs: Stabilization
    posture: Stabilization | None = None
