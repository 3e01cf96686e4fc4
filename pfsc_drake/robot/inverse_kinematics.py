"""Inverse kinematics of any robot, for start poses."""

import numpy as np
from scipy.optimize import least_squares

from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, pose_function

_TOLERANCE = 1e-9
_RESTARTS = 30
# limits of this magnitude are none [rad or m]
UNLIMITED = 1e6
_STEPS = 100  # of one attempt; one that succeeds needs about ten


def solve_pose(
    robot: RobotModel, y_t: np.ndarray, R_e: np.ndarray | None, guess: np.ndarray, name: str
) -> np.ndarray:
    """Return joint coordinates within their limits that put the tool at a pose.

    The search starts at the guess, so that the guess chooses the branch; other
    starts are tried only if that one fails.

    Args:
        robot: The robot.
        y_t: Tool point in the world [m], shape (3,).
        R_e: Tool orientation, shape (3, 3), or None if any will do.
        guess: Joint coordinates near the solution, shape (N,).
        name: What the pose is, for the message.

    Raises:
        InputError: If the pose is out of reach within the joint limits.
    """
    pose = pose_function(robot)
    jacobian = pose.factory("jacobian", ["q"], ["jac:pose:q"])
    target = np.concatenate([y_t, np.zeros(9) if R_e is None else np.ravel(R_e)])
    used = slice(0, 3 if R_e is None else 12)
    limits = robot.gather("position_limits")
    lower, upper = np.where(np.abs(limits) < UNLIMITED, limits, np.copysign(np.inf, limits)).T

    def residual(q: np.ndarray) -> np.ndarray:
        return np.array(pose(q)).ravel()[used] - target[used]

    def slope(q: np.ndarray) -> np.ndarray:
        return np.array(jacobian(q))[used]

    random = np.random.default_rng(0)
    spread = np.minimum(upper - lower, 2.0 * np.pi)
    middle = np.clip(guess, lower, upper)
    best = np.inf
    for attempt in range(_RESTARTS):
        start = middle if attempt == 0 else middle + random.uniform(-0.5, 0.5, len(guess)) * spread
        margin = 1e-9 * spread
        solution = least_squares(
            residual,
            np.clip(start, lower + margin, upper - margin),
            slope,
            bounds=(lower, upper),
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=_STEPS,
        )
        error = float(np.max(np.abs(solution.fun)))
        if error < _TOLERANCE:
            return solution.x
        best = min(best, float(np.linalg.norm(solution.fun[:3])))
    kind = "position" if R_e is None else "pose"
    raise InputError(
        f"{name}: {kind} with tool point {np.round(y_t, 4).tolist()} m is unreachable within the "
        f"joint limits; the nearest found misses the point by {best * 1e3:.3g} mm"
    )
