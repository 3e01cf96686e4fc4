"""Way points that come while the tool moves become a path that it can always stop on."""

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
from pfsc_drake.control.streams.growth import Growth, chosen, no_direction
from pfsc_drake.control.streams.messages import StreamStatus, WaypointLayout
from pfsc_drake.control.streams.stream_course import POSE, Course, picked
from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.errors import require
from pfsc_drake.geometry.manifold_point import PathPointLayout

# spans that stay behind the tool
_BEHIND = 4.0
# m, m/s, m/s^2: below which the reference rests
_AT_REST = (1e-6, 1e-5, 1e-3)
# s, for which a message that was overtaken may come instead of newer ones
_OVERTAKEN = 0.05


class WaypointIntake(Block):
    """Takes way points and makes a path of them, one control point a tick.

    Way points w become control points of a B-spline of degree r + 2, see
    :class:`~pfsc_drake.geometry.paths.uniform_spline.UniformSpline`, which is of class C^(r + 1).
    A control point adds a span at the end and changes none before, so what the tool may drive on
    never changes. The path goes in *pieces*: where it would bend more sharply than the least
    radius, where no more way points come, and where one is missed or refused, a piece ends at the
    way point before, straight on; the tool comes to rest there, and the next piece begins there,
    in whatever direction. A way point is accepted only if the piece that would end there bends
    gently enough: so the piece can always be ended with what has been accepted.

    The free way ends with the last span that no later way point changes; of a piece that has its
    end, there. A way point that begins a new path takes back all control points but those that
    decide over the path up to where the reference can stop: the spline goes over from the path
    before to the new one, in class C^(r + 1), while the tool moves.

    Ports:
        waypoints (input): Message laid out by :class:`WaypointLayout`.
        manifold_point (input): Point of the path next to the tool, of which theta is read.
        motion (input): Derivatives of the reference's arc length, shape (n + 1,).
        stop (input): Arc length at which the reference can stop [m], shape (1,).
        course (output): The path, laid out by :class:`Course`.
        goal (output): Arc length at which the free way ends [m], shape (1,).
        stretches (output): Arc lengths at which spans begin and the last one ends [m].
        stretch_speeds (output): Largest speeds on them [m/s].
        stream (output): ``[status, taken, way left, largest speed]``, shape (4,): a
            :class:`StreamStatus`, how many way points have been taken or left out, how far the free
            way goes on [m], and how fast the tool may go where its reference is [m/s].

    State:
        course: As told. older, newest: The last two way points taken, shape (d,); the newest one
        is no control point yet. fresh: Way points of a piece to begin. counts: ``[phase, in fresh,
        real ones in fresh, number of the last real control point, taken, number of the way point
        that last began a path, ticks without way points, how many there were, reason, the most that
        there were, ticks since there were fewer]``.
        rest: Where the last piece ended, ``[goal, pose]``.

    Args:
        course: Layout of the path.
        parameters: How way points become a path.
        layout: Layout of the messages.
        highest: Order n of the highest derivative of the reference.
        period: Sampling time [s].
        at_rest: Where the tool rests at the start: position [m], and quaternion where way points
            have one, shape (d,).
        direction: Of the path before the first way point, any length, shape (3,).

    Raises:
        InputError: If sizes do not go together, or the direction is none.
    """

    def __init__(
        self,
        course: Course,
        parameters: StreamParameters,
        layout: WaypointLayout,
        highest: int,
        period: float,
        *,
        at_rest: ArrayLike,
        direction: ArrayLike = (1.0, 0.0, 0.0),
    ) -> None:
        self._course, self._parameters, self._layout = course, parameters, layout
        self._growth, self._highest = Growth(course, parameters), highest
        self._patience = round(parameters.patience / period)
        self._overtaken = max(1, round(_OVERTAKEN / period))
        self._begin, along = np.asarray(at_rest, dtype=float), np.asarray(direction, dtype=float)
        d, r = course.dimension, course.order
        require(layout.dimension == d, "dimension of messages", layout.dimension, f"{d}")
        require(self._begin.shape == (d,), "at_rest", self._begin.tolist(), f"{d} numbers")
        require(not no_direction(along), "direction", along.tolist(), "a vector with a direction")
        self._direction = along / np.linalg.norm(along)
        self._acceptance = Acceptance(course, parameters, layout, self._growth)
        self._fresh = self._acceptance.needed
        self.inputs = {
            "waypoints": Port(layout.size, "1, m"),
            "manifold_point": Port(PathPointLayout(r, d == POSE).size),
            "motion": Port(highest + 1, "m, m/s, .."),
            "stop": Port(1, "m"),
        }
        self.outputs = {
            "course": Port(course.size),
            "goal": Port(1, "m"),
            "stretches": Port(course.spans + 1, "m"),
            "stretch_speeds": Port(course.spans, "m/s"),
            "stream": Port(4, "1, 1, m, m/s"),
        }
        self.states = {
            "course": course.size,
            "older": d,
            "newest": d,
            "fresh": d * self._fresh,
            "counts": len(Counts._fields),
            "rest": 1 + d,
        }

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        straight = self._growth.straight(self._begin, self._direction, self._parameters.spacing)
        pose = ca.DM(self._begin)
        return {
            "course": ca.vertcat(*straight.values()),
            "older": pose,
            "newest": pose,
            "rest": ca.vertcat(0.0, pose),
        }

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        known, counts = self._course.split(x.course), Counts.of(x.counts)
        has_no_end = ca.logic_or(counts.phase == GROWING, counts.phase == ENDING)
        goal = where(has_no_end, known["eta"][-1], x.rest[0])
        rests = counts.phase == RESTING
        running = where(rests, float(StreamStatus.WAITING), float(StreamStatus.RUNNING))
        status = where(counts.reason > 0.0, counts.reason, running)
        eta = u.motion[0]
        span = ca.fmin(ca.fmax(ca.sum1(known["eta"] <= eta) - 1.0, 0.0), self._course.spans - 1.0)
        told = ca.vertcat(status, counts.taken, goal - eta, picked(known["speed"], span))
        return {
            "course": x.course,
            "goal": goal,
            "stretches": known["eta"],
            "stretch_speeds": known["speed"],
            "stream": told,
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        counts, total = Counts.of(x.counts), u.waypoints[0]
        total = where(is_finite(total), total, counts.heard)
        behind = where(total < counts.most, counts.behind + 1.0, 0.0)
        anew = behind > self._overtaken
        # the way points of a sender that counts anew are others
        now = counts._replace(
            heard=total,
            taken=where(anew, 0.0, counts.taken),
            begun=where(anew, 0.0, counts.begun),
            reason=where(anew, float(StreamStatus.BEGUN_ANEW), counts.reason),
            most=where(anew, total, ca.fmax(total, counts.most)),
            behind=where(anew, 0.0, behind),
            silence=where(total != counts.heard, 0.0, counts.silence + 1.0),
        )
        counts, silence = now, now.silence
        waiting = total - counts.taken
        runs_dry = ca.logic_or(silence > self._patience, u.waypoints[1] == 1.0)
        room = u.manifold_point[0] - x.course[0] >= _BEHIND + 1.0
        ready = ca.logic_and(waiting > 0.0, ca.logic_or(room, self._is_urgent(now, u)))
        dries = ca.logic_and(runs_dry, waiting <= 1.0)
        grows = ca.logic_and(counts.phase == GROWING, ca.logic_or(dries, ready))
        some = ca.logic_or(waiting > 0.0, counts.fresh > 0.0)
        begins = ca.logic_and(counts.phase == RESTING, some)
        acts = ca.logic_or(ca.logic_or(grows, begins), counts.phase >= ENDING)
        acts = ca.logic_or(acts, anew)
        remembered = [x.course, x.older, x.newest, x.fresh, ca.vertcat(*now), x.rest]
        given = [u.waypoints, u.motion[: self._watched], u.stop, room, runs_dry]
        after = self._whether(acts, *remembered, *given)
        return dict(zip(self.states, after, strict=True))

    @property
    def _watched(self) -> int:
        """How many derivatives tell whether the reference rests, the arc length itself included."""
        return min(len(_AT_REST), self._highest + 1)

    def _is_urgent(self, counts: Counts, u: Values) -> Any:
        """Return whether the next way point begins a new path, or has been missed."""
        row, missed = self._acceptance.row(u.waypoints, counts)
        new = ca.logic_and(row[-1] == 1.0, counts.begun != counts.taken + 1.0)
        return ca.logic_or(missed, new)

    @cached_property
    def _whether(self) -> ca.Function:
        """``(acts, states, inputs) -> states``: what becomes of them if there is anything to do."""
        sizes = [*self.states.values(), self._layout.size, self._watched, 1, 1, 1]
        arguments = [ca.MX.sym(f"a{k}", size) for k, size in enumerate(sizes)]
        states = arguments[: len(self.states)]
        x = Values(**dict(zip(self.states, states, strict=True)))
        after = self._advanced(x, *arguments[len(self.states) :])
        results = [ca.densify(after[name]) for name in self.states]
        acts = ca.Function("intake_acts", arguments, results)
        stays = ca.Function("intake_stays", arguments, states)
        return ca.Function.if_else("intake", acts, stays)

    def _advanced(
        self, x: Values, message: Any, motion: Any, stop: Any, room: Any, runs_dry: Any
    ) -> dict[str, Any]:
        """Return the states after a tick at which there is something to do."""
        known, growth, counts = self._course.split(x.course), self._growth, Counts.of(x.counts)
        offer = self._acceptance.offer(x, known, message, room, runs_dry)
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
        begun = where(offer.new, counts.taken + 1.0, counts.begun)

        # one control point more, by a way point or straight on
        ends = ca.logic_and(counts.phase == ENDING, ca.logic_not(offer.new))
        longer = ca.logic_and(grows, offer.accepted)
        beside = growth.control(x.older, x.newest, offer.waypoint)
        further = known["first"] + self._course.columns - counts.last
        control = where(ends, growth.mirrored(known, x.newest, further), beside)
        appended = growth.appended(known, control)
        course = chosen(ca.logic_or(longer, ends), appended, known)
        older, newest = where(longer, x.newest, x.older), where(longer, offer.waypoint, x.newest)
        beyond = course["first"] + self._course.columns
        last = where(longer, beyond, counts.last)
        has_end = ca.logic_and(ends, beyond - 1.0 >= last + self._course.spline.reach)
        pose, eta = growth.end(course)
        rest = where(has_end, ca.vertcat(eta, pose), x.rest)

        # less, where a new path begins
        cuts = ca.logic_and(offer.new, ca.logic_not(rests))
        cut, after_cut, gone = growth.cut_back(known, stop)
        shorter = ca.logic_and(cuts, gone >= 1.0)
        course = chosen(shorter, cut, course)
        before, tip = growth.among(course, 2)
        older = where(ca.logic_or(shorter, ca.logic_and(cuts, ca.logic_not(grows))), tip, older)
        resumed = where(grows, x.newest, 2.0 * tip - before)
        newest = where(cuts, where(shorter, after_cut, resumed), newest)
        last = where(cuts, course["first"] + self._course.columns, last)

        # a new piece, where the last one has its end
        fresh, count, real = self._freshened(x, counts, offer, reason)
        starts = ca.logic_and(rests, counts.fresh == self._fresh)
        waypoints = [x.rest[1:], *ca.vertsplit(x.fresh, self._course.dimension)]
        begins = growth.begun(known, self._acceptance.controls(waypoints), x.rest[0])
        course = chosen(starts, begins, course)
        older, newest = where(starts, waypoints[-2], older), where(starts, waypoints[-1], newest)
        begin = course["first"] + self._course.columns - 1.0 - self._course.spline.reach
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
        told = counts._replace(
            phase=phase, fresh=count, real=real, last=last, taken=taken, begun=begun, reason=reason
        )
        return {
            "course": ca.vertcat(*course.values()),
            "older": older,
            "newest": newest,
            "fresh": fresh,
            "counts": ca.vertcat(*told),
            "rest": rest,
        }

    def _freshened(
        self, x: Values, counts: Counts, offer: Offer, reason: Any
    ) -> tuple[Any, Any, Any]:
        """Return the way points of a piece to begin, how many they are, and how many came."""
        d, rests = self._course.dimension, counts.phase == RESTING
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
