"""How quickly a motion can be stopped, and set off again, within what its drives may be asked."""

from math import sqrt

import numpy as np

from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.control.planning.drive_demand import DriveDemand, with_pace

# 1/s, between which a bandwidth is looked for, and to which share it is found
_SLOWEST, _FASTEST, _FOUND = 2.0, 60.0, 0.03
# instants of a stop, times the bandwidth; and the most samples of a course from which it begins
_INSTANTS, _BEGINS = np.linspace(0.0, 10.0, 21), 60


def stopping_bandwidth(
    demand: DriveDemand, course: np.ndarray, step: float, allowed: np.ndarray, order: int
) -> float:
    """Return the largest bandwidth of a pace that may stop and set off anywhere on a course [1/s].

    Stops from the planned pace, and starts to it, are gone through from every begin on the course
    (:meth:`WaitingPace.stop`), and what they ask of the drives is compared with what is allowed.
    It is between 2 and 60 1/s; the former also where even that is too much.

    Args:
        demand: What motions ask of the drives.
        course: The joints' coordinates and their derivatives on an even grid of the motion's own
            time, shape (samples, K + 1, N).
        step: Of the grid [s].
        allowed: What may be asked at each sample, shape (samples, 2N).
        order: r of the law.
    """
    stride = max(1, len(course) // _BEGINS)
    begins = np.arange(0, len(course), stride)

    def fits(bandwidth: float) -> bool:
        way, rates = WaitingPace(order, bandwidth, 0.5).stop(_INSTANTS)
        ends = way[-1]
        for shift, pace in ((way, rates), (_INSTANTS / bandwidth - way, _one_less(rates))):
            places = begins[:, None] + np.minimum(shift, ends + 1.0) / step
            kept = np.minimum(places, len(course) - 1.0).ravel()
            motion = with_pace(_between(course, kept), np.tile(pace, (len(begins), 1)))
            if np.any(np.abs(demand.of(motion)) > _between(allowed, kept)):
                return False
        return True

    if not fits(_SLOWEST):
        return _SLOWEST
    low, high = _SLOWEST, _FASTEST
    if fits(high):
        return high
    while high > (1.0 + _FOUND) * low:
        middle = sqrt(low * high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def _one_less(rates: np.ndarray) -> np.ndarray:
    """Return the rates of setting off: one less those of a stop."""
    started = -rates
    started[:, 0] += 1.0
    return started


def _between(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return values on a grid linearly in between, places counted in steps."""
    below = np.minimum(places.astype(int), len(values) - 2)
    share = (places - below).reshape(-1, *[1] * (values.ndim - 1))
    found: np.ndarray = (1.0 - share) * values[below] + share * values[below + 1]
    return found
