"""Inverse kinematics of any robot, for start poses."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, pose_function

_TOLERANCE = 1e-9
_RESTARTS = 30
# limits of this magnitude are none [rad or m]
UNLIMITED = 1e6
_STEPS = 100  # of one attempt; one that succeeds needs about ten
# weight of the way to the guess, m or 1 per rad or m, beside errors of the pose
_PULL = 1e-3


@dataclass(frozen=True)
class ToolTarget:
    """Where a tool is to be, as far as it matters.

    Attributes:
        y_t: Tool point in the world [m], shape (3,).
        R_e: Orientation of the tool, shape (3, 3), or None if any will do.
        tool_axis: Axis in the tool frame, of length one, shape (3,), that alone is to have the
            direction that R_e gives it; None if all of R_e matters.
    """

    y_t: np.ndarray
    R_e: np.ndarray | None = None
    tool_axis: np.ndarray | None = None

    @property
    def num_outputs(self) -> int:
        """Number of coordinates that the tool is to have: 3, 5 or 6."""
        if self.R_e is None:
            return 3
        return 6 if self.tool_axis is None else 5

    @property
    def rows(self) -> np.ndarray:
        """What matters of ``[y_t, R_e by rows]`` as a linear map, shape (.., 12)."""
        if self.R_e is None:
            return np.eye(3, 12)
        if self.tool_axis is None:
            return np.eye(12)
        direction = np.kron(np.eye(3), self.tool_axis)
        return np.block([[np.eye(3, 12)], [np.zeros((3, 3)), direction]])


def solve_pose(robot: RobotModel, target: ToolTarget, guess: np.ndarray, name: str) -> np.ndarray:
    """Return joint coordinates within their limits that put the tool where it is to be.

    The search starts at the guess, so that the guess chooses the branch; other
    starts are tried only if that one fails. Of the many solutions of a robot that has more
    joints than the tool needs, one is returned from which no small step leads nearer to the guess.

    Args:
        robot: The robot.
        target: Where the tool is to be.
        guess: Joint coordinates near the solution, shape (N,).
        name: What the pose is, for the message.

    Raises:
        InputError: If the pose is out of reach within the joint limits.
    """
    pose, rows = pose_function(robot), target.rows
    jacobian = pose.factory("jacobian", ["q"], ["jac:pose:q"])
    R_e = np.zeros((3, 3)) if target.R_e is None else target.R_e
    wanted = rows @ np.concatenate([target.y_t, np.ravel(R_e)])
    limits = robot.gather("position_limits")
    lower, upper = np.where(np.abs(limits) < UNLIMITED, limits, np.copysign(np.inf, limits)).T

    def residual(q: np.ndarray) -> np.ndarray:
        return rows @ np.array(pose(q)).ravel() - wanted

    def slope(q: np.ndarray) -> np.ndarray:
        return rows @ np.array(jacobian(q))

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
        """Pull a solution to the guess, and put the tool back where it is to be."""
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
