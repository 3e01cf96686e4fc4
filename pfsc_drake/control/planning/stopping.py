"""Bandwidth at which a motion can stop and restart within the limits of its drives."""

from math import sqrt

import numpy as np

from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
from pfsc_drake.control.planning.drive_demand import DriveDemand, apply_scaling

# search interval of the bandwidth [1/s], and relative accuracy
_SLOWEST, _FASTEST, _ACCURACY = 2.0, 60.0, 0.03
# instants of a stop times the bandwidth, and largest number of samples at which a stop begins
_INSTANTS, _BEGINS = np.linspace(0.0, 10.0, 21), 60


def stopping_bandwidth(
    demand: DriveDemand, trajectory: np.ndarray, step: float, allowed: np.ndarray, order: int
) -> float:
    """Return the largest bandwidth of a scaling that may stop and restart anywhere [1/s].

    Stops from the planned speed, and restarts to it, are evaluated from begins along the trajectory
    (:meth:`StoppableScaling.stop`), and their drive demand is compared with the allowed one. The
    bandwidth is between 2 and 60 1/s; it is 2 1/s even if the demand is too large there.

    Args:
        demand: Drive demand of a motion.
        trajectory: Joint coordinates and their derivatives on an even grid of the motion time,
            shape (samples, K + 1, N).
        step: Step of the grid [s].
        allowed: Allowed demand at each sample, shape (samples, 2N).
        order: Relative degree r of the law.
    """
    stride = max(1, len(trajectory) // _BEGINS)
    begins = np.arange(0, len(trajectory), stride)

    def fits(bandwidth: float) -> bool:
        travel, rates = StoppableScaling(order, bandwidth, 0.5).stop(_INSTANTS)
        ends = travel[-1]
        for shift, scaling in (
            (travel, rates),
            (_INSTANTS / bandwidth - travel, _restart_rates(rates)),
        ):
            positions = begins[:, None] + np.minimum(shift, ends + 1.0) / step
            positions = np.minimum(positions, len(trajectory) - 1.0).ravel()
            motion = apply_scaling(
                _interpolate(trajectory, positions), np.tile(scaling, (len(begins), 1))
            )
            if np.any(np.abs(demand.of(motion)) > _interpolate(allowed, positions)):
                return False
        return True

    if not fits(_SLOWEST):
        return _SLOWEST
    low, high = _SLOWEST, _FASTEST
    if fits(high):
        return high
    while high > (1.0 + _ACCURACY) * low:
        middle = sqrt(low * high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def _restart_rates(rates: np.ndarray) -> np.ndarray:
    """Return the rates of a restart: one minus those of a stop."""
    started = -rates
    started[:, 0] += 1.0
    return started


def _interpolate(values: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return linearly interpolated values on a grid, at positions counted in steps."""
    below = np.minimum(positions.astype(int), len(values) - 2)
    share = (positions - below).reshape(-1, *[1] * (values.ndim - 1))
    found: np.ndarray = (1.0 - share) * values[below] + share * values[below + 1]
    return found
