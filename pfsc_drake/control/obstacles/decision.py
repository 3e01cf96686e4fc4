"""How fast a motion may go on, or back, by what is known of the places on its way."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.cases import all_of, where
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters

# of the planned pace, below which nobody asks for less than a pause
SLOWEST = 0.05
# of the pace that counts as rest, below which the lags are empty
_EMPTY = 0.1


@dataclass(frozen=True)
class Samples:
    """Places on the way of a motion, each a row of the same length; those behind come first.

    Attributes:
        left: Time b until an obstacle may be nearer than the margin [s].
        expected: Least distance from where obstacles are expected from the arm's arrival on [m].
        times: Own time of the motion [s].
    """

    left: Any
    expected: Any
    times: Any


def decision_function(
    parameters: WatchParameters, pace: WaitingPace, step: float, behind: int, count: int
) -> ca.Function:
    """Return what decides over the pace, see :class:`ObstacleWatch`.

    It is ``(left, expected, times, clock, asked, now, passed) -> (override, permitted, passes)``,
    the first three as in :class:`Samples`. ``now`` is b of the arm as it is; ``passes``
    is 1 where it passes, -1 where it goes back, and ``passed`` what it was.

    Args:
        parameters: How it keeps away from obstacles.
        pace: How it can be stopped.
        step: From sample to sample [s].
        behind: How many of the samples are behind the tool.
        count: Number of samples.
    """
    p = parameters
    rows = [ca.SX.sym(name, 1, count) for name in ("left", "expected", "times")]
    samples, clock = Samples(*rows), ca.SX.sym("clock", pace.order + 2)
    asked, now, passed = (ca.SX.sym(name) for name in ("asked", "now", "passed"))
    s, first, rest, *others = ca.vertsplit(clock)
    low, high, least = ca.fmin(s, rest) - step, ca.fmax(s, rest) + step, now
    for j in range(count):
        within = all_of(samples.times[j] >= low, samples.times[j] <= high)
        least = where(within, ca.fmin(least, samples.left[j]), least)
    permitted = pace.permitted(least, [first, *others])
    room, passes = _onwards(p, pace, samples, (behind, step), rest, asked, passed)
    override = ca.fmin(ca.fmin(asked, permitted), room * pace.bandwidth)
    if p.retreat:
        back = _backwards(p, samples, (behind, step), rest, passed)
        goes_back = all_of(back > 0.0, passes == 0.0)
        backwards = ca.fmin(ca.fmin(p.retreat, permitted), back * pace.bandwidth)
        # it turns where it rests
        left, empty = rest - s, _EMPTY * pace.resting / pace.bandwidth
        override = where(
            goes_back,
            where(left <= empty, -backwards, 0.0),
            where(left >= -empty, override, 0.0),
        )
        passes = where(goes_back, -1.0, passes)
    return ca.Function(
        "decision", [*rows, clock, asked, now, passed], [override, permitted, passes]
    )


def _onwards(
    p: WatchParameters,
    pace: WaitingPace,
    samples: Samples,
    grid: tuple[int, float],
    rest: Any,
    asked: Any,
    passed: Any,
) -> tuple[Any, Any]:
    """Return how far there is room to go on to [s], and whether it passes what is in the way."""
    behind, step = grid
    way, clear = samples.times - rest, p.margin + p.side
    reserve = where(passed > 0.0, 0.0, 2.0 * p.uncertainty / p.largest_speed)
    needed = ca.fmax(way, 0.0) / ca.fmax(asked, SLOWEST) + pace.time_to_stop + reserve
    wait, free, passes = ca.inf, 1.0, 0.0
    for j in range(behind, samples.times.shape[1]):
        waits = samples.expected[j] >= clear
        free = all_of(free, samples.left[j] >= needed[j])
        passes = ca.fmax(passes, all_of(free, waits, way[j] >= 0.0))
        blocked = all_of(ca.logic_not(waits), way[j] > -step)
        wait = where(blocked, ca.fmin(wait, way[j] - step), wait)
    return where(passes, ca.inf, ca.fmax(wait, 0.0)), passes


def _backwards(
    p: WatchParameters, samples: Samples, grid: tuple[int, float], rest: Any, passed: Any
) -> Any:
    """Return how far it is back to where it can wait, or to where most time is left [s].

    It is 0 where it can wait here, and if there is no such place behind.
    """
    behind, step = grid
    clear, here, time = p.margin + p.side, ca.inf, ca.inf
    for j in range(samples.times.shape[1]):
        near = ca.fabs(samples.times[j] - rest) <= step
        here = where(near, ca.fmin(here, samples.expected[j]), here)
        time = where(near, ca.fmin(time, samples.left[j]), time)
    goes_back = passed < 0.0
    most, longest, back = time + where(goes_back, 0.0, p.side / p.largest_speed), 0.0, ca.inf
    for j in range(behind + 1):
        way, left = rest - samples.times[j], samples.left[j]
        waits = all_of(way > 0.0, samples.expected[j] >= clear)
        back = where(waits, ca.fmin(back, way), back)
        better = all_of(way > 0.0, left > most)
        most, longest = where(better, left, most), where(better, way, longest)
    threatened = here < where(goes_back, clear, p.margin)
    return where(threatened, where(back < ca.inf, back, longest), 0.0)
