"""Places at which surfaces touch or coincide instead of crossing each other."""

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.intersections.meeting import Meeting, numbers

# Sine of the angle between normals below which surfaces touch: the distance from a place at which
# they do is found but roughly.
_TOUCHING = 1e-3
# Difference of curvatures times the size, below which surfaces that touch are one.
_ONE = 1e-4


def require_crossing(meeting: Meeting, theta: np.ndarray) -> None:
    """Refuse places at which two surfaces have one tangent plane.

    Args:
        meeting: Two surfaces of class C^2.
        theta: Parameters of places that they have in common, [n, 4].

    Raises:
        InputError: They touch or coincide there; says which and where.
    """
    first, second = meeting.normals(theta)
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    row = int(np.argmin(sine))
    if sine[row] > _TOUCHING:
        return
    where = numbers(meeting.partials(theta[row : row + 1], 0)[0, 0, 0])
    same_side = float(np.sign(first[row] @ second[row]))
    bends = [_bending(meeting, k, theta[row]) for k in (0, 1)]
    if np.abs(bends[0] - same_side * bends[1]).max() * meeting.size < _ONE:
        raise InputError(
            f"surfaces: coincide around {where}; two that cross each other are required"
        )
    raise InputError(
        f"surfaces: touch at {where} instead of crossing each other; an edge is where their "
        "normals differ"
    )


def _bending(meeting: Meeting, k: int, theta: np.ndarray) -> np.ndarray:
    """Second fundamental form of surface k in the directions of space, [3, 3], 1/m."""
    partials = meeting.partials(theta[None], 2)[k, 0]
    normal = np.cross(partials[1], partials[2])
    normal /= np.linalg.norm(normal)
    second = np.array([[partials[3] @ normal, partials[4] @ normal]] * 2)
    second[1] = partials[4] @ normal, partials[5] @ normal
    dual = np.linalg.pinv(partials[1:3])
    return np.asarray(dual @ second @ dual.T)
