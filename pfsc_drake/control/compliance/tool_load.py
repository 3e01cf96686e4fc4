"""Load of the tool on a force/torque sensor, its compensation, and wrenches at the tool point.

A wrench is ``[force, torque]``, shape (6,) [N, Nm]. Frames: S of the sensor, whose
origin is its reference point; T of the tool point; W world.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import casadi as ca
import numpy as np

from pfsc_drake.control.estimation.low_pass import LowPass
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel

_INERTIA = ("none", "differentiated", "given")
_SMALLEST_NORM = 1e-300
# s, over whose means a sensor is judged to be quiet
TARING_BLOCK = 0.01


class SensorFault(IntEnum):
    """Why a compensated wrench is not to be trusted."""

    NONE = 0
    LOST = 1  # no finite number, or a component that stands still
    SATURATED = 2


@dataclass(frozen=True)
class ToolLoad:
    """Everything behind the sensor as one rigid body.

    Attributes:
        mass: Mass m [kg].
        p_SC: Centre of mass in S [m], shape (3,).
        I_C: Inertia about the centre of mass, axes of S [kg m^2], shape (3, 3).
        R_ST: Orientation of the tool frame in S, shape (3, 3).
        p_ST: Tool point in S [m], shape (3,).
        gravity: Gravitational acceleration in world axes [m/s^2], shape (3,).
    """

    mass: float
    p_SC: np.ndarray
    I_C: np.ndarray
    R_ST: np.ndarray
    p_ST: np.ndarray
    gravity: np.ndarray


def predicted_load(robot: RobotModel, load: ToolLoad, q: Sequence[Jet]) -> tuple[ca.SX, ca.SX]:
    """Return what the tool alone makes the sensor read, and the sensor's orientation.

    ``f = m (g - a_C)``, ``tau = p_SC x f - h'``: the load of the tool on the sensor, about
    its origin. The rate of the angular momentum about the centre of mass is
    ``S(h') = A - A^T`` with ``A = R_WS^T R_WS'' E_C``, ``E_C = tr(I_C) / 2 - I_C``, which is
    ``I_C w' + w x I_C w``.

    Args:
        robot: The robot.
        load: The tool.
        q: Joint coordinates, jets of order 2.

    Returns:
        Wrench in S, shape (6, 1), and ``R_WS``, shape (3, 3).
    """
    y_t, R_e = robot.tool_pose(q)
    R_WS = R_e @ ca.SX(load.R_ST.T)
    y_C = y_t + R_WS @ ca.SX(load.p_SC - load.p_ST)
    orientation = R_WS.coefficients[0]
    force = load.mass * (orientation.T @ (load.gravity - y_C.derivative(2)))
    E_C = np.trace(load.I_C) / 2.0 * np.eye(3) - load.I_C
    A = orientation.T @ R_WS.derivative(2) @ E_C
    torque = ca.cross(ca.SX(load.p_SC), force) - ca.inv_skew(A - A.T)
    return ca.vertcat(force, torque), orientation


def dead_band(vector: ca.SX, width: float) -> ca.SX:
    """Return a vector shortened by a width, zero if it is shorter; continuous in the vector."""
    if width == 0.0:
        return vector
    norm = ca.norm_2(vector)
    return vector * ca.fmax(norm - width, 0.0) / ca.fmax(norm, _SMALLEST_NORM)


def compensation_function(
    robot: RobotModel,
    load: ToolLoad,
    low_pass: LowPass,
    inertia: str = "differentiated",
    dead_bands: tuple[float, float] = (0.0, 0.0),
) -> ca.Function:
    """Return the function from a measurement to the external wrench at the tool point.

    ``r = measured - predicted``; with ``[f, tau] = r - bias`` the external wrench is
    ``R_WS f`` and ``R_WS (tau - p_ST x f)``, both shortened by a dead band. The motion goes
    through the low-pass, so that load and measurement are of the same age.

    Args:
        robot: The robot.
        load: The tool.
        low_pass: Filter of the joints' motion.
        inertia: See :class:`ToolCompensationParameters`.
        dead_bands: Widths for force [N] and torque [Nm].

    Returns:
        ``(motion, state, known, measured, bias) -> (wrench at the tool point in W, residual
        r in S, next state)``. ``motion`` is ``[q, v]``, shape (2N,), with given inertia
        ``[q, v, a]``; ``state`` that of the filter, which rests on the motion if not
        ``known``: as long as ``motion``, and N longer for rigid joints with
        differentiated inertia.
    """
    n = robot.dimension
    size = 3 * n if inertia == "given" else 2 * n
    differentiated = inertia == "differentiated"
    # rigid joints accelerate in steps, as the drives are held, and their acceleration is the
    # difference of the velocity over the last interval; the trapezoidal rule would ring
    stepwise = differentiated and not robot.is_elastic
    memory = ca.SX.sym("state", size + n * stepwise)
    motion, known = ca.SX.sym("motion", size), ca.SX.sym("known")
    measured, bias = ca.SX.sym("measured", 6), ca.SX.sym("bias", 6)
    state = ca.if_else(known, memory[:size], low_pass.rest(motion))
    q, v, a = ca.vertsplit(ca.vertcat(low_pass.output(state, motion), ca.SX(3 * n - size, 1)), n)
    next_state = low_pass.update(state, motion)
    if differentiated:
        a = low_pass.derivative(state[n:], motion[n:])
        if stepwise:
            # the mean of two trapezoidal derivatives is the filtered difference
            next_state = ca.vertcat(next_state, a)
            a = (a + ca.if_else(known, memory[size:], 0.0)) / 2.0
    elif inertia == "none":
        v = ca.SX(n, 1)
    joints = [Jet.from_derivatives([q[i], v[i], a[i]]) for i in range(n)]
    predicted, R_WS = predicted_load(robot, load, joints)
    residual = measured - predicted
    external = residual - bias
    force = R_WS @ external[:3]
    torque = R_WS @ (external[3:] - ca.cross(ca.SX(load.p_ST), external[:3]))
    wrench = ca.vertcat(dead_band(force, dead_bands[0]), dead_band(torque, dead_bands[1]))
    results = [wrench, residual, next_state]
    return ca.Function(
        "tool_compensation",
        [motion, memory, known, measured, bias],
        ca.cse([ca.densify(result) for result in results]),
        ["motion", "state", "known", "measured", "bias"],
        ["wrench", "residual", "next_state"],
    )


def joint_torque_function(robot: RobotModel) -> ca.Function:
    """Return ``(q, wrench) -> tau_ext = J_g^T wrench``, (2.11), as a function of numbers.

    The wrench acts at the tool point and is in world axes; ``tau_ext`` is the gradient of
    its power by the joint velocities, shape (N,) [Nm or N].
    """
    n = robot.dimension
    q, v, wrench = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("wrench", 6)
    y_t, R_e = robot.tool_pose([Jet([q[i], v[i]]) for i in range(n)])
    w_WT = ca.inv_skew(R_e.coefficients[1] @ R_e.coefficients[0].T)
    power = ca.dot(wrench[:3], y_t.coefficients[1]) + ca.dot(wrench[3:], w_WT)
    tau_ext = ca.densify(ca.gradient(power, v))
    return ca.Function("joint_torque", [q, wrench], ca.cse([tau_ext]), ["q", "wrench"], ["tau_ext"])


class Taring:
    """The sensor's bias as the mean of a quiet stretch of residuals.

    Quiet is judged by means over blocks of samples. Noise does not matter then, and neither do the
    strokes of drives that creep against their friction: an arm that holds a load which nobody
    told it of does so for seconds, at rest but for the last increments of its encoders, and what
    the tool's inertia is believed to do at every one of them is a spike of a sample or two. What
    pushes or moves the tool lasts longer than a block. The first block is judged, but does not
    count for the bias: what came before it, a start for instance, may still fade in it.

    A *window*, shape (25,), is ``[count, sum (6), lowest (6), highest (6), block (6)]``: lowest
    and highest mean of a block, and the sum of the block that is not full. It starts anew, with the
    last block, whenever the means differ too much, so that taring goes on until it is quiet.

    Args:
        samples: Number of samples in a stretch.
        largest_spread: Largest difference of means in it, shape (6,) [N, Nm].
        largest_bias: Largest mean that is believed, shape (6,) [N, Nm].
        block: Number of samples in a block; a stretch is made of whole ones.
    """

    size = 25

    def __init__(
        self,
        samples: int,
        largest_spread: np.ndarray,
        largest_bias: np.ndarray,
        block: int = 1,
    ) -> None:
        self._block = min(block, samples)
        self._samples = -(-samples // self._block) * self._block
        self._only_judged = self._block if 1 < self._block < self._samples else 0
        self._largest_spread, self._largest_bias = largest_spread, largest_bias

    @staticmethod
    def empty() -> np.ndarray:
        """Return the window without samples."""
        return np.concatenate([np.zeros(7), np.full(6, np.inf), np.full(6, -np.inf), np.zeros(6)])

    def extend(self, window: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Return the window with one more residual; only its last block if that differs."""
        count, lowest, highest = window[0] + 1.0, window[7:13], window[13:19]
        total, block = window[1:7], window[19:] + residual
        if window[0] >= self._only_judged:
            total = total + residual
        if count % self._block == 0.0:
            mean = block / self._block
            lowest, highest = np.minimum(lowest, mean), np.maximum(highest, mean)
            if np.any(highest - lowest > self._largest_spread):
                count, lowest, highest = float(self._block), mean, mean
                total = np.zeros(6) if self._only_judged else block
            block = np.zeros(6)
        return np.concatenate([[count], total, lowest, highest, block])

    def bias(self, window: np.ndarray) -> np.ndarray | None:
        """Return the bias, shape (6,), or None as long as the window is not full.

        A mean beyond the largest bias is NaN: the window is to be thrown away.
        """
        if window[0] < self._samples:
            return None
        mean = window[1:7] / (window[0] - self._only_judged)
        return np.full(6, np.nan) if np.any(np.abs(mean) > self._largest_bias) else mean


@dataclass
class ToolCompensationParameters:
    """How the tool's load is taken off a measurement.

    Attributes:
        inertia: ``differentiated``: inertial load from filtered differences of the joint
            velocities; ``given``: from accelerations that another component knows;
            ``none``: only the weight.
        bandwidth: Of the filter for the joints' motion [Hz]; that of the sensor.
        taring_time: Length of the window whose mean becomes the bias [s].
        taring_spread: Largest difference of means over 10 ms within the window, shape (6,)
            [N, Nm].
        taring_bias: Largest bias that is believed, shape (6,) [N, Nm]; a hand that rests
            on the tool, or another tool, must not become a bias.
        force_dead_band: [N].
        torque_dead_band: [Nm].
        noise: Standard deviation of a sample as it is believed, shape (6,) [N, Nm]: a sensor that
            has some and repeats itself to the last bit is lost. 0 where steps are larger.
    """

    inertia: str = "differentiated"
    bandwidth: float = 200.0
    taring_time: float = 0.05
    taring_spread: np.ndarray = field(default_factory=lambda: np.repeat([1.0, 0.05], 3))
    taring_bias: np.ndarray = field(default_factory=lambda: np.repeat([50.0, 2.0], 3))
    force_dead_band: float = 0.0
    torque_dead_band: float = 0.0
    noise: np.ndarray = field(default_factory=lambda: np.zeros(6))

    def __post_init__(self) -> None:
        if self.inertia not in _INERTIA:
            raise InputError(f"inertia = {self.inertia!r}: must be one of {', '.join(_INERTIA)}")
        for key in ("bandwidth", "taring_time"):
            _require_sign(key, getattr(self, key), zero_allowed=False)
        for key in ("force_dead_band", "torque_dead_band"):
            _require_sign(key, getattr(self, key), zero_allowed=True)
        for key in ("taring_spread", "taring_bias"):
            value = np.asarray(getattr(self, key), dtype=float)
            if value.shape != (6,) or not np.all(value > 0.0):
                raise InputError(f"{key} = {value.tolist()}: must be 6 positive numbers")
        noise = np.asarray(self.noise, dtype=float)
        if noise.shape != (6,) or not np.all((noise >= 0.0) & np.isfinite(noise)):
            raise InputError(f"noise = {noise.tolist()}: must be 6 numbers, zero or positive")


def _require_sign(key: str, value: float, *, zero_allowed: bool) -> None:
    if not (np.isfinite(value) and (value > 0.0 or (zero_allowed and value == 0.0))):
        allowed = "zero or positive" if zero_allowed else "positive"
        raise InputError(f"{key} = {value}: must be {allowed} and finite")
