"""Inverse kinematics of any robot, for start poses."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import rotation_to_axis
from pfsc_drake.robot.robot_model import RobotModel, pose_function

_TOLERANCE = 1e-9
_RESTARTS = 30
# limits of this magnitude are ignored [rad or m]
UNLIMITED = 1e6
# below which a turn about an axis is not defined
_LEAST_TURN = 1e-9
_STEPS = 100  # of one attempt; one that succeeds needs about ten
# weight of the distance to the guess, m or 1 per rad or m, relative to errors of the pose
_PULL = 1e-3


def middle_posture(robot: RobotModel) -> np.ndarray:
    """Return joints in the middle of their limits, unlimited ones near zero, shape (N,)."""
    lower, upper = np.clip(robot.gather("position_limits"), -UNLIMITED, UNLIMITED).T
    limited = np.maximum(-lower, upper) < UNLIMITED
    return np.where(limited, (lower + upper) / 2.0, np.clip(0.0, lower, upper))


@dataclass(frozen=True)
class ToolTarget:
    """Desired pose of a tool, or a part of it.

    Attributes:
        y_t: Tool point in the world [m], shape (3,).
        R_e: Orientation of the tool, shape (3, 3), or None for any orientation.
        tool_axis: Axis in the tool frame, of length one, shape (3,), whose direction alone is
            prescribed by R_e; None if more of R_e is.
        yaw_axis: Axis in the world, of length one, shape (3,), about which alone the turn of the
            tool is prescribed by R_e; None if more of R_e is.
    """

    y_t: np.ndarray
    R_e: np.ndarray | None = None
    tool_axis: np.ndarray | None = None
    yaw_axis: np.ndarray | None = None

    @property
    def num_outputs(self) -> int:
        """Number of prescribed coordinates of the tool: 3, 4, 5 or 6."""
        if self.R_e is None:
            return 3
        if self.yaw_axis is not None:
            return 4
        return 6 if self.tool_axis is None else 5

    def error(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the error of a pose against the target, and its slope.

        Args:
            pose: ``[y_t, R by rows]``, shape (12,).

        Returns:
            The error, zero at poses that fulfil the target, shape (k,), and its derivatives by the
            pose, shape (k, 12).
        """
        R_e = np.zeros((3, 3)) if self.R_e is None else self.R_e
        desired_pose = np.concatenate([self.y_t, np.ravel(R_e)])
        if self.R_e is None or self.yaw_axis is None:
            rows = self._rows
            return rows @ (pose - desired_pose), rows
        # sine and cosine of the turn, times a positive number, see ``yaw_error``
        _, b, c = rotation_to_axis(self.yaw_axis).T
        turn = np.array([np.outer(c, b) - np.outer(b, c), np.outer(b, b) + np.outer(c, c)])
        rows = (turn @ R_e).reshape(2, 9)
        turned = rows @ pose[3:]
        size = max(float(np.linalg.norm(turned)), _LEAST_TURN)
        turned = turned / size
        slope = (np.eye(2) - np.outer(turned, turned)) @ rows / size
        across = np.hstack([np.zeros((2, 3)), slope])
        error = np.append(pose[:3] - self.y_t, turned - [0.0, 1.0])
        return error, np.vstack([np.eye(3, 12), across])

    def tilt(self, R: np.ndarray) -> float:
        """Return the angle between an orientation and R_e without the turn about the axis [rad].

        Args:
            R: Shape (3, 3).
        """
        assert self.R_e is not None and self.yaw_axis is not None
        _, b, c = rotation_to_axis(self.yaw_axis).T
        M = R @ self.R_e.T
        size = math.hypot(c @ M @ b - b @ M @ c, b @ M @ b + c @ M @ c) / 2.0
        return math.acos(min(max(2.0 * size - 1.0, -1.0), 1.0))

    @property
    def _rows(self) -> np.ndarray:
        """Linear map from ``[y_t, R_e by rows]`` to its prescribed part, shape (.., 12)."""
        if self.R_e is None:
            return np.eye(3, 12)
        if self.tool_axis is None:
            return np.eye(12)
        direction = np.kron(np.eye(3), self.tool_axis)
        return np.block([[np.eye(3, 12)], [np.zeros((3, 3)), direction]])


def solve_pose(robot: RobotModel, target: ToolTarget, guess: np.ndarray, name: str) -> np.ndarray:
    """Return joint coordinates within their limits for a desired pose of the tool.

    The search starts at the guess, so that the guess chooses the branch; other
    starts are tried only if it fails. For a redundant robot the solution is locally the nearest
    one to the guess.

    Args:
        robot: The robot.
        target: Desired pose of the tool.
        guess: Joint coordinates near the solution, shape (N,).
        name: Name of the pose in the message.

    Raises:
        InputError: If the pose is out of reach within the joint limits.
    """
    pose = pose_function(robot)
    jacobian = pose.factory("jacobian", ["q"], ["jac:pose:q"])
    limits = robot.gather("position_limits")
    lower, upper = np.where(np.abs(limits) < UNLIMITED, limits, np.copysign(np.inf, limits)).T

    def residual(q: np.ndarray) -> np.ndarray:
        return target.error(np.array(pose(q)).ravel())[0]

    def slope(q: np.ndarray) -> np.ndarray:
        return target.error(np.array(pose(q)).ravel())[1] @ np.array(jacobian(q))

    random = np.random.default_rng(0)
    spread = np.minimum(upper - lower, 2.0 * np.pi)
    middle = np.clip(guess, lower, upper)
    best = np.inf
    margin = 1e-9 * spread

    def solve(
        start: np.ndarray, function: Callable = residual, gradient: Callable = slope
    ) -> OptimizeResult:
        return least_squares(
            function,
            np.clip(start, lower + margin, upper - margin),
            gradient,
            bounds=(lower, upper),
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=_STEPS,
        )

    def nearer(q: np.ndarray) -> np.ndarray:
        """Pull a solution to the guess, and restore the desired pose."""
        pulled = solve(
            q,
            lambda x: np.append(residual(x), _PULL * (x - middle)),
            lambda x: np.vstack([slope(x), _PULL * np.eye(len(x))]),
        )
        polished = solve(pulled.x)
        return polished.x if np.max(np.abs(polished.fun)) < _TOLERANCE else q

    for attempt in range(_RESTARTS):
        start = middle if attempt == 0 else middle + random.uniform(-0.5, 0.5, len(guess)) * spread
        solution = solve(start)
        if float(np.max(np.abs(solution.fun))) < _TOLERANCE:
            return nearer(solution.x) if robot.dimension > target.num_outputs else solution.x
        best = min(best, float(np.linalg.norm(solution.fun[:3])))
    kind = "position" if target.R_e is None else "pose"
    raise InputError(
        f"{name}: {kind} with tool point {np.round(target.y_t, 4).tolist()} m is unreachable "
        f"within the joint limits; the nearest found misses the point by {best * 1e3:.3g} mm"
    )
