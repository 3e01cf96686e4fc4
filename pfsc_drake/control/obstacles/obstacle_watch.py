"""Speed scaling of a motion that waits for obstacles."""

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
from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.outline import ArmOutline, outline_points

# samples ahead within the horizon, and samples behind if the motion may retreat
STEPS, _BACK = 48, 24


@dataclass(frozen=True)
class ArmAhead:
    """Planned positions of an arm along its motion.

    Attributes:
        chain: Nominal model of the arm.
        outline: Outline of the arm, P points.
        begin: Motion time of the first sample [s].
        step: Step from sample to sample [s].
        points: Positions of the outline's points [m], shape (samples, 3P).
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
    """Limits the speed of a motion so that the arm is at rest before an obstacle is near.

    Samples j of the motion are at the motion times ``s_j`` from the present one on. The arm is
    predicted there as planned, shifted by its present deviation from the plan. Each sample has the
    time ``t_j`` until an obstacle can be nearer than the margin m plus uncertainties, see
    :class:`~pfsc_drake.control.obstacles.reach.Reach`, and the least distance ``e_j`` from the
    predicted obstacles from the arm's arrival on:

        b_j = t_j - latency - T

    The distance in addition to the margin is the uncertainty, plus half of the longest step of a
    point from sample to sample. With ``rest`` as in :class:`StoppableScaling`:

    - **Scaling limit.** ``|w| <= W`` of the least b_j between the tool and ``rest``: for any motion
      of the obstacles the arm is at rest before one of them is nearer than the margin.
    - **Waiting.** Samples with ``e_j < m + side`` are unsuitable for waiting. ``rest`` stays before
      them.
    - **Passing.** The motion need not wait if a suitable sample is ahead, and the path up to it is
      free for any motion of the obstacles, ``b_j >= (s_j - rest) / w + time_to_stop``. A start
      needs a distance of twice the uncertainty in addition, so that noise does not revoke it.
    - **Retreat.** With ``retreat``, the motion goes back from where an obstacle is predicted within
      the margin to the next suitable sample behind, or, if there is none, to the largest b_j. It
      reverses only at rest.

    NaN or infinite measurements stop the motion.

    Ports:
        clock (input): Clock of a :class:`WaitingReference`, shape (r + 2,).
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        obstacles (input): Position and velocity of K obstacles as measured, shape (6K,)
            [m, m/s].
        requested (input, optional): Requested speed scaling, shape (1,), limited to 0 .. 1; 1 if
            not connected.
        override (output): Allowed speed scaling, shape (1,).
        record (output): Least distance of the arm from the measured obstacles [m], ``W`` of the
            least b, and 1 if the motion passes, -1 if it goes back, shape (3,).

    State:
        velocity: Smoothed velocities, shape (3K,). passing: 1 if the motion passed, -1 if it went
        back.

    Args:
        ahead: Planned positions of the arm.
        shapes: The obstacles.
        parameters: Parameters of the watch.
        scaling: Speed scaling that can be stopped.
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
        scaling: StoppableScaling,
        period: float,
    ) -> None:
        if not shapes:
            raise InputError("obstacles: none; at least one is needed to watch")
        p, n = parameters, ahead.chain.dimension
        self._scaling, self._ahead, self._parameters, self._n = scaling, ahead, p, n
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
        self._decide = decision_function(p, scaling, ahead.step, self._behind, self._samples)
        self._decay, self._count = math.exp(-period / p.smoothing), len(shapes)
        self.inputs = {
            "clock": Port(scaling.order + 2, "s, 1, s, 1, .."),
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "obstacles": Port(6 * self._count, "m, m/s"),
            "requested": Port(1, optional=True),
        }
        self.outputs = {"override": Port(1), "record": Port(3, "m, 1, 1")}
        self.states = {"velocity": 3 * self._count, "passing": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        velocity = ca.vertcat(*[o[3:] for o in ca.vertsplit(u.obstacles, 6)])
        return {"velocity": where(all_finite(u.obstacles), velocity, 0.0)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        s, rest = u.clock[0], u.clock[2]
        known = all_finite(u.obstacles, u.joint_state)
        measured = where(known, u.obstacles, 0.0)
        arm = self._outline(where(known, u.joint_state[: self._n], 0.0))
        requested = (
            1.0 if u.requested is None else where(u.requested > 0.0, ca.fmin(u.requested, 1.0), 0.0)
        )
        times, points = self._samples_ahead(s, arm)
        _, until = self._near.map(self._samples)(points, self._each(measured))
        to_go = times - rest
        arrives = ca.fmax(to_go, 0.0) / ca.fmax(requested, SLOWEST)
        if self._behind:
            arrives += ca.fmax(-to_go, 0.0) / self._parameters.retreat
        foreseen = self._each(where(known, self._smooth_velocities(x, u), 0.0))
        expected = self._expected.map(self._samples)(points, foreseen, arrives + self._scaling.lag)
        now, until_now = self._near(arm, measured)
        override, permitted, passing = self._decide(
            until - self._until,
            expected,
            times,
            u.clock,
            requested,
            until_now - self._until,
            # without uncertainty, a start needs no additional distance
            x.passing if self._parameters.uncertainty > 0.0 or self._behind else 0.0,
        )
        nearest, passing = where(known, now, ca.DM.nan(1)), where(known, passing, 0.0)
        return {
            "override": where(known, override, 0.0),
            "record": ca.vertcat(nearest, permitted, passing),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        obstacles = ca.vertsplit(self._smooth_velocities(x, u), 6)
        velocity = ca.vertcat(*[obstacle[3:] for obstacle in obstacles])
        return {
            "velocity": where(all_finite(u.obstacles), velocity, x.velocity),
            "passing": y.record[2],
        }

    def _samples_ahead(self, s: Any, arm: Any) -> tuple[Any, Any]:
        """Return motion times and predicted outlines of all samples, by columns."""
        ahead = self._ahead
        position = ca.fmin(ca.fmax((s - ahead.begin) / ahead.step, 0.0), self._last)
        first = ca.floor(position)
        columns = [
            ca.fmin(ca.fmax(first + j, 0.0), self._last) for j in range(-self._behind, STEPS + 1)
        ]
        points = ca.horzcat(*[self._table[:, column] for column in columns])
        here, after = points[:, self._behind], points[:, self._behind + 1]
        planned = here + (position - first) * (after - here)
        times = ahead.begin + ahead.step * ca.horzcat(*columns)
        return times, points + ca.repmat(arm - planned, 1, self._samples)

    def _each(self, obstacles: Any) -> Any:
        return ca.repmat(obstacles, 1, self._samples)

    def _smooth_velocities(self, x: Values, u: Values) -> Any:
        """Return the obstacles with smoothed velocities, shape (6K,)."""
        parts = []
        for obstacle, v in zip(
            ca.vertsplit(u.obstacles, 6), ca.vertsplit(x.velocity, 3), strict=True
        ):
            parts += [obstacle[:3], obstacle[3:] + self._decay * (v - obstacle[3:])]
        return ca.vertcat(*parts)
