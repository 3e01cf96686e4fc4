"""Stiffness, damping and motor inertia of a joint from motor and link signals, with covariance.

The motor of a visco-elastic joint obeys (2.65b), (2.66) on the joint side::

    tau_d = I a_M + K (q_M - q_J) + D (v_M - v_J) + f_c sign(v_M) + f_v v_M + c

with a constant ``c`` for zeros of encoders and torques. Friction turns over a little later than the
velocity; where the motor reverses often, ``f_c sign(v_M) - l d/dt sign(v_M)`` with the lag
``l / f_c`` stands for it to first order. The equation is linear in its parameters;
in the weak form of :mod:`~identification.elastic.weak_form` no signal is differentiated. The noise
of the positions, which would make the torsion look larger and the joint softer than it is, is
measured and taken out of the normal equations.
"""

import numpy as np

from identification.elastic.joint_estimate import JointEstimate, check_estimate
from identification.elastic.signals import (
    JointSignals,
    check_locked,
    check_same_travel,
    joint_signals,
)
from identification.elastic.weak_form import (
    TestFunction,
    long_run_covariance,
    mean_sign,
    white_noise,
)
from identification.measurement.record import Record
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

KNOTS = 3e-3  # s, distance in the test function, which passes what is below about 100 Hz
_MEMORY = 0.1  # s, after which what the equation leaves over no longer correlates
_SLOW = 0.03  # of the largest velocity, below which friction is anything between both signs
_NOISE = 4.0  # standard deviations of the measured velocity, likewise
_WIDTHS = (1, 3, 5, 9)  # samples, over which velocities are taken
_CLEAR = 0.1  # of the largest velocity, that its noise may be
_UNSURE = 0.1  # of a test function that may lie where it is
_TURNING = 0.9  # of its full size, that friction has where the motor reverses
_OFTEN = 0.2  # of the samples at which it does, for a lag of friction to tell
_LOST = 0.2  # of the torsion's variance that may be noise
_SINGULAR = 1e-9
_FEWEST = 200  # samples


def estimate_joints(
    record: Record,
    subject: Subject,
    *,
    locked: bool = False,
    viscous: np.ndarray | None = None,
    viscous_deviation: np.ndarray | None = None,
    coupling: bool = True,
) -> list[JointEstimate]:
    """Return the estimates of all joints of a robot from one record.

    Args:
        record: With positions of the motors.
        subject: Whose record it is.
        locked: Whether all links were held.
        viscous: ``f_v`` of the drives, for locked joints only, shape (N,).
        viscous_deviation: Its standard deviation, shape (N,); 0 if omitted.
        coupling: Whether what turning links do to spinning rotors is known and taken off.

    Raises:
        InputError: As :func:`estimate_joint` and
            :func:`~identification.elastic.signals.joint_signals`.
    """
    spread = np.zeros(subject.dimension) if viscous_deviation is None else viscous_deviation
    known = [None if viscous is None else float(f_v) for f_v in _each(viscous, subject)]
    return [
        estimate_joint(signals, locked=locked, viscous=f_v, viscous_deviation=float(sd))
        for signals, f_v, sd in zip(
            joint_signals(record, subject, coupling and not locked), known, spread, strict=True
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
    viscous_deviation: float = 0.0,
    knots: float = KNOTS,
) -> JointEstimate:
    """Return stiffness, damping, motor inertia and friction of a joint.

    Samples at which the motor is about to reverse are left out, since friction is not known
    there. The covariance holds whatever the equation leaves over, correlated or not, and is
    right for many samples.

    Args:
        signals: Of the joint.
        locked: Whether the link was held. The motor then feels the joint's damping and its own
            viscous friction as one, so that the latter has to be known from elsewhere.
        viscous: ``f_v`` [Nm s/rad or N s/m], for a locked joint only.
        viscous_deviation: Its standard deviation.
        knots: Distance of the knots of the test function [s].

    Raises:
        InputError: If signals are too short or not of one joint, the motion does not tell the
            parameters apart, or the torsion is lost in noise.
    """
    where = f"{signals.source}: {signals.name}"
    if locked == (viscous is None):
        raise InputError(
            f"{where}: viscous friction {'not given' if locked else 'given'}; must be "
            + ("for a locked joint (0 for damping and friction together)" if locked else "not")
        )
    (check_locked if locked else check_same_travel)(signals)
    function = TestFunction.of_knots(knots, signals.step)
    if signals.t.size < _FEWEST + 2 * function.half:
        raise InputError(
            f"{where}: {signals.t.size} samples; at least {_FEWEST + 2 * function.half} required"
        )
    q_J = np.full(signals.t.size, signals.q.mean()) if locked else signals.q
    torsion = signals.q_motor - q_J
    v, a = (function.derivative(signals.q_motor, order) for order in (1, 2))
    inertia = a
    if signals.spin is not None:
        inertia = a + function.derivative(signals.spin, 1)
    sign, slow = _friction_side(signals)
    columns = {
        "stiffness": function.derivative(torsion),
        "damping": function.derivative(torsion, 1),
        "inertia": inertia,
        "coulomb": function.derivative(sign),
        "lag": -function.derivative(sign, 1),
        "viscous": v,
        "offset": np.full(v.size, function.kernels[0].sum()),
    }
    used = function.derivative(slow.astype(float)) < _UNSURE
    if locked:
        del columns["viscous"]
    turning = np.abs(columns["coulomb"]) < _TURNING * function.kernels[0].sum()
    if np.count_nonzero(turning & used) < _OFTEN * np.count_nonzero(used):
        del columns["lag"]
    Y = np.column_stack(list(columns.values())) * used[:, None]
    tau = function.derivative(signals.tau) * used
    noise = _position_noise(signals, function, tuple(columns), locked) * used.sum()
    _check_torsion(where, signals.unit, Y, noise)
    values, normal = _solve(where, tuple(columns), Y, tau, noise)
    left = (tau - Y @ values) * used
    # what the noise of the positions adds to the scores has been taken out of their mean
    scores = Y * left[:, None] + (noise @ values / used.sum()) * used[:, None]
    spread = long_run_covariance(scores, max(1, round(_MEMORY / signals.step)))
    inverse = np.linalg.inv(normal)
    covariance = inverse @ spread @ inverse
    if viscous is not None:
        values[1] -= viscous
        covariance[1, 1] += viscous_deviation**2
    estimate = JointEstimate(
        signals.name,
        signals.unit,
        locked,
        values,
        covariance,
        tuple(columns),
        float(np.sqrt(np.sum(left**2) / used.sum())),
        int(used.sum()),
    )
    check_estimate(where, estimate)
    return estimate


def _friction_side(signals: JointSignals) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean sign of the motor's velocity about each sample, and where it is not sure."""
    # as short as the noise allows: what smooths the velocity shifts reversals and hides rests
    for width in _WIDTHS:
        v = (signals.q_motor[width:] - signals.q_motor[:-width]) / (width * signals.step)
        noise = _NOISE * white_noise(signals.q_motor) * np.sqrt(2.0) / (width * signals.step)
        fast = float(np.quantile(np.abs(v), 0.99))
        if noise < _CLEAR * fast:
            break
    v = np.pad(v, width // 2, mode="edge")
    slow = np.abs(v) < max(_SLOW * fast, noise)
    before, after = np.append(True, slow), np.append(slow, True)
    return mean_sign(v), before & after


def _position_noise(
    signals: JointSignals, function: TestFunction, parameters: tuple[str, ...], locked: bool
) -> np.ndarray:
    """Return what the positions' noise adds to the normal matrix for each sample, (n, n)."""
    zero = np.zeros(function.kernels.shape[1])
    smooth, rate, second = function.kernels
    motor = {"stiffness": smooth, "damping": rate, "inertia": second, "viscous": rate}
    link = {} if locked else {"stiffness": -smooth, "damping": -rate}
    total = np.zeros((len(parameters), len(parameters)))
    for kernels, signal in ((motor, signals.q_motor), (link, signals.q)):
        rows = np.array([kernels.get(name, zero) for name in parameters])
        total += white_noise(signal) ** 2 * rows @ rows.T
    return total


def _check_torsion(where: str, unit: str, Y: np.ndarray, noise: np.ndarray) -> None:
    count = np.count_nonzero(Y[:, -1])
    if count < _FEWEST:
        raise InputError(
            f"{where}: not excited as an elastic joint: {count} samples at which the motor moves "
            f"beyond the noise of its position; at least {_FEWEST} are required"
        )
    torsion = Y[Y[:, -1] != 0.0, 0]
    if noise[0, 0] / count > _LOST * np.var(torsion):
        raise InputError(
            f"{where}: not excited as an elastic joint: torsion of {np.std(torsion):.3g} {unit} "
            f"RMS is lost in noise of {np.sqrt(noise[0, 0] / count):.3g} {unit} of the positions; "
            "torques that twist the joint are required"
        )


def _solve(
    where: str, parameters: tuple[str, ...], Y: np.ndarray, tau: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the solution of the normal equations without noise, and their matrix."""
    normal = Y.T @ Y - noise
    scale = np.sqrt(np.maximum(np.diag(Y.T @ Y), np.finfo(float).tiny))
    sizes, directions = np.linalg.eigh(normal / np.outer(scale, scale))
    if sizes[0] < _SINGULAR * sizes[-1]:
        share = np.abs(directions[:, 0])
        alike = [parameters[i] for i in np.argsort(-share) if share[i] > 0.1 * share.max()]
        raise InputError(
            f"{where}: the motion does not tell {' and '.join(alike)} apart; a motion with more "
            "frequencies and reversals is required"
        )
    return np.linalg.solve(normal, Y.T @ tau), normal
