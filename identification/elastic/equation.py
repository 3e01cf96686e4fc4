"""The equation of a motor on an elastic joint, in the weak form, as columns of numbers."""

from dataclasses import dataclass

import numpy as np

from identification.elastic.signals import JointSignals, TestFunction, mean_sign, white_noise

_SLOW = 0.03  # of the largest velocity, below which friction is anything between both signs
_NOISE = 4.0  # standard deviations of the measured velocity, likewise
_WIDTHS = (1, 3, 5, 9)  # samples, over which velocities are taken
_CLEAR = 0.1  # of the largest velocity, that its noise may be
_UNSURE = 0.1  # of a test function that may lie where it is
_TURNING = 0.9  # of its full size, that friction has where the motor reverses
_OFTEN = 0.2  # of the samples at which it does, for a lag of friction to tell


@dataclass(frozen=True, eq=False)
class MotorEquation:
    """``tau = Y values`` at K samples, n parameters; rows that do not count are zero.

    Attributes:
        parameters: Names of the n parameters.
        Y: Shape (K, n).
        tau: Smoothed torques [Nm or N], shape (K,).
        used: Which samples count, shape (K,).
        noise: What the noise of the positions adds to ``Y' Y`` for each sample, shape (n, n).
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

    Samples at which the motor rests or is about to reverse do not count, since friction is
    not known there.

    Args:
        signals: Of the joint.
        locked: Whether the link was held.
        function: That the equation is convolved with.
        position_noise: Standard deviations of white noise on the positions of motor and link;
            taken from the signals if omitted.
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
