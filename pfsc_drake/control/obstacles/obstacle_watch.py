"""The pace of a motion that waits for obstacles on its way."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, where
from pfsc_drake.control.obstacles.clearance import Foresight, ObstacleShape, clearance_function
from pfsc_drake.control.obstacles.parameters import WatchParameters
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.outline import ArmOutline, outline_points

# steps into which the horizon is divided
STEPS = 48
# of the planned pace, below which nobody asks for less than a pause
_SLOWEST = 0.05


@dataclass(frozen=True)
class ArmAhead:
    """Where an arm will be along its motion.

    Attributes:
        chain: The arm as it is believed.
        outline: Its outline, P points.
        begin: Own time of the first sample [s].
        step: From sample to sample [s].
        points: Places of the outline's points [m], shape (samples, 3P).
    """

    chain: SerialChain
    outline: ArmOutline
    begin: float
    step: float
    points: np.ndarray
    between: float = field(init=False)

    def __post_init__(self) -> None:
        steps = np.diff(self.points, axis=0).reshape(-1, self.points.shape[1] // 3, 3)
        largest = float(np.linalg.norm(steps, axis=2).max(initial=0.0))
        object.__setattr__(self, "between", largest / 2.0)


class ObstacleWatch(Block):
    """Says how fast a motion may go on, so that its arm rests before an obstacle is near.

    Samples j of the motion ahead are ``s_j`` of its own time, from where it is on; the arm is
    expected there as it is planned, shifted by as much as it is beside the plan now. Of each there
    is the distance ``c_j`` from the obstacles as measured, and the least distance ``e_j`` from
    where they are expected from its arrival on, see :func:`clearance_function`. The time until an
    obstacle of the largest speed V could be at the margin m is

        b_j = (c_j - m - uncertainty - between) / V - latency - T,

    ``between`` being half of the longest step of a point from sample to sample. With ``rest`` as
    :class:`WaitingPace` says:

    - **Waiting pace.** ``w <= W(b_j)`` for all samples that are not behind ``rest``: whatever
      obstacles do, the arm rests before one of them is nearer than the margin.
    - **Waiting place.** Samples at which ``e_j < m + side`` are none to wait at. ``rest`` stays
      before them.
    - **Passing.** The motion goes on as asked for if there is a sample ahead at which it can wait,
      and the way until it has come to rest there is free however obstacles move:
      ``b_j >= (s_j - rest) / w + time_to_stop`` for all samples until then. This keeps being true
      by itself, so that what has set off gets through. To set off, twice the uncertainty must be
      left besides.

    If something measured is no number, it stops.

    Ports:
        clock (input): Of a :class:`PacedReference`, shape (3,).
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        obstacles (input): Position and velocity of K obstacles as measured, shape (6K,)
            [m, m/s].
        asked (input, optional): Pace that is asked for, shape (1,), limited to 0 .. 1; 1 if not
            connected.
        override (output): Pace that the motion may have, shape (1,).
        record (output): Least distance as seen of the arm as it is [m], ``W`` of the least b, and
            1 if it passes, shape (3,).

    State:
        velocity: Smoothed velocities, shape (3K,). passing: Whether it went on as asked for.

    Args:
        ahead: Where the arm will be.
        shapes: The obstacles.
        parameters: How it keeps away from them.
        pace: How it can be stopped.
        period: Sampling time T [s].

    Raises:
        InputError: If there is no obstacle.
    """

    expands = False  # tables

    def __init__(
        self,
        ahead: ArmAhead,
        shapes: Sequence[ObstacleShape],
        parameters: WatchParameters,
        pace: WaitingPace,
        period: float,
    ) -> None:
        if not shapes:
            raise InputError("obstacles: none; at least one is needed to watch")
        p, n = parameters, ahead.chain.dimension
        self._pace, self._ahead, self._parameters, self._n = pace, ahead, p, n
        self._outline = outline_points(ahead.chain, ahead.outline)
        self._table, self._last = ca.MX(ca.DM(ahead.points.T)), len(ahead.points) - 1
        self._count = len(shapes)
        foresight = Foresight(p.latency, p.horizon, p.spread)
        size = ahead.points.shape[1]
        clearance = clearance_function(shapes, foresight, size // 3, ahead.outline.radius)
        self._clearances = clearance.map(STEPS + 1)
        self._now = clearance
        self._decide = _decision(p, pace, ahead.step, ahead.between, period)
        self._kept = math.exp(-period / p.smoothing)
        self.inputs = {
            "clock": Port(3, "s, 1, s"),
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "obstacles": Port(6 * self._count, "m, m/s"),
            "asked": Port(1, optional=True),
        }
        self.outputs = {"override": Port(1), "record": Port(3, "m, 1, 1")}
        self.states = {"velocity": 3 * self._count, "passing": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"velocity": ca.vertcat(*[o[3:] for o in ca.vertsplit(u.obstacles, 6)])}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        s, _, rest = ca.vertsplit(u.clock)
        known = all_finite(u.obstacles, u.joint_state)
        obstacles = where(known, self._smoothed(x, u), 0.0)
        arm = self._outline(where(known, u.joint_state[: self._n], 0.0))
        place = ca.fmin(ca.fmax((s - self._ahead.begin) / self._ahead.step, 0.0), self._last)
        first = ca.floor(place)
        columns = [ca.fmin(first + j, self._last) for j in range(STEPS + 1)]
        points = ca.horzcat(*[self._table[:, column] for column in columns])
        planned = points[:, 0] + (place - first) * (points[:, 1] - points[:, 0])
        asked = 1.0 if u.asked is None else where(u.asked > 0.0, ca.fmin(u.asked, 1.0), 0.0)
        times = self._ahead.begin + self._ahead.step * ca.horzcat(*columns)
        way = ca.fmax(times - rest, 0.0) / ca.fmax(asked, _SLOWEST)
        near, expected = self._clearances(
            points + ca.repmat(arm - planned, 1, STEPS + 1),
            ca.repmat(obstacles, 1, STEPS + 1),
            way + self._pace.lag,
        )
        now, _ = self._now(arm, obstacles, 0.0)
        # without uncertainty, setting off needs no more than going on
        passed = x.passing if self._parameters.uncertainty > 0.0 else 0.0
        override, permitted, passing = self._decide(near, expected, times, rest, asked, now, passed)
        return {
            "override": where(known, override, 0.0),
            "record": ca.vertcat(
                where(known, now, ca.DM.nan(1)), permitted, all_of(known, passing)
            ),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        obstacles = ca.vertsplit(self._smoothed(x, u), 6)
        velocity = ca.vertcat(*[obstacle[3:] for obstacle in obstacles])
        return {
            "velocity": where(all_finite(u.obstacles), velocity, x.velocity),
            "passing": y.record[2],
        }

    def _smoothed(self, x: Values, u: Values) -> Any:
        """Return the obstacles with smoothed velocities, shape (6K,)."""
        parts = []
        for obstacle, v in zip(
            ca.vertsplit(u.obstacles, 6), ca.vertsplit(x.velocity, 3), strict=True
        ):
            parts += [obstacle[:3], obstacle[3:] + self._kept * (v - obstacle[3:])]
        return ca.vertcat(*parts)


def _decision(
    parameters: WatchParameters, pace: WaitingPace, step: float, between: float, period: float
) -> ca.Function:
    """Return what decides over the pace, see :class:`ObstacleWatch`.

    It is ``(near, expected, times, rest, asked, now, passed) -> (override, permitted, passes)``;
    the first three are rows of all samples.
    """
    p = parameters
    near, expected, times = (
        ca.SX.sym(name, 1, STEPS + 1) for name in ("near", "expected", "times")
    )
    rest, asked, now, passed = (ca.SX.sym(name) for name in ("rest", "asked", "now", "passed"))

    def until(distance: Any) -> Any:
        spent = p.margin + p.uncertainty + between
        return (distance - spent) / p.largest_speed - p.latency - period

    left, way, wait = until(near), times - rest, ca.inf
    least, free, passes = until(now), 1.0, 0.0
    reserve = where(passed, 0.0, 2.0 * p.uncertainty / p.largest_speed)
    slowed = ca.fmax(asked, _SLOWEST)
    for j in range(STEPS + 1):
        least = where(way[j] <= step, ca.fmin(least, left[j]), least)
        time = where(way[j] > 0.0, way[j] / slowed, way[j]) + pace.time_to_stop
        free = all_of(free, left[j] - reserve >= time)
        waits = expected[j] >= p.margin + p.side
        passes = ca.fmax(passes, all_of(free, waits, way[j] >= 0.0))
        blocked = all_of(ca.logic_not(waits), way[j] > -step)
        wait = where(blocked, ca.fmin(wait, way[j] - step), wait)
    permitted = pace.permitted(least)
    held = ca.fmin(permitted, ca.fmax(wait, 0.0) * pace.bandwidth)
    override = where(passes, asked, ca.fmin(asked, held))
    return ca.Function(
        "decision",
        [near, expected, times, rest, asked, now, passed],
        [override, permitted, passes],
    )
