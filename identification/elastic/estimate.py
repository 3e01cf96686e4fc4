"""Stiffness, damping and motor inertia of a joint from motor and link signals, with covariance.

The motor of a visco-elastic joint obeys (2.65b), (2.66) on the joint side::

    tau_d = I a_M + K (q_M - q_J) + D (v_M - v_J) + f_c sign(v_M) + f_v v_M + c

with a constant ``c`` for offsets of encoders and torques. Friction reverses a little later than the
velocity; if the motor reverses often, ``f_c sign(v_M) - l d/dt sign(v_M)`` with the lag ``l / f_c``
approximates this to first order. The equation is linear in its parameters; in the weak form of
:mod:`~identification.elastic.signals` no signal is differentiated. The noise of the positions would
increase the apparent torsion and decrease the stiffness; it is estimated and removed from the
normal equations.
"""

from dataclasses import dataclass

import numpy as np

from identification.elastic.signals import (
    JointSignals,
    MotorEquation,
    TestFunction,
    check_locked,
    check_same_travel,
    joint_signals,
    long_run_covariance,
    motor_equation,
)
from identification.measurement.record import Record
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

_VAGUE = 0.2  # relative standard deviation from which on a stiffness is unknown
_SURE = 4.0  # standard deviations


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """Estimate of one joint, on the joint side; units of a slide in brackets.

    Attributes:
        name: Name of the joint.
        unit: ``rad`` or ``m``.
        values: Values of ``parameters``, shape (n,).
        covariance: Covariance of ``values``, shape (n, n).
        parameters: Names of the estimated ones: ``stiffness`` [Nm/rad (N/m)], ``damping``
            [Nm s/rad (N s/m)], ``inertia`` of the motor [kg m^2 (kg)], ``coulomb`` [Nm (N)],
            ``lag`` l [Nm s (N s)] if the motor reverses often, ``viscous`` [Nm s/rad (N s/m)]
            unless locked, ``offset`` [Nm (N)]. For a locked joint the known viscous friction has
            been subtracted from ``damping``.
        residual: RMS of the equation's residual torque, smoothed [Nm or N].
        samples: Number of samples used.
    """

    name: str
    unit: str
    values: np.ndarray
    covariance: np.ndarray
    parameters: tuple[str, ...]
    residual: float
    samples: int

    def value(self, parameter: str) -> float:
        """Return the value of a parameter."""
        return float(self.values[self.parameters.index(parameter)])

    def deviation(self, parameter: str) -> float:
        """Return the standard deviation of a parameter."""
        i = self.parameters.index(parameter)
        return float(np.sqrt(self.covariance[i, i]))

    @property
    def stiffness(self) -> float:
        """``K_s``."""
        return self.value("stiffness")

    @property
    def damping(self) -> float:
        """``K_d``."""
        return self.value("damping")

    @property
    def inertia(self) -> float:
        """Entry of ``D_M``."""
        return self.value("inertia")

    @property
    def resonance(self) -> float:
        """Resonance of the motor against a locked link [Hz]."""
        return float(np.sqrt(self.stiffness / self.inertia) / (2.0 * np.pi))


def check_estimate(where: str, estimate: JointEstimate) -> None:
    """Refuse parameters that no joint has, or a stiffness with too large a deviation.

    Args:
        where: Name of the joint, for messages.
        estimate: Estimate of the joint.

    Raises:
        InputError: If the stiffness is vague, or a parameter is certainly negative.
    """
    value, deviation = estimate.stiffness, estimate.deviation("stiffness")
    if not deviation < _VAGUE * abs(value):
        raise InputError(
            f"{where}: not excited as an elastic joint: stiffness {value:.3g} with a standard "
            f"deviation of {deviation:.3g}; must be below {_VAGUE:g} of it, torques that twist the "
            "joint more are required (or q_motor is of another joint or by another gear ratio)"
        )
    for name in ("stiffness", "inertia", "viscous", "damping"):
        if name not in estimate.parameters:
            continue
        value, deviation = estimate.value(name), estimate.deviation(name)
        if value < -_SURE * deviation:
            hint = "sign of the torque?" if name == "stiffness" else "signals at other instants?"
            raise InputError(
                f"{where}: {name} = {value:.4g} (standard deviation {deviation:.2g}); must not be "
                f"negative ({hint})"
            )


KNOTS = 3e-3  # s, distance in the test function, which passes frequencies below about 100 Hz
_LEAST_KNOTS = 3.0  # sampling times
_MEMORY = 0.1  # s, after which residuals no longer correlate, or
_STRETCHES, _FEWEST_STRETCHES = 40, 12  # numbers of sections of this length
_LOST = 0.2  # of the torsion's variance that may be noise
_SINGULAR = 1e-9
_FEWEST = 200  # samples


def estimate_joints(
    record: Record,
    subject: Subject,
    *,
    locked: bool = False,
    viscous: np.ndarray | None = None,
    coupling: bool = True,
) -> list[JointEstimate]:
    """Return the estimates of all joints of a robot from one record.

    Args:
        record: Record with positions of the motors.
        subject: Robot of the record.
        locked: Whether all links were locked.
        viscous: ``f_v`` of the drives, for locked joints only, shape (N,).
        coupling: Whether to subtract the known coupling of turning links and spinning rotors.

    Raises:
        InputError: As in :func:`estimate_joint` and
            :func:`~identification.elastic.signals.joint_signals`.
    """
    known = [None if viscous is None else float(f_v) for f_v in _each(viscous, subject)]
    return [
        estimate_joint(signals, locked=locked, viscous=f_v)
        for signals, f_v in zip(
            joint_signals(record, subject, coupling and not locked), known, strict=True
        )
    ]


def _each(viscous: np.ndarray | None, subject: Subject) -> np.ndarray:
    values = np.full(subject.dimension, np.nan) if viscous is None else np.asarray(viscous)
    if values.shape != (subject.dimension,):
        raise InputError(
            f"viscous: shape {values.shape}; must be ({subject.dimension},), one for each joint"
        )
    return values


def estimate_joint(
    signals: JointSignals,
    *,
    locked: bool = False,
    viscous: float | None = None,
    position_noise: tuple[float, float] | None = None,
) -> JointEstimate:
    """Return stiffness, damping, motor inertia and friction of a joint.

    The covariance contains all residuals, correlated or not, and is correct for many samples. It
    does not contain deviations of friction from Coulomb's law: if the motor reverses often and
    friction takes a third of the torque, as it may in locked joints, inertias are off by up to some
    tenths of a percent.

    Args:
        signals: Signals of the joint.
        locked: Whether the link was locked. The joint's damping and the motor's viscous friction
            then act as one, so that the latter has to be known.
        viscous: ``f_v`` [Nm s/rad or N s/m], for a locked joint only.
        position_noise: Standard deviations of white noise on the positions of motor and link
            [rad or m]; estimated from the signals if omitted.

    Raises:
        InputError: If signals are too short or do not belong to one joint, the motion does not
            distinguish the parameters, or the torsion is below the noise.
    """
    where = f"{signals.source}: {signals.name}"
    if locked == (viscous is None):
        raise InputError(
            f"{where}: viscous friction {'not given' if locked else 'given'}; must be "
            + ("for a locked joint (0 for damping and friction together)" if locked else "not")
        )
    (check_locked if locked else check_same_travel)(signals)
    function = TestFunction.of_knots(max(KNOTS, _LEAST_KNOTS * signals.step), signals.step)
    if signals.t.size < _FEWEST + 2 * function.half:
        raise InputError(
            f"{where}: {signals.t.size} samples; at least {_FEWEST + 2 * function.half} required"
        )
    equation = motor_equation(signals, locked, function, position_noise)
    _check_torsion(where, signals.unit, equation)
    values, normal = _solve(where, equation)
    left = equation.tau - equation.Y @ values
    # the contribution of position noise to the mean of the scores has been removed
    scores = equation.Y * left[:, None] + equation.noise @ values * equation.used[:, None]
    length = _memory(signals.step, function.half, equation.samples)
    # with few sections, the parameters reduce their spread more than in single samples
    stretches = equation.samples / length
    spread = long_run_covariance(scores, length) * stretches / (stretches - values.size)
    inverse = np.linalg.inv(normal)
    covariance = inverse @ spread @ inverse
    if viscous is not None:
        values[1] -= viscous
    estimate = JointEstimate(
        signals.name,
        signals.unit,
        values,
        covariance,
        equation.parameters,
        float(np.sqrt(np.sum(left**2) / equation.samples)),
        equation.samples,
    )
    check_estimate(where, estimate)
    return estimate


def _memory(step: float, half: int, samples: int) -> int:
    """Return the number of samples after which residuals no longer correlate."""
    longest = min(round(_MEMORY / step), samples // _STRETCHES)
    return max(longest, min(2 * half, samples // _FEWEST_STRETCHES))


def _check_torsion(where: str, unit: str, equation: MotorEquation) -> None:
    count = equation.samples
    if count < _FEWEST:
        raise InputError(
            f"{where}: not excited as an elastic joint: {count} samples at which the motor moves "
            f"beyond the noise of its position; at least {_FEWEST} are required"
        )
    torsion, noise = float(np.std(equation.Y[equation.used, 0])), float(equation.noise[0, 0])
    if noise > _LOST * torsion**2:
        raise InputError(
            f"{where}: not excited as an elastic joint: torsion of {torsion:.3g} {unit} RMS is "
            f"lost in noise of {np.sqrt(noise):.3g} {unit} of the positions; torques that twist "
            "the joint are required"
        )


def _solve(where: str, equation: MotorEquation) -> tuple[np.ndarray, np.ndarray]:
    """Return the solution of the normal equations without noise, and their matrix."""
    Y, parameters = equation.Y, equation.parameters
    normal = Y.T @ Y - equation.noise * equation.samples
    scale = np.sqrt(np.maximum(np.diag(Y.T @ Y), np.finfo(float).tiny))
    sizes, directions = np.linalg.eigh(normal / np.outer(scale, scale))
    if sizes[0] < _SINGULAR * sizes[-1]:
        share = np.abs(directions[:, 0])
        alike = [parameters[i] for i in np.argsort(-share) if share[i] > 0.1 * share.max()]
        raise InputError(
            f"{where}: the motion does not distinguish {' and '.join(alike)}; a motion with more "
            "frequencies and reversals is required"
        )
    return np.linalg.solve(normal, Y.T @ equation.tau), normal
