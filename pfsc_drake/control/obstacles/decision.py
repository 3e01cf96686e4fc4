"""Decision on the speed scaling of a motion that waits for obstacles, passes or retreats."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.cases import all_of, where
from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters

# share of the planned speed; below it a request is a pause
SLOWEST = 0.05
# share of the resting speed below which the lags are empty
_EMPTY = 0.1


@dataclass(frozen=True)
class Samples:
    """Samples along a motion, rows of the same length; samples behind the tool come first.

    Attributes:
        left: Time b until an obstacle may be nearer than the margin [s].
        expected: Least distance from predicted obstacles from the arm's arrival on [m].
        times: Motion time [s].
    """

    left: Any
    expected: Any
    times: Any


def decision_function(
    parameters: WatchParameters, scaling: StoppableScaling, step: float, behind: int, count: int
) -> ca.Function:
    """Return the decision on the speed scaling, see :class:`ObstacleWatch`.

    The function is ``(left, expected, times, clock, requested, now, passed) -> (override,
    permitted, passes)``, the first three as in :class:`Samples`. ``now`` is b of the arm at
    present. ``passes`` is 1 where the motion passes, -1 where it goes back; ``passed`` is the
    previous value.

    Args:
        parameters: Parameters of the watch.
        scaling: Speed scaling that can be stopped.
        step: Step from sample to sample [s].
        behind: Number of samples behind the tool.
        count: Number of samples.
    """
    p = parameters
    rows = [ca.SX.sym(name, 1, count) for name in ("left", "expected", "times")]
    samples, clock = Samples(*rows), ca.SX.sym("clock", scaling.order + 2)
    requested, now, passed = (ca.SX.sym(name) for name in ("requested", "now", "passed"))
    s, first, rest, *others = ca.vertsplit(clock)
    low, high, least = ca.fmin(s, rest) - step, ca.fmax(s, rest) + step, now
    for j in range(count):
        within = all_of(samples.times[j] >= low, samples.times[j] <= high)
        least = where(within, ca.fmin(least, samples.left[j]), least)
    permitted = scaling.largest_request(least, [first, *others])
    free, passes = _onwards(p, scaling, samples, (behind, step), rest, requested, passed)
    override = ca.fmin(ca.fmin(requested, permitted), free * scaling.bandwidth)
    if p.retreat:
        back = _backwards(p, samples, (behind, step), rest, passed)
        goes_back = all_of(back > 0.0, passes == 0.0)
        backwards = ca.fmin(ca.fmin(p.retreat, permitted), back * scaling.bandwidth)
        # the direction is reversed only at rest
        left, empty = rest - s, _EMPTY * scaling.resting / scaling.bandwidth
        override = where(
            goes_back,
            where(left <= empty, -backwards, 0.0),
            where(left >= -empty, override, 0.0),
        )
        passes = where(goes_back, -1.0, passes)
    return ca.Function(
        "decision", [*rows, clock, requested, now, passed], [override, permitted, passes]
    )


def _onwards(
    p: WatchParameters,
    scaling: StoppableScaling,
    samples: Samples,
    grid: tuple[int, float],
    rest: Any,
    requested: Any,
    passed: Any,
) -> tuple[Any, Any]:
    """Return the free motion time ahead [s], and whether the motion passes the obstacles."""
    behind, step = grid
    ahead, clear = samples.times - rest, p.margin + p.side
    reserve = where(passed > 0.0, 0.0, 2.0 * p.uncertainty / p.largest_speed)
    needed = ca.fmax(ahead, 0.0) / ca.fmax(requested, SLOWEST) + scaling.time_to_stop + reserve
    wait, free, passes = ca.inf, 1.0, 0.0
    for j in range(behind, samples.times.shape[1]):
        waits = samples.expected[j] >= clear
        free = all_of(free, samples.left[j] >= needed[j])
        passes = ca.fmax(passes, all_of(free, waits, ahead[j] >= 0.0))
        blocked = all_of(ca.logic_not(waits), ahead[j] > -step)
        wait = where(blocked, ca.fmin(wait, ahead[j] - step), wait)
    return where(passes, ca.inf, ca.fmax(wait, 0.0)), passes


def _backwards(
    p: WatchParameters, samples: Samples, grid: tuple[int, float], rest: Any, passed: Any
) -> Any:
    """Return the motion time back to where the motion can wait, or has most time left [s].

    It is 0 if the motion can wait here, or if there is no such sample behind.
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
        distance, left = rest - samples.times[j], samples.left[j]
        waits = all_of(distance > 0.0, samples.expected[j] >= clear)
        back = where(waits, ca.fmin(back, distance), back)
        better = all_of(distance > 0.0, left > most)
        most, longest = where(better, left, most), where(better, distance, longest)
    threatened = here < where(goes_back, clear, p.margin)
    return where(threatened, where(back < ca.inf, back, longest), 0.0)
