"""Corners: the places where three surfaces meet."""

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.intersections.meeting import Meeting, numbers
from pfsc_drake.geometry.intersections.search import distinct, starts
from pfsc_drake.geometry.surfaces.surface import Surface

# Volume that three unit normals span, below which they lie in a plane.
_FLAT = 1e-3
# Of the size: corners that are nearer to each other are one.
_ONE = 1e-6


def find_corners(first: Surface, second: Surface, third: Surface) -> np.ndarray:
    """All places at which three surfaces meet.

    What is smaller than the samples of :func:`sample_grid` may be overlooked.

    Args:
        first: Surface of class C^1.
        second: Another.
        third: Another.

    Returns:
        Places [corners, 3], m, one or more, by x, then y, then z.

    Raises:
        InputError: They meet nowhere within their bounds, or somewhere with normals that lie in a
            plane, as where an edge of two touches the third; says where.
    """
    meeting = Meeting([first, second, third])
    theta, good = meeting.solve(starts(meeting.surfaces))
    if not good.any():
        raise InputError(
            "surfaces: all three do not meet within their bounds, though they come as near as "
            f"{meeting.gaps(theta).min():.3g} m; larger or other ones are required"
        )
    theta = theta[good]
    volume = np.abs(np.linalg.det(meeting.normals(theta).transpose(1, 0, 2)))
    row = int(np.argmin(volume))
    if volume[row] < _FLAT:
        where = numbers(meeting.partials(theta[row : row + 1], 0)[0, 0, 0])
        raise InputError(
            f"surfaces: an edge of two touches the third at {where}; a corner is where three "
            "normals do not lie in a plane"
        )
    one = _ONE * meeting.size
    places = meeting.partials(distinct(meeting, theta, one), 0)[0, :, 0]
    return places[np.lexsort(np.round(places / one).T[::-1])]
