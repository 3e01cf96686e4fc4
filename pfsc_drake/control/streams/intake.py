"""Intake of waypoints: a path that grows while the tool moves, on which it can always stop."""

from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import first_of, is_finite, where
from pfsc_drake.control.streams.acceptance import (
    ENDED,
    ENDING,
    GROWING,
    RESTING,
    Acceptance,
    Counts,
    Offer,
)
from pfsc_drake.control.streams.growing_path import POSE, GrowingPath, pick
from pfsc_drake.control.streams.growth import Growth, choose, no_direction
from pfsc_drake.control.streams.messages import StreamStatus, WaypointLayout
from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.errors import require
from pfsc_drake.geometry.manifold_point import PathPointLayout

# number of spans behind the tool that are retained
_BEHIND = 4.0
# m, m/s, m/s^2: the reference rests below these
_AT_REST = (1e-6, 1e-5, 1e-3)
# s: longest time during which messages may arrive out of order
_OVERTAKEN = 0.05


class WaypointIntake(Block):
    """Converts waypoints into a path, one control point per tick.

    Waypoints w become control points of a B-spline of degree r + 2, see
    :class:`~pfsc_drake.geometry.paths.uniform_spline.UniformSpline`, which is of class C^(r + 1).
    A control point adds a span at the end and changes no earlier one, so the path that the tool may
    follow never changes. The path consists of *pieces*: where it would bend more sharply than the
    least radius, where no more waypoints arrive, and where one is missed or refused, a piece ends
    straight at the previous waypoint. The tool comes to rest there, and the next piece begins there
    in any direction. A waypoint is accepted only if the piece that would end there bends gently
    enough: so the piece can always be ended at the accepted waypoints.

    The free path ends with the last span that no later waypoint changes, or at the end of the
    piece. A waypoint that begins a new path removes all control points but those that determine the
    path up to the reference's stopping point: the spline blends from the old path to the new one,
    in class C^(r + 1), while the tool moves.

    Ports:
        waypoints (input): Message laid out by :class:`WaypointLayout`.
        manifold_point (input): Path point closest to the tool; only theta is used.
        motion (input): Derivatives of the reference's arc length, shape (n + 1,).
        stop (input): Arc length at which the reference can stop [m], shape (1,).
        path (output): The path, laid out by :class:`GrowingPath`.
        goal (output): Arc length at which the free path ends [m], shape (1,).
        stretches (output): Arc lengths at which spans begin and the last one ends [m].
        stretch_speeds (output): Largest speeds on the spans [m/s].
        stream (output): ``[status, taken, distance left, largest speed]``, shape (4,): a
            :class:`StreamStatus`, the number of waypoints taken or skipped, the length of the free
            path ahead [m], and the largest speed at the reference [m/s].

    State:
        path: The path. older, newest: The last two waypoints taken, shape (d,); the newest one is
        not a control point yet. fresh: Waypoints of a new piece. counts: ``[phase, number in fresh,
        received ones in fresh, number of the last received control point, taken, number of the
        waypoint that last began a path, ticks without waypoints, total received, reason, largest
        total, ticks since the total decreased]``.
        rest: End of the last piece, ``[goal, pose]``.

    Args:
        path: Layout of the path.
        parameters: Parameters of the stream.
        layout: Layout of the messages.
        highest: Order n of the highest derivative of the reference.
        period: Sampling time [s].
        at_rest: Rest pose of the tool at the start: position [m], with a quaternion if waypoints
            have one, shape (d,).
        direction: Direction of the path before the first waypoint, any length, shape (3,).

    Raises:
        InputError: If sizes are inconsistent, or the direction is zero.
    """

    def __init__(
        self,
        path: GrowingPath,
        parameters: StreamParameters,
        layout: WaypointLayout,
        highest: int,
        period: float,
        *,
        at_rest: ArrayLike,
        direction: ArrayLike = (1.0, 0.0, 0.0),
    ) -> None:
        self._path, self._parameters, self._layout = path, parameters, layout
        self._growth, self._highest = Growth(path, parameters), highest
        self._patience = round(parameters.patience / period)
        self._overtaken = max(1, round(_OVERTAKEN / period))
        self._begin, along = np.asarray(at_rest, dtype=float), np.asarray(direction, dtype=float)
        d, r = path.dimension, path.order
        require(layout.dimension == d, "dimension of messages", layout.dimension, f"{d}")
        require(self._begin.shape == (d,), "at_rest", self._begin.tolist(), f"{d} numbers")
        require(not no_direction(along), "direction", along.tolist(), "a vector with a direction")
        self._direction = along / np.linalg.norm(along)
        self._acceptance = Acceptance(path, parameters, layout, self._growth)
        self._fresh = self._acceptance.needed
        self.inputs = {
            "waypoints": Port(layout.size, "1, m"),
            "manifold_point": Port(PathPointLayout(r, d == POSE).size),
            "motion": Port(highest + 1, "m, m/s, .."),
            "stop": Port(1, "m"),
        }
        self.outputs = {
            "path": Port(path.size),
            "goal": Port(1, "m"),
            "stretches": Port(path.spans + 1, "m"),
            "stretch_speeds": Port(path.spans, "m/s"),
            "stream": Port(4, "1, 1, m, m/s"),
        }
        self.states = {
            "path": path.size,
            "older": d,
            "newest": d,
            "fresh": d * self._fresh,
            "counts": len(Counts._fields),
            "rest": 1 + d,
        }

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        straight = self._growth.straight(self._begin, self._direction, self._parameters.spacing)
        pose = ca.DM(self._begin)
        return {
            "path": ca.vertcat(*straight.values()),
            "older": pose,
            "newest": pose,
            "rest": ca.vertcat(0.0, pose),
        }

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        known, counts = self._path.split(x.path), Counts.of(x.counts)
        has_no_end = ca.logic_or(counts.phase == GROWING, counts.phase == ENDING)
        goal = where(has_no_end, known["eta"][-1], x.rest[0])
        rests = counts.phase == RESTING
        running = where(rests, float(StreamStatus.WAITING), float(StreamStatus.RUNNING))
        status = where(counts.reason > 0.0, counts.reason, running)
        eta = u.motion[0]
        span = ca.fmin(ca.fmax(ca.sum1(known["eta"] <= eta) - 1.0, 0.0), self._path.spans - 1.0)
        status_row = ca.vertcat(status, counts.taken, goal - eta, pick(known["speed"], span))
        return {
            "path": x.path,
            "goal": goal,
            "stretches": known["eta"],
            "stretch_speeds": known["speed"],
            "stream": status_row,
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        counts, total = Counts.of(x.counts), u.waypoints[0]
        total = where(is_finite(total), total, counts.heard)
        behind = where(total < counts.most, counts.behind + 1.0, 0.0)
        restarts = behind > self._overtaken
        # a sender that restarts its count sends other waypoints
        now = counts._replace(
            heard=total,
            taken=where(restarts, 0.0, counts.taken),
            path_begin=where(restarts, 0.0, counts.path_begin),
            reason=where(restarts, float(StreamStatus.BEGUN_ANEW), counts.reason),
            most=where(restarts, total, ca.fmax(total, counts.most)),
            behind=where(restarts, 0.0, behind),
            silence=where(total != counts.heard, 0.0, counts.silence + 1.0),
        )
        counts, silence = now, now.silence
        waiting = total - counts.taken
        runs_dry = ca.logic_or(silence > self._patience, u.waypoints[1] == 1.0)
        has_space = u.manifold_point[0] - x.path[0] >= _BEHIND + 1.0
        ready = ca.logic_and(waiting > 0.0, ca.logic_or(has_space, self._is_urgent(now, u)))
        dries = ca.logic_and(runs_dry, waiting <= 1.0)
        grows = ca.logic_and(counts.phase == GROWING, ca.logic_or(dries, ready))
        some = ca.logic_or(waiting > 0.0, counts.fresh > 0.0)
        begins = ca.logic_and(counts.phase == RESTING, some)
        acts = ca.logic_or(ca.logic_or(grows, begins), counts.phase >= ENDING)
        acts = ca.logic_or(acts, restarts)
        states = [x.path, x.older, x.newest, x.fresh, ca.vertcat(*now), x.rest]
        inputs = [u.waypoints, u.motion[: self._num_derivatives], u.stop, has_space, runs_dry]
        after = self._if_active(acts, *states, *inputs)
        return dict(zip(self.states, after, strict=True))

    @property
    def _num_derivatives(self) -> int:
        """Number of derivatives, with the arc length, by which rest is detected."""
        return min(len(_AT_REST), self._highest + 1)

    def _is_urgent(self, counts: Counts, u: Values) -> Any:
        """Return whether the next waypoint begins a new path, or has been missed."""
        row, missed = self._acceptance.row(u.waypoints, counts)
        new = ca.logic_and(row[-1] == 1.0, counts.path_begin != counts.taken + 1.0)
        return ca.logic_or(missed, new)

    @cached_property
    def _if_active(self) -> ca.Function:
        """Function ``(acts, states, inputs) -> states``, which advances the states if ``acts``."""
        sizes = [*self.states.values(), self._layout.size, self._num_derivatives, 1, 1, 1]
        arguments = [ca.MX.sym(f"a{k}", size) for k, size in enumerate(sizes)]
        states = arguments[: len(self.states)]
        x = Values(**dict(zip(self.states, states, strict=True)))
        after = self._advance(x, *arguments[len(self.states) :])
        results = [ca.densify(after[name]) for name in self.states]
        acts = ca.Function("intake_acts", arguments, results)
        stays = ca.Function("intake_stays", arguments, states)
        return ca.Function.if_else("intake", acts, stays)

    def _advance(
        self, x: Values, message: Any, motion: Any, stop: Any, has_space: Any, runs_dry: Any
    ) -> dict[str, Any]:
        """Return the advanced states."""
        known, growth, counts = self._path.split(x.path), self._growth, Counts.of(x.counts)
        offer = self._acceptance.offer(x, known, message, has_space, runs_dry)
        rests, grows = counts.phase == RESTING, counts.phase == GROWING
        enough = ca.logic_or(grows, counts.fresh > 0.0)
        dries = ca.logic_and(offer.dry, enough)
        reason = first_of(
            (offer.missed, float(StreamStatus.MISSED)),
            (offer.new, 0.0),
            (offer.refused, float(StreamStatus.REFUSED)),
            (offer.sharp, float(StreamStatus.TURNING)),
            (dries, float(StreamStatus.ENDING)),
            otherwise=counts.reason,
        )
        taken = where(offer.missed, counts.heard - self._layout.length, counts.taken + offer.passed)
        path_begin = where(offer.new, counts.taken + 1.0, counts.path_begin)

        # one more control point, from a waypoint or beyond the end
        ends = ca.logic_and(counts.phase == ENDING, ca.logic_not(offer.new))
        longer = ca.logic_and(grows, offer.accepted)
        beside = growth.control(x.older, x.newest, offer.waypoint)
        further = known["first"] + self._path.columns - counts.last
        control = where(ends, growth.mirror(known, x.newest, further), beside)
        appended = growth.append(known, control)
        path = choose(ca.logic_or(longer, ends), appended, known)
        older, newest = where(longer, x.newest, x.older), where(longer, offer.waypoint, x.newest)
        beyond = path["first"] + self._path.columns
        last = where(longer, beyond, counts.last)
        has_end = ca.logic_and(ends, beyond - 1.0 >= last + self._path.spline.reach)
        pose, eta = growth.end(path)
        rest = where(has_end, ca.vertcat(eta, pose), x.rest)

        # fewer control points, where a new path begins
        cuts = ca.logic_and(offer.new, ca.logic_not(rests))
        cut, after_cut, gone = growth.cut_back(known, stop)
        shorter = ca.logic_and(cuts, gone >= 1.0)
        path = choose(shorter, cut, path)
        before, tip = growth.among(path, 2)
        older = where(ca.logic_or(shorter, ca.logic_and(cuts, ca.logic_not(grows))), tip, older)
        resumed = where(grows, x.newest, 2.0 * tip - before)
        newest = where(cuts, where(shorter, after_cut, resumed), newest)
        last = where(cuts, path["first"] + self._path.columns, last)

        # a new piece at the end of the last one
        fresh, count, real = self._fill_fresh(x, counts, offer, reason)
        starts = ca.logic_and(rests, counts.fresh == self._fresh)
        waypoints = [x.rest[1:], *ca.vertsplit(x.fresh, self._path.dimension)]
        begins = growth.begin_piece(known, self._acceptance.controls(waypoints), x.rest[0])
        path = choose(starts, begins, path)
        older, newest = where(starts, waypoints[-2], older), where(starts, waypoints[-1], newest)
        begin = path["first"] + self._path.columns - 1.0 - self._path.spline.reach
        last = where(starts, begin + counts.real, last)
        is_still = ca.logic_and(counts.phase == ENDED, self._is_at_rest(motion, x.rest[0]))

        whole = ca.logic_and(starts, reason == 0.0)
        phase = first_of(
            (ca.logic_or(cuts, whole), GROWING),
            (ca.logic_or(starts, ca.logic_and(grows, reason > 0.0)), ENDING),
            (has_end, ENDED),
            (is_still, RESTING),
            otherwise=counts.phase,
        )
        over = ca.logic_and(is_still, reason < StreamStatus.MISSED)
        reason = where(over, 0.0, reason)
        none = ca.logic_or(ca.logic_or(starts, is_still), offer.new)
        count, real = where(none, 0.0, count), where(none, 0.0, real)
        new_counts = counts._replace(
            phase=phase,
            fresh=count,
            real=real,
            last=last,
            taken=taken,
            path_begin=path_begin,
            reason=reason,
        )
        return {
            "path": ca.vertcat(*path.values()),
            "older": older,
            "newest": newest,
            "fresh": fresh,
            "counts": ca.vertcat(*new_counts),
            "rest": rest,
        }

    def _fill_fresh(
        self, x: Values, counts: Counts, offer: Offer, reason: Any
    ) -> tuple[Any, Any, Any]:
        """Return the waypoints of a new piece, their number, and the number of received ones."""
        d, rests = self._path.dimension, counts.phase == RESTING
        taken = ca.logic_and(rests, offer.accepted)
        some = ca.logic_and(counts.fresh > 0.0, counts.fresh < self._fresh)
        filled = ca.logic_and(ca.logic_and(rests, reason > 0.0), some)
        point = where(taken, offer.waypoint, self._acceptance.beyond(x, counts))
        more = ca.logic_or(taken, filled)
        rows = [
            where(ca.logic_and(more, counts.fresh == k), point, row)
            for k, row in enumerate(ca.vertsplit(x.fresh, d))
        ]
        return ca.vertcat(*rows), counts.fresh + more, counts.real + taken

    def _is_at_rest(self, motion: Any, goal: Any) -> Any:
        """Return whether the reference rests at the goal."""
        off = ca.fabs(motion - ca.vertcat(goal, ca.DM.zeros(motion.size1() - 1)))
        return ca.sum1(off > ca.DM(_AT_REST[: motion.size1()])) == 0.0
