"""Where a ball is in its notch."""

import numpy as np

from diagrams.scenario.notch import NotchParameters
from pfsc_drake.geometry import Path, PathPointLayout


def place_in_notch(
    path: Path, notch: NotchParameters, y_t: np.ndarray, initial_theta: float, up: np.ndarray
) -> np.ndarray:
    """Return where the ball's centre is in the cross-section of its notch.

    It touches the round bottom at a distance ``notch.clearance`` from the notch's axis.

    Args:
        path: The path that was taught.
        notch: Ball and workpiece.
        y_t: Motion of the tool point [m], shape (samples, 3).
        initial_theta: Path parameter near the first sample.
        up: Unit vector in the world, shape (3,).

    Returns:
        To the left of the notch's axis, seen along the path, and above it [m], shape (samples, 2).
    """
    evaluator = path.evaluator(2)
    layout = PathPointLayout(2, path.orientation is not None)
    # back to where the workpiece stood, and from the bottom up to the axis
    moved = y_t - np.array(notch.displacement) - notch.clearance * up
    place, theta = np.full((len(y_t), 2), np.nan), initial_theta
    for k, y in enumerate(moved):
        if not np.isfinite(y).all():
            continue
        point = evaluator(y.tolist(), theta)
        theta = point[layout.theta][0]
        sigma, slope = point[layout.position].reshape(-1, 3)[:2]
        left = np.cross(up, slope)
        left /= np.linalg.norm(left)
        above = np.cross(slope / np.linalg.norm(slope), left)
        place[k] = left @ (y - sigma), above @ (y - sigma)
    return place
