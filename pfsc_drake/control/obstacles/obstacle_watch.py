"""The pace of a motion that waits for obstacles on its way."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.obstacles.clearance import (
    Foresight,
    foresight_function,
    nearness_function,
)
from pfsc_drake.control.obstacles.decision import SLOWEST, decision_function
from pfsc_drake.control.obstacles.reach import Reach
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.outline import ArmOutline, outline_points

# steps into which the horizon is divided, and how many of them it looks back where it may go back
STEPS, _BACK = 48, 24


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

    Samples j of the motion are ``s_j`` of its own time, from where it is on; the arm is expected
    there as it is planned, shifted by as much as it is beside the plan now. Of each there is the
    time ``t_j`` until an obstacle may be at the margin m and what is not known of it, see
    :class:`~pfsc_drake.control.obstacles.reach.Reach`, and the least distance ``e_j`` from where
    obstacles are expected from its arrival on:

        b_j = t_j - latency - T

    The distance that is spent beside the margin is the uncertainty, and half of the longest step
    of a point from sample to sample. With ``rest`` as :class:`WaitingPace` says:

    - **Waiting pace.** ``|w| <= W`` of the least b_j between the tool and ``rest``: whatever
      obstacles do, the arm rests before one of them is nearer than the margin.
    - **Waiting place.** Samples at which ``e_j < m + side`` are none to wait at. ``rest`` stays
      before them.
    - **Passing.** It need not wait where there is a place to wait at ahead, and the way until then
      is free whatever obstacles do, ``b_j >= (s_j - rest) / w + time_to_stop``. Not to set off for
      what noise takes back, twice the uncertainty must be left besides.
    - **Retreat.** With ``retreat``, it goes back from where somebody is expected within the margin
      to the next place to wait at behind, or, if there is none, to where the largest b_j is.
      It turns where it rests.

    If something measured is no number, it stops.

    Ports:
        clock (input): Of a :class:`WaitingReference`, shape (r + 2,).
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        obstacles (input): Position and velocity of K obstacles as measured, shape (6K,)
            [m, m/s].
        asked (input, optional): Pace that is asked for, shape (1,), limited to 0 .. 1; 1 if not
            connected.
        override (output): Pace that the motion may have, shape (1,).
        record (output): Least distance as seen of the arm as it is [m], ``W`` of the least b, and
            1 if it passes, -1 if it goes back, shape (3,).

    State:
        velocity: Smoothed velocities, shape (3K,). passing: Whether it passed or went back.

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
        self._behind = _BACK if p.retreat else 0
        self._samples = self._behind + STEPS + 1
        self._until = p.latency + period
        points, radius = ahead.points.shape[1] // 3, ahead.outline.radius
        reach = Reach(p.largest_speed, p.largest_acceleration, p.velocity_uncertainty)
        spent = p.margin + p.uncertainty + ahead.between
        self._near = nearness_function(shapes, reach, spent, points, radius)
        foresight = Foresight(p.latency, p.horizon, p.spread)
        self._expected = foresight_function(shapes, foresight, points, radius)
        self._decide = decision_function(p, pace, ahead.step, self._behind, self._samples)
        self._kept, self._count = math.exp(-period / p.smoothing), len(shapes)
        self.inputs = {
            "clock": Port(pace.order + 2, "s, 1, s, 1, .."),
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "obstacles": Port(6 * self._count, "m, m/s"),
            "asked": Port(1, optional=True),
        }
        self.outputs = {"override": Port(1), "record": Port(3, "m, 1, 1")}
        self.states = {"velocity": 3 * self._count, "passing": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        velocity = ca.vertcat(*[o[3:] for o in ca.vertsplit(u.obstacles, 6)])
        return {"velocity": where(all_finite(u.obstacles), velocity, 0.0)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        s, rest = u.clock[0], u.clock[2]
        known = all_finite(u.obstacles, u.joint_state)
        measured = where(known, u.obstacles, 0.0)
        arm = self._outline(where(known, u.joint_state[: self._n], 0.0))
        asked = 1.0 if u.asked is None else where(u.asked > 0.0, ca.fmin(u.asked, 1.0), 0.0)
        times, points = self._places(s, arm)
        _, until = self._near.map(self._samples)(points, self._each(measured))
        way = times - rest
        arrives = ca.fmax(way, 0.0) / ca.fmax(asked, SLOWEST)
        if self._behind:
            arrives += ca.fmax(-way, 0.0) / self._parameters.retreat
        foreseen = self._each(where(known, self._smoothed(x, u), 0.0))
        expected = self._expected.map(self._samples)(points, foreseen, arrives + self._pace.lag)
        now, until_now = self._near(arm, measured)
        override, permitted, passing = self._decide(
            until - self._until,
            expected,
            times,
            u.clock,
            asked,
            until_now - self._until,
            # without uncertainty, setting off needs no more than going on
            x.passing if self._parameters.uncertainty > 0.0 or self._behind else 0.0,
        )
        seen, passing = where(known, now, ca.DM.nan(1)), where(known, passing, 0.0)
        return {
            "override": where(known, override, 0.0),
            "record": ca.vertcat(seen, permitted, passing),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        obstacles = ca.vertsplit(self._smoothed(x, u), 6)
        velocity = ca.vertcat(*[obstacle[3:] for obstacle in obstacles])
        return {
            "velocity": where(all_finite(u.obstacles), velocity, x.velocity),
            "passing": y.record[2],
        }

    def _places(self, s: Any, arm: Any) -> tuple[Any, Any]:
        """Return own times of all samples, by columns, and where the outline will be there."""
        ahead = self._ahead
        place = ca.fmin(ca.fmax((s - ahead.begin) / ahead.step, 0.0), self._last)
        first = ca.floor(place)
        columns = [
            ca.fmin(ca.fmax(first + j, 0.0), self._last) for j in range(-self._behind, STEPS + 1)
        ]
        points = ca.horzcat(*[self._table[:, column] for column in columns])
        here, after = points[:, self._behind], points[:, self._behind + 1]
        planned = here + (place - first) * (after - here)
        times = ahead.begin + ahead.step * ca.horzcat(*columns)
        return times, points + ca.repmat(arm - planned, 1, self._samples)

    def _each(self, obstacles: Any) -> Any:
        return ca.repmat(obstacles, 1, self._samples)

    def _smoothed(self, x: Values, u: Values) -> Any:
        """Return the obstacles with smoothed velocities, shape (6K,)."""
        parts = []
        for obstacle, v in zip(
            ca.vertsplit(u.obstacles, 6), ca.vertsplit(x.velocity, 3), strict=True
        ):
            parts += [obstacle[:3], obstacle[3:] + self._kept * (v - obstacle[3:])]
        return ca.vertcat(*parts)
