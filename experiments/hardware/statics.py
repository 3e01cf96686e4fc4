"""Diagnosis of signs, zeros and loads from torques of a robot at rest or in slow motion."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.singular_posture import tool_jacobian

# of the largest gravity torque: differences due to friction and sensors
_NOTHING = 0.02
# least explained share of the difference by a single cause
_EXPLAINED = 0.9
# penalty for causes with several parameters
_FEWER = 0.01
_ITERATIONS = 5
_LARGEST_ZERO = 45.0  # deg


@dataclass(frozen=True)
class Cause:
    """Possible cause of a difference.

    Attributes:
        words: Description.
        left: Unexplained share of the difference, 0 to 1.
        unknowns: Number of fitted parameters.
    """

    words: str
    left: float
    unknowns: int

    @property
    def doubt(self) -> float:
        """Unexplained share with a penalty for several parameters."""
        return self.left if self.unknowns == 1 else self.unknowns * self.left + _FEWER


@dataclass(frozen=True)
class StaticCheck:
    """Comparison of torques in M postures, at rest or in slow motion.

    Attributes:
        q: Postures [rad or m], shape (M, N); the first one is at rest.
        measured: Measured torques [Nm or N], shape (M, N).
        expected: Torques of the model, shape (M, N).
        causes: Possible causes of a difference, the most likely first.
        complaint: Message about an error of the motion, or None.
    """

    q: np.ndarray
    measured: np.ndarray
    expected: np.ndarray
    causes: list[Cause]
    complaint: str | None = None

    @property
    def is_good(self) -> bool:
        """Whether measurement and model agree."""
        return not self.causes and self.complaint is None

    @property
    def verdict(self) -> str:
        """Result in one sentence."""
        if self.complaint is not None:
            also = f"; {self._of_torques}" if self.causes else ""
            return f"{self.complaint}{also}"
        return self._of_torques

    @property
    def _of_torques(self) -> str:
        where = "at rest" if len(self.q) == 1 else "at rest and along the motion"
        if not self.causes:
            return f"the robot's torques {where} agree with the model"
        likely = [cause for cause in self.causes if cause.left < 1.0 - _EXPLAINED]
        if not likely:
            return "no single cause explains the difference; check friction and the model"
        best = likely[0]
        others = [cause.words for cause in likely[1:3] if cause.left < 2.0 * best.left + 1e-3]
        also = f"; also possible: {', or '.join(others)}" if others else ""
        return (
            f"most likely {best.words}: it explains {1.0 - best.left:.1%} of the difference{also}"
        )


def check_statics(robot: SerialChain, q: np.ndarray, torque: np.ndarray) -> StaticCheck:
    """Compare measured torques of a robot with gravity torques of its nominal model.

    Args:
        robot: Nominal model, N joints.
        q: Measured postures, shape (M, N) [rad or m].
        torque: Torques measured there, shape (M, N) [Nm or N]; NaN if unknown.

    Raises:
        InputError: If it has another number of joints.
    """
    if q.shape[1] != robot.dimension:
        raise InputError(f"the robot has {q.shape[1]} joints; the scenario's has {robot.dimension}")
    expected = _weights(robot, q)
    largest = max(float(np.abs(expected).max()), 1e-9)
    if np.nanmax(np.abs(torque - expected)) <= _NOTHING * largest:
        return StaticCheck(q, torque, expected, [])
    causes = sorted(_causes(robot, q, torque, expected), key=lambda cause: cause.doubt)
    return StaticCheck(q, torque, expected, causes)


def _weights(robot: SerialChain, q: np.ndarray) -> np.ndarray:
    """Return gravity torques in postures, both (M, N)."""
    return np.asarray(gravity_function(robot).map(len(q))(q.T)).T


def _causes(
    robot: SerialChain, q: np.ndarray, torque: np.ndarray, expected: np.ndarray
) -> Iterator[Cause]:
    """Iterate over possible causes, each with its unexplained share."""
    known, n = np.isfinite(torque), robot.dimension
    torque = np.where(known, torque, 0.0)
    missing = known * (torque - expected)
    size = float(np.linalg.norm(missing))

    def left(rest: np.ndarray) -> float:
        return float(np.linalg.norm(rest) / size)

    for i in range(n):
        flipped = missing.copy()
        flipped[:, i] = known[:, i] * (-torque[:, i] - expected[:, i])
        yield Cause(f"the torque of joint {i + 1} has the wrong sign", left(flipped), 1)
    x = ca.SX.sym("q", n)
    weight = gravity_function(robot)(x)
    slopes = ca.Function("slopes", [x], [ca.jacobian(weight, x)]).map(len(q))
    for i in range(n):
        # fit the joint's position to the gravity torques
        there = q.copy()
        for _ in range(_ITERATIONS):
            column = known * np.asarray(slopes(there.T)).reshape(n, len(q), n)[:, :, i].T
            if not np.any(column):
                break
            rest = known * (torque - _weights(robot, there))
            there[:, i] += float((column * rest).sum() / (column * column).sum())
        off = np.rad2deg(q[0, i] - there[0, i])
        if abs(off) < _LARGEST_ZERO:
            words = f"the zero of joint {i + 1} is off by {off:.2f} deg"
            yield Cause(words, left(known * (torque - _weights(robot, there))), 1)
    lever = ca.Function("J", [x], [-tool_jacobian(robot, x)[:3, :].T @ ca.DM(robot.gravity)])
    column = known * np.asarray(lever.map(len(q))(q.T)).T
    if np.any(column):
        mass = float((column * missing).sum() / (column * column).sum())
        kind = "more" if mass > 0.0 else "less"
        words = f"the tool weighs {abs(mass):.2f} kg {kind} than in the model"
        yield Cause(words, left(missing - mass * column), 1)
    axes = [(known * _weights(replace(robot, gravity=axis), q)).ravel() for axis in np.eye(3)]
    columns = np.column_stack(axes)
    gravity = np.linalg.lstsq(columns, torque.ravel(), rcond=1e-6)[0]
    words = f"gravity is {np.round(gravity, 2).tolist()} m/s^2 in the robot's world"
    words += f", not {np.round(robot.gravity, 2).tolist()}"
    yield Cause(words, left(torque.ravel() - columns @ gravity), 3)
