"""How slowly a motion is to be gone through where drives would not keep up with it."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from pfsc_drake.control.planning.drive_demand import DriveDemand, with_pace
from pfsc_drake.errors import InputError

# paces that are tried; slower than the slowest, a motion stands
_LADDER = np.linspace(1.0, 0.01, 100)
# steps to the time asked for, from a linear guess
_NEWTON = 4
# box filters that make the pace C^4
_BOXES = 5
# how often the pace is corrected, and by how much more than the demand tells
_CORRECTIONS, _FURTHER = 30, 0.97
# of what is allowed, left to the change of pace at the pace that is the largest if it is even
_FOR_CHANGES = 0.1
# of what may be used of what drives have left beside the weight that they hold
_BESIDE_WEIGHT = 0.5


@dataclass(frozen=True)
class Pace:
    """How fast a motion is gone through, on a grid of the time ``tau`` that was asked for.

    Attributes:
        rates: ``c = dtau/dt`` and its time derivatives, shape (samples, 4) [1, 1/s, ..].
        share: Largest share of its limit that a drive is asked for, shape (samples,).
        tightest: Column of the demand that decides over the pace, shape (samples,).
    """

    rates: np.ndarray
    share: np.ndarray
    tightest: np.ndarray


def allowed_demand(
    at_rest: np.ndarray, limits: np.ndarray, reserve: np.ndarray | float
) -> np.ndarray:
    """Return what may be asked of the drives, shape (samples, 2N).

    That is ``1 - reserve`` of the limits; where the weight of the links alone takes about that
    much, half of that share of what it leaves is allowed beside it.

    Args:
        at_rest: Demand at rest, shape (samples, 2N).
        limits: What drives can do, shape (2N,).
        reserve: Share of the limits that is left, shape (2N,) or one for all.
    """
    weight = np.minimum(np.abs(at_rest), limits)
    usable = (1.0 - reserve) * limits
    beside = np.where(weight < limits, limits - weight, 0.0)
    return np.maximum(usable, weight + _BESIDE_WEIGHT * (1.0 - reserve) * beside)


def find_pace(
    demand: DriveDemand,
    course: np.ndarray,
    step: float,
    allowed: np.ndarray,
    change: float,
    smoothing: float,
) -> Pace:
    """Return the pace at which the drives are asked for no more than is allowed.

    1. The largest even pace ``c(tau) <= 1`` from the polynomials of the demand.
    2. Its minimum over the way that the smoothing spans, and forward and backward passes that
       bound its change.
    3. Box filters, whose result is C^4 over ``tau``, and so over time.
    4. The demand of this very motion, its changes of pace with all their derivatives included.
       Where it is too large, the even pace is lowered, and what bounds its change; again from 2.

    Args:
        demand: Tells what a motion asks of the drives.
        course: Joint coordinates and derivatives by ``tau``, shape (samples, K + 1, N).
        step: Of the grid [s].
        allowed: What may be asked, shape (samples, 2N).
        change: Largest change of pace ``dc/dt`` [1/s].
        smoothing: Width of the filters together [s].

    Raises:
        InputError: If no pace is slow enough.
    """
    polynomials = demand.at_constant_rate(course)
    even, tightest = _even_pace(polynomials, (1.0 - _FOR_CHANGES) * allowed)
    bound = np.full(len(course), change)
    half = max(1, round(smoothing / (2.0 * _BOXES * step)))
    reach = 2 * _BOXES * half + 1
    for _ in range(_CORRECTIONS):
        rates = _smoothed(even, bound, step, half)
        ratio = np.abs(demand.of(with_pace(course, rates))) / allowed
        worst = ratio.argmax(axis=1)
        share = np.take_along_axis(ratio, worst[:, None], axis=1)[:, 0]
        if share.max() <= 1.0:
            return Pace(rates, share, np.where(even < 1.0, tightest, worst))
        # what would be asked without a change of pace, and with it
        alone = _evaluated(polynomials, rates[:, 0])
        constant = np.take_along_axis(np.abs(alone) / allowed, worst[:, None], axis=1)[:, 0]
        over = share > 1.0
        room = np.maximum(1.0 - constant, 0.0) / np.maximum(share - constant, 1e-12)
        slower = np.where(over, np.clip(_FURTHER * room, 0.5, 1.0), 1.0)
        bound = bound * minimum_filter1d(slower, reach)
        lower = np.where(over, _FURTHER * np.clip(share, 1.0, 2.0) ** -0.25, 1.0)
        even = np.minimum(even, np.where(over, rates[:, 0] * lower, np.inf))
        even = np.maximum(even, _LADDER[-1])
    raise InputError(f"no pace found; the drives are asked for {share.max():.3g} of what they may")


def _evaluated(polynomials: np.ndarray, pace: np.ndarray) -> np.ndarray:
    """Return polynomials (samples, k, 2N) of a pace each (samples,), or one of all."""
    value = polynomials[:, -1]
    for k in range(polynomials.shape[1] - 2, -1, -1):
        value = value * np.reshape(pace, (-1, 1)) + polynomials[:, k]
    return value


def _even_pace(polynomials: np.ndarray, allowed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest pace below which everything is allowed, and what forbids more."""
    pace = np.full(len(polynomials), _LADDER[-1])
    tightest = np.zeros(len(polynomials), dtype=int)
    left = np.arange(len(polynomials))
    # from slow to fast; a sample that has asked too much once is done
    for candidate in _LADDER[::-1]:
        ratio = np.abs(_evaluated(polynomials[left], candidate)) / allowed[left]
        tightest[left] = ratio.argmax(axis=1)
        fits = ratio.max(axis=1) <= 1.0
        left = left[fits]
        pace[left] = candidate
    return pace, tightest


def _smoothed(even: np.ndarray, bound: np.ndarray, step: float, half: int) -> np.ndarray:
    """Return a pace below another, and its time derivatives, shape (samples, 4)."""
    square = minimum_filter1d(even, 2 * _BOXES * half + 1) ** 2
    # d(c^2)/dtau = 2 dc/dt
    rise = (2.0 * step * bound).tolist()
    values = square.tolist()
    for i in range(1, len(values)):
        values[i] = min(values[i], values[i - 1] + rise[i])
    for i in range(len(values) - 2, -1, -1):
        values[i] = min(values[i], values[i + 1] + rise[i])
    pace = np.sqrt(values)
    for _ in range(_BOXES):
        pace = uniform_filter1d(pace, 2 * half + 1, mode="nearest")
    rates = [np.minimum(pace, 1.0)]
    for _ in range(3):
        rates.append(pace * np.gradient(rates[-1], step))
    return np.array(rates).T


class Clock:
    """The time ``t`` at which a time ``tau`` comes at a pace, and back.

    Args:
        pace: ``dtau/dt`` on an even grid of ``tau`` from 0 on, shape (samples,).
        step: Of the grid [s].
    """

    def __init__(self, pace: np.ndarray, step: float) -> None:
        grid = step * np.arange(len(pace))
        # a rule that is not the same at odd and even samples would sound in high derivatives
        self._slowness = make_interp_spline(grid, 1.0 / pace, k=5)
        self._time = self._slowness.antiderivative()
        self._grid, self.times = grid, self._time(grid)

    @property
    def end(self) -> float:
        """``t`` at the end [s]."""
        return float(self.times[-1])

    def tau(self, times: np.ndarray) -> np.ndarray:
        """Return ``tau(t)`` [s], of the shape of the times."""
        tau = np.interp(times, self.times, self._grid)
        for _ in range(_NEWTON):
            tau -= (self._time(tau) - times) / self._slowness(tau)
        return np.clip(tau, 0.0, self._grid[-1])
