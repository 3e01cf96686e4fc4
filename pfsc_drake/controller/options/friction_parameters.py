"""Parameters of friction and of its compensation."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.checks import require
from pfsc_drake.physics.friction import FrictionDrift
from pfsc_drake.yaml.fields import NAME_OR_FILE, ONE_FOR_ALL, ONE_OR_MANY, former
from pfsc_drake.yaml.rules import (
    NotNegative,
    NotNegatives,
    Numbers,
    OneOf,
    Parameters,
    Positive,
    Range,
)

_SOURCES = ("none", "model", "observer")
_OBSERVERS = ("disturbance", "kalman")
_VELOCITIES = ("measured", "reference")


_PRESLIDING = 1e-7, 0.1  # rad or m
_LARGEST = 1e9  # of friction; products with it stay within a float


@dc.dataclass
class JointFrictionParameters(Parameters):
    """Coulomb and viscous friction of the joints; empty for none.

    Attributes:
        f_c: Coulomb friction of every joint, or one number for all [Nm or N].
        f_v: Viscous friction of every joint, or one number for all [Nm s/rad or N s/m].
        file: Instead, name of a shipped robot or YAML file with robot parameters; the
            friction of its first joints applies.
        drift: Change of the friction during the run; null for none.
        presliding: Displacement at which a stuck drive begins to slide, of every joint or one
            number for all [rad or m]; empty for the smallest value for steps of 1 ms. Gears have
            1 to 1000 urad.
    """

    f_c: Annotated[list[float], Numbers(each=Range(0.0, _LARGEST))] = dc.field(
        default_factory=list, metadata=ONE_FOR_ALL
    )
    f_v: Annotated[list[float], Numbers(each=Range(0.0, _LARGEST))] = dc.field(
        default_factory=list, metadata=ONE_FOR_ALL
    )
    file: str = dc.field(default="", metadata=NAME_OR_FILE)
    drift: FrictionDrift | None = None
    presliding: Annotated[
        list[float], Numbers(each=Range(_PRESLIDING[0], _PRESLIDING[1], "rad or m"))
    ] = dc.field(default_factory=list, metadata=ONE_FOR_ALL)

    def __post_init__(self) -> None:
        super().__post_init__()
        has_values = bool(self.f_c or self.f_v)
        require(not (self.file and has_values), "file", self.file, "either file, or f_c and f_v")

    @property
    def is_given(self) -> bool:
        """Whether there is any friction."""
        return bool(self.f_c or self.f_v or self.file)


@dc.dataclass
class KalmanParameters(Parameters):
    """Parameters of the friction Kalman filter, see :class:`FrictionKalmanFilter`.

    Lists have one number for all joints or one per joint.

    Attributes:
        intervals: ``mean``: mean values over a sampling interval; ``begin``: values at its begin,
            as printed in (A.5).
        start: Initial estimates of f_c and f_v, as a fraction of the nominal ones.
        momentum_noise: Variance that the momentum gains per sample [(Nm s)^2].
        coulomb_noise: Variance that f_c gains per sample [Nm^2]; empty for the square of a
            thousandth of the nominal f_c.
        viscous_noise: Variance that f_v gains per sample [(Nm s/rad)^2]; likewise.
        measurement_noise: Variance of a measured momentum [(Nm s)^2].
        initial_variance: Initial variance of all states at the start.
        resting_velocity: Magnitude below which a drive counts as stuck, without a correction of
            its estimates [rad/s or m/s]; ``intervals: mean`` only.
    """

    intervals: Annotated[str, OneOf(("mean", "begin"))] = "mean"
    start: NotNegative = 1.0
    momentum_noise: Annotated[
        list[float],
        Numbers(each=Range(0.0), fewest=1, words="numbers, none negative, one or one per joint"),
    ] = dc.field(default_factory=lambda: [1e-6], metadata=ONE_OR_MANY)
    coulomb_noise: NotNegatives = dc.field(default_factory=list, metadata=ONE_OR_MANY)
    viscous_noise: NotNegatives = dc.field(default_factory=list, metadata=ONE_OR_MANY)
    measurement_noise: Annotated[list[float], Numbers(each=Range(0.0, open=True), fewest=1)] = (
        dc.field(default_factory=lambda: [1e-3], metadata=ONE_OR_MANY)
    )
    initial_variance: NotNegative = 1e3
    resting_velocity: NotNegative = 0.01


@dc.dataclass
class FrictionCompensationParameters(Parameters):
    """Friction compensation by the drive torques, (2.42), (3.29), (3.58), (3.65).

    The nominal friction is the friction of the plant, unless ``nominal`` is not empty. The law
    ``velocity_servo`` does not use it.

    Attributes:
        source: ``none``; ``model``: nominal Coulomb and viscous friction; ``observer``: friction
            observed from the motion of the joints.
        velocity: Velocity for friction with known coefficients: ``measured``, or the ``reference``
            velocity of the joints, without noise but a sample late.
        smoothing: Velocity around zero over which Coulomb friction changes its sign [rad/s or
            m/s].
        observer: ``disturbance``: of first order, the torque without a model of friction;
            ``kalman``: of the coefficients.
        rate: L of the disturbance observer [1/s].
        kalman: The friction Kalman filter.
        watched: Whether the observer also runs with ``none`` or ``model``, for the log only.
        nominal: Nominal coefficients.
        hold_at_rest: Whether sticking drives get constant torques while the reference rests, see
            :class:`RestHold`; not with ``none``.
    """

    source: Annotated[str, OneOf(_SOURCES)] = "none"
    velocity: Annotated[str, OneOf(_VELOCITIES)] = "measured"
    smoothing: Positive = 0.02
    observer: Annotated[str, OneOf(_OBSERVERS)] = "disturbance"
    rate: Positive = 300.0
    kalman: KalmanParameters = dc.field(default_factory=KalmanParameters)
    watched: bool = False
    nominal: JointFrictionParameters = dc.field(
        default_factory=JointFrictionParameters, metadata=former("believed")
    )
    hold_at_rest: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        is_possible = self.velocity == "measured" or self.source == "none" or self.has_coefficients
        allowed = "measured; the disturbance observer has no model of friction by velocity"
        require(is_possible, "velocity", self.velocity, allowed)
        drift = self.nominal.drift
        require(drift is None, "nominal.drift", drift, "null; nominal friction does not drift")
        bristles = self.nominal.presliding
        require(
            not bristles, "nominal.presliding", bristles, "empty; presliding is not compensated"
        )

    @property
    def is_given(self) -> bool:
        """Whether friction is compensated, or an observer of it is logged."""
        return self.source != "none" or self.watched

    @property
    def has_coefficients(self) -> bool:
        """Whether friction is compensated by coefficients."""
        kalman = self.source == "observer" and self.observer == "kalman"
        return kalman or self.source == "model"

    @property
    def needs_reference_velocity(self) -> bool:
        """Whether the law must output the joint velocities of the reference."""
        return self.velocity == "reference" and self.has_coefficients
