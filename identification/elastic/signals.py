"""Measured signals of one elastic joint, and its equations without derivatives of signals.

An equation ``tau = I q'' + K q + ...`` is convolved with a smooth function ``phi`` of finite
length. The derivatives then fall on ``phi``::

    phi * tau = I (phi'' * q) + K (phi * q) + ...

which holds exactly, whatever the motion before and after, periodic or not. Here ``phi`` is the
B-spline of degree 5, sampled; sums replace integrals, with errors that fall with the sixth power
of the knots' distance.
"""

from dataclasses import dataclass
from math import comb

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline
from scipy.signal import fftconvolve

from identification.measurement.record import Record, check_sampling
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.rotor_coupling import rotor_momentum

_DEGREE = 5
_ORDER = 6  # of the difference that reduces a smooth signal to its noise


@dataclass(frozen=True, eq=False)
class TestFunction:
    """A B-spline and its derivatives at the samples.

    Attributes:
        kernels: Kernels of the derivatives 0, 1, 2, shape (3, 2 H + 1).
    """

    __test__ = False  # not a test of pytest

    kernels: np.ndarray

    @classmethod
    def of_knots(cls, spacing: float, step: float) -> "TestFunction":
        """Return the function for a distance of its knots.

        Args:
            spacing: Distance of the knots [s]; the function is six times as long.
            step: Sampling time [s].
        """
        knots = (np.arange(_DEGREE + 2) - 0.5 * (_DEGREE + 1)) * spacing
        spline = BSpline.basis_element(knots, extrapolate=False)
        half = int(np.ceil(knots[-1] / step)) - 1
        t = np.arange(-half, half + 1) * step
        rows = [spline(t), *(spline.derivative(order)(t) for order in (1, 2))]
        return cls(np.nan_to_num(np.array(rows)) * step / spacing)

    @property
    def half(self) -> int:
        """Samples H on either side of its middle."""
        return int(self.kernels.shape[1] // 2)

    def derivative(self, signal: np.ndarray, order: int = 0) -> np.ndarray:
        """Return the convolution of a signal with a derivative of the function, shape (K - 2 H,).

        Args:
            signal: Shape (K,).
            order: 0, 1 or 2.
        """
        return np.asarray(fftconvolve(signal, self.kernels[order], mode="valid"))


def white_noise(signal: np.ndarray) -> float:
    """Return the standard deviation of the white noise on a smooth signal.

    A difference of order 6 removes almost everything that changes slowly compared to the samples.

    Args:
        signal: Evenly sampled, shape (K,).
    """
    left = np.diff(signal, _ORDER)
    return float(np.sqrt(np.mean(left**2) / comb(2 * _ORDER, _ORDER)))


def mean_sign(v: np.ndarray) -> np.ndarray:
    """Return the mean of a velocity's sign over the sampling time about each sample, shape (K,).

    The velocity is linear between ``v_1`` and ``v_2`` at the midpoints before and after the sample:
    ``(v_1 + v_2) / (|v_1| + |v_2|)``.

    Args:
        v: At the midpoints between K samples, shape (K - 1,).
    """
    before, after = np.append(v[0], v), np.append(v, v[-1])
    size = np.maximum(np.abs(before) + np.abs(after), np.finfo(float).tiny)
    return np.asarray((before + after) / size)


def long_run_covariance(scores: np.ndarray, length: int) -> np.ndarray:
    """Return the covariance of a sum of correlated vectors, shape (n, n) (Bartlett's weights).

    Args:
        scores: The vectors, mean zero, shape (K, n).
        length: Number of samples after which nothing correlates.
    """
    sums = np.array([fftconvolve(column, np.ones(length)) for column in scores.T])
    return np.asarray(sums @ sums.T / length)


_SAME = 0.02  # tolerance of the motor's travel compared to the link's, beside
_TWIST = 0.02  # rad or m
_MOST = 0.5
_STILL = 0.05  # of the motor's travel, tolerated motion of a locked link
_NOISE = 6.0  # standard deviations within which a joint stands still
_SLOW = 0.03  # of the largest velocity, below which friction has any value between both signs
_RATE_NOISE = 4.0  # standard deviations of the measured velocity, below which it is zero
_WIDTHS = (1, 3, 5, 9)  # samples, widths for velocities
_CLEAR = 0.1  # of the largest velocity, tolerated noise of it
_UNSURE = 0.1  # of a test function, tolerated share where it is unknown
_TURNING = 0.9  # of its full size, below which friction counts as reversing
_OFTEN = 0.2  # of the samples at reversals, required to estimate a lag of friction


@dataclass(frozen=True, eq=False)
class JointSignals:
    """Torque and positions of one joint at K instants, all on the joint side.

    Attributes:
        name: Name of the joint.
        t: Evenly spaced times [s], shape (K,).
        tau: Drive torques ``tau_d`` [Nm or N], shape (K,).
        q_motor: Positions of the motor [rad or m], shape (K,).
        q: Positions of the link, shape (K,).
        unit: ``rad`` or ``m``.
        spin: Angular velocity of the link that carries the rotor, about the rotor's axis, divided
            by the gear ratio [rad/s or m/s], shape (K,); None for no coupling.
        source: Source of the signals, for messages.
    """

    name: str
    t: np.ndarray
    tau: np.ndarray
    q_motor: np.ndarray
    q: np.ndarray
    unit: str = "rad"
    spin: np.ndarray | None = None
    source: str = "record"

    @property
    def step(self) -> float:
        """Sampling time [s]."""
        return float((self.t[-1] - self.t[0]) / (self.t.size - 1))


def joint_signals(record: Record, subject: Subject, coupling: bool = True) -> list[JointSignals]:
    """Return the signals of all joints of a record.

    Args:
        record: Record with positions of the motors.
        subject: Robot of the record.
        coupling: Whether the effect of the links' motion on the rotors (2.62) is subtracted, if
            ``subject.mounts`` is known.

    Raises:
        InputError: If there are no positions of motors, the joints differ, the samples are not
            evenly spaced, or motor and link move by different amounts.
    """
    if record.q_motor is None:
        raise InputError(
            f"{record.source}: no q_motor; positions of motors beside those of the links are "
            "required for elastic joints"
        )
    if list(record.joint_names) != list(subject.joint_names):
        raise InputError(
            f"{record.source}: joints {', '.join(record.joint_names)}; must be those of "
            f"{subject.name}: {', '.join(subject.joint_names)}"
        )
    check_sampling(record)
    spin = _spin(record, subject) if coupling else None
    return [
        JointSignals(
            name,
            record.t,
            record.tau[:, j],
            record.q_motor[:, j],
            record.q[:, j],
            subject.joint_units[j],
            None if spin is None else spin[:, j],
            record.source,
        )
        for j, name in enumerate(record.joint_names)
    ]


def _spin(record: Record, subject: Subject) -> np.ndarray | None:
    if subject.chain is None or subject.mounts is None:
        return None
    q, v = (ca.SX.sym(name, subject.dimension) for name in "qv")
    momentum = rotor_momentum(subject.chain, subject.mounts, q, v) / ca.DM(subject.chain.D_M)
    rates = np.gradient(record.q, record.sampling_time, axis=0)
    return np.array(ca.Function("spin", [q, v], [momentum])(record.q.T, rates.T)).T


def check_same_travel(signals: JointSignals) -> None:
    """Refuse motor positions that do not belong to the joint.

    Raises:
        InputError: If the motor does not move by as much as the link.
    """
    link = signals.q - signals.q.mean()
    if not link.any():
        raise InputError(
            f"{signals.source}: {signals.name}: q is constant; a joint that moves is required, or "
            "the option for locked joints"
        )
    size = link @ link - link.size * white_noise(signals.q) ** 2
    factor = float(link @ signals.q_motor / max(size, 0.1 * (link @ link)))
    # links excited beyond their resonance move slightly differently from motors
    if abs(factor - 1.0) > min(_SAME + _TWIST / float(np.std(link)), _MOST):
        raise InputError(
            f"{signals.source}: q_motor of {signals.name} moves by {factor:.4g} times q; must be 1 "
            "(on the joint side: divided by the gear ratio; sign, unit)"
        )


def check_locked(signals: JointSignals) -> None:
    """Refuse a locked joint whose link moves, or whose motor does not.

    Raises:
        InputError: If that is the case.
    """
    travel = np.ptp(signals.q)
    allowed = 2.0 * _NOISE * white_noise(signals.q)
    windup = float(np.ptp(signals.q_motor))
    if travel > max(allowed, _STILL * windup):
        raise InputError(
            f"{signals.source}: q of {signals.name} moves by {travel:.3g} {signals.unit} while "
            f"q_motor does by {windup:.3g}; a locked joint must stand still"
        )


@dataclass(frozen=True, eq=False)
class MotorEquation:
    """``tau = Y values`` at K samples, n parameters; rows that do not count are zero.

    Attributes:
        parameters: Names of the n parameters.
        Y: Shape (K, n).
        tau: Smoothed torques [Nm or N], shape (K,).
        used: Which samples count, shape (K,).
        noise: Contribution of position noise to ``Y' Y`` for each sample, shape (n, n).
    """

    parameters: tuple[str, ...]
    Y: np.ndarray
    tau: np.ndarray
    used: np.ndarray
    noise: np.ndarray

    @property
    def samples(self) -> int:
        """Number of samples that count."""
        return int(np.count_nonzero(self.used))


def motor_equation(
    signals: JointSignals,
    locked: bool,
    function: TestFunction,
    position_noise: tuple[float, float] | None = None,
) -> MotorEquation:
    """Return the equation of a joint.

    Samples at which the motor rests or is about to reverse do not count, because friction is not
    known there.

    Args:
        signals: Signals of the joint.
        locked: Whether the link was locked.
        function: Function for the convolution.
        position_noise: Standard deviations of white noise on the positions of motor and link;
            estimated from the signals if omitted.
    """
    q_J = np.full(signals.t.size, signals.q.mean()) if locked else signals.q
    torsion = signals.q_motor - q_J
    v, a = (function.derivative(signals.q_motor, order) for order in (1, 2))
    spin = 0.0 if signals.spin is None else function.derivative(signals.spin, 1)
    sign, slow = _friction_side(signals)
    full = function.kernels[0].sum()
    columns = {
        "stiffness": function.derivative(torsion),
        "damping": function.derivative(torsion, 1),
        "inertia": a + spin,
        "coulomb": function.derivative(sign),
        "lag": -function.derivative(sign, 1),
        "viscous": v,
        "offset": np.full(v.size, full),
    }
    used = function.derivative(slow.astype(float)) < _UNSURE
    if locked:
        del columns["viscous"]
    turning = np.abs(columns["coulomb"]) < _TURNING * full
    if np.count_nonzero(turning & used) < _OFTEN * np.count_nonzero(used):
        del columns["lag"]
    if position_noise is None:
        position_noise = white_noise(signals.q_motor), white_noise(signals.q)
    return MotorEquation(
        tuple(columns),
        np.column_stack(list(columns.values())) * used[:, None],
        function.derivative(signals.tau) * used,
        used,
        _normal_noise(function, tuple(columns), position_noise, locked),
    )


def _friction_side(signals: JointSignals) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean sign of the motor's velocity about each sample, and where it is unsure."""
    # as short as the noise allows: smoothing the velocity shifts reversals and hides rests
    for width in _WIDTHS:
        v = (signals.q_motor[width:] - signals.q_motor[:-width]) / (width * signals.step)
        noise = _RATE_NOISE * white_noise(signals.q_motor) * np.sqrt(2.0) / (width * signals.step)
        fast = float(np.quantile(np.abs(v), 0.99))
        if noise < _CLEAR * fast:
            break
    v = np.pad(v, width // 2, mode="edge")
    slow = np.abs(v) < max(_SLOW * fast, noise)
    before, after = np.append(True, slow), np.append(slow, True)
    return mean_sign(v), before & after


def _normal_noise(
    function: TestFunction,
    parameters: tuple[str, ...],
    deviations: tuple[float, float],
    locked: bool,
) -> np.ndarray:
    zero = np.zeros(function.kernels.shape[1])
    smooth, rate, second = function.kernels
    motor = {"stiffness": smooth, "damping": rate, "inertia": second, "viscous": rate}
    link = {} if locked else {"stiffness": -smooth, "damping": -rate}
    total = np.zeros((len(parameters), len(parameters)))
    for kernels, deviation in zip((motor, link), deviations, strict=True):
        rows = np.array([kernels.get(name, zero) for name in parameters])
        total += deviation**2 * rows @ rows.T
    return total
