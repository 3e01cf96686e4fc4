"""Limits of a motion by its drives."""

import dataclasses as dc
from typing import Annotated

import numpy as np

from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.yaml.rules import OneOf, Parameters, Range

_LIMITS = ("respect", "warn")
_SPEEDS = ("asked", "fastest")
_VELOCITY = 0.1  # m/s
# beyond, durations lose their digits
VELOCITY = Range(1e-6, 1e3, "m/s, a positive number")
ACCELERATION = Range(1e-6, 1e6, "m/s^2, a positive number")
# samples of a motion for its largest rates, and the smallest rates [m/s, m/s^2]
_SAMPLES, _SLOWEST = 2001, 1e-6


@dc.dataclass(kw_only=True)
class MotionLimits(Parameters):
    """Limits of a motion by the drives.

    Attributes:
        velocity: Largest velocity [m/s]; None for 0.1, and with ``speed`` = ``fastest`` for any.
        acceleration: Largest acceleration [m/s^2]; with ``fastest`` the drives limit it.
        dwell: Rest before, between and after the moves [s].
        limits: ``respect``: the motion is slowed beyond the nominal limits of the drives; ``warn``:
            there is a warning.
        reserve: Reserved share of the drives' torques, and of the speeds of velocity servos, from 0
            to below 1.
        speed: ``asked``: by velocity and acceleration; ``fastest``: the shortest motion within the
            limits of the drives, minus the reserve.
        torque_rate: With ``fastest`` the largest rate of the drives' torques [Nm/s], of strong
            drives ten times their largest torque in a second; infinite for any.
    """

    velocity: Annotated[float, VELOCITY] | None = None
    acceleration: Annotated[float, ACCELERATION] = 1.0
    dwell: Annotated[float, Range(1e-6, 1e6, "s", besides=0.0)] = 0.3
    limits: Annotated[str, OneOf(_LIMITS)] = "respect"
    reserve: Annotated[float, Range(0.0, 1.0, below=True)] = 0.3
    speed: Annotated[str, OneOf(_SPEEDS)] = "asked"
    torque_rate: Annotated[float, Range(0.0, open=True, infinite=True)] = 1000.0

    @property
    def largest_velocity(self) -> float:
        """Largest velocity of the requested motion [m/s]."""
        return _VELOCITY if self.velocity is None else self.velocity


def limits_of(motion: PiecewisePolynomialCurve, limits: MotionLimits) -> MotionLimits:
    """Return limits with the velocity and the acceleration of a requested motion.

    Args:
        motion: Tangential coordinates over time [m].
        limits: The limits; limits of a fastest motion do not change.
    """
    if limits.speed == "fastest":
        return limits
    times = np.linspace(*motion.domain, _SAMPLES)
    rates = np.abs(motion.derivatives(times, 2)[:, 1:]).max(axis=(0, 2))
    velocity, acceleration = np.maximum(rates, _SLOWEST).tolist()
    return dc.replace(limits, velocity=velocity, acceleration=acceleration)
