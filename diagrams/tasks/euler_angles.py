"""Euler angles of a task that takes them itself, and how far they are from where they end."""

from collections.abc import Callable

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import euler_margin

# rad: nearer the law's rows are 60 times those of a turn, and 6 times
_LEAST, _LITTLE = np.deg2rad(1.0), np.deg2rad(10.0)
_OTHER = {"zyx": "zyz", "zyz": "zyx"}


def euler_warnings(
    convention: str | None, R_d: np.ndarray, block: str, place: Callable[[int], str]
) -> list[str]:
    """Return what to say of a reference near the singularity of its Euler angles, if it is.

    Args:
        convention: Of the angles that are coordinates; None where they are not.
        R_d: Orientations of the reference, shape (samples, 3, 3).
        block: Of the scenario that tells the orientation.
        place: Where a sample is, in words.

    Raises:
        InputError: If it is so near that there are no such coordinates.
    """
    if convention is None:
        return []
    key = f"{block}.orientation"
    margins = euler_margin(R_d, convention)
    worst, other = int(np.argmin(margins)), _OTHER[convention]
    margin = float(margins[worst])
    if margin > _LITTLE:
        return []
    there = float(euler_margin(R_d, other).min())
    instead = f"{key}.jacobian: geometric"
    if there > _LITTLE:
        instead += (
            f", or {key}.convention: {other}, whose angles are {np.rad2deg(there):.3g} deg from it"
        )
    said = (
        f"{key}.jacobian = analytic: the {convention} angles of the reference are "
        f"{np.rad2deg(margin):.3g} deg from their singularity {place(worst)}; write {instead}"
    )
    if margin < _LEAST:
        raise InputError(said)
    return [said]
