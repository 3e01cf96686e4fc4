"""Which way points become part of a path."""

from typing import Any, NamedTuple

import casadi as ca

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.streams.growth import Fields, Growth
from pfsc_drake.control.streams.messages import StreamStatus, WaypointLayout
from pfsc_drake.control.streams.stream_course import POSE, POSITION, Course, picked
from pfsc_drake.control.streams.stream_parameters import StreamParameters

# what a piece is at: none begun; way points make it longer; it gets its end; it has its end
RESTING, GROWING, ENDING, ENDED = range(4)
# of the spacing, the least distance of a last way point
_LAST = 0.5
_APART = 2.0  # times the spacing, from which on way points are joined by a line
_NO_TURN = 1e-6  # norm of a quaternion that is none


class Counts(NamedTuple):
    """What an intake counts, see :class:`WaypointIntake`."""

    phase: Any
    fresh: Any
    real: Any
    last: Any
    taken: Any
    begun: Any
    silence: Any
    heard: Any
    reason: Any
    most: Any
    behind: Any

    @classmethod
    def of(cls, counts: Any) -> "Counts":
        """Return the parts of the state."""
        return cls(*ca.vertsplit(counts))


class Offer(NamedTuple):
    """What the next way point is to a path.

    Attributes:
        waypoint: What would be accepted of it: itself, or a point on the way there.
        dry: Whether the piece takes way points, and none is left that would make it longer.
        missed: Whether it has been missed.
        new: Whether it begins a new path, and nothing has been done about that.
        refused: Whether it is no finite number, or out of bounds.
        sharp: Whether the path would bend too sharply.
        accepted: Whether it is accepted.
        passed: Whether it is done with.
    """

    waypoint: Any
    dry: Any
    missed: Any
    new: Any
    refused: Any
    sharp: Any
    accepted: Any
    passed: Any


class Acceptance:
    """Judges way points.

    Args:
        course: Layout of the path.
        parameters: How way points become a path.
        layout: Layout of the messages.
        growth: How the path grows.
    """

    def __init__(
        self,
        course: Course,
        parameters: StreamParameters,
        layout: WaypointLayout,
        growth: Growth,
    ) -> None:
        self._course, self._parameters = course, parameters
        self._layout, self._growth = layout, growth
        # way points that a piece needs to begin
        self.needed = course.spline.reach + 1

    def row(self, message: Any, counts: Counts) -> tuple[Any, Any]:
        """Return the next row, and whether it has been missed."""
        d, M = self._layout.dimension, self._layout.length
        waiting = counts.heard - counts.taken
        place = ca.fmin(ca.fmax(M - waiting, 0.0), M - 1.0)
        return picked(message, 2.0 + (d + 1) * place + ca.DM(range(d + 1))), waiting > M

    def offer(self, x: Values, known: Fields, message: Any, room: Any, runs_dry: Any) -> Offer:
        """Return what the next way point is to the path.

        Args:
            x: States of the intake.
            known: The course.
            message: What is told.
            room: Whether there is room for one more control point.
            runs_dry: Whether no more way points come for now.
        """
        d, counts, limits = self._course.dimension, Counts.of(x.counts), self._parameters
        row, missed = self.row(message, counts)
        waits = counts.heard > counts.taken
        missed = ca.logic_and(waits, missed)
        waits = ca.logic_and(waits, ca.logic_not(missed))
        new = ca.logic_and(waits, ca.logic_and(row[d] == 1.0, counts.begun != counts.taken + 1.0))
        rests = counts.phase == RESTING
        is_open = ca.logic_and(
            counts.reason == 0.0,
            ca.logic_or(counts.phase == GROWING, ca.logic_and(rests, counts.fresh < self.needed)),
        )
        waits = ca.logic_and(waits, ca.logic_not(new))
        looks = ca.logic_and(ca.logic_and(waits, is_open), ca.logic_or(rests, room))
        left_out = ca.logic_and(waits, counts.reason >= StreamStatus.MISSED)

        before = where(rests, self._last_fresh(x, counts), x.newest)
        raw, good = self._checked(row[:d], before)
        way = raw - before
        distance = ca.norm_2(way[:POSITION])
        last = counts.heard == counts.taken + 1.0
        final = ca.logic_and(runs_dry, last)
        near = distance < limits.spacing * where(final, _LAST, 1.0)
        parts = ca.fmax(ca.ceil(distance / (_APART * limits.spacing)), 1.0)
        waypoint = before + way / parts
        gentle = where(
            rests,
            self._begins_gently(x, counts, waypoint),
            self._goes_on_gently(x, known, waypoint),
        )
        looks_good = ca.logic_and(looks, good)
        far = ca.logic_and(looks_good, ca.logic_not(near))
        accepted = ca.logic_and(far, gentle)
        whole = ca.logic_and(accepted, parts == 1.0)
        # the last one stays, as it may become the end
        done = ca.logic_and(near, ca.logic_or(final, ca.logic_not(last)))
        passed = ca.logic_or(left_out, ca.logic_or(ca.logic_and(looks_good, done), whole))
        none = ca.logic_or(ca.logic_not(waits), ca.logic_and(final, ca.logic_and(good, near)))
        return Offer(
            waypoint=waypoint,
            dry=ca.logic_and(ca.logic_and(runs_dry, is_open), none),
            missed=missed,
            new=new,
            refused=ca.logic_and(looks, ca.logic_not(good)),
            sharp=ca.logic_and(far, ca.logic_not(gentle)),
            accepted=accepted,
            passed=passed,
        )

    def _last_fresh(self, x: Values, counts: Counts) -> Any:
        """Return the last way point of a piece to begin, or its begin."""
        last = x.rest[1:]
        for k, row in enumerate(ca.vertsplit(x.fresh, self._course.dimension)):
            last = where(counts.fresh > k, row, last)
        return last

    def controls(self, waypoints: list[Any]) -> list[Any]:
        """Return control points of way points but for the last; the first one stays."""
        inner = [
            self._growth.control(*waypoints[k - 1 : k + 2]) for k in range(1, len(waypoints) - 1)
        ]
        return [waypoints[0], *inner]

    def _checked(self, raw: Any, before: Any) -> tuple[Any, Any]:
        """Return a way point with its quaternion on the side of another, and whether it is good."""
        position, good = raw[:POSITION], all_finite(raw)
        for bound, sign in ((self._parameters.lower, 1.0), (self._parameters.upper, -1.0)):
            if bound:
                inside = ca.mmin(sign * (position - ca.DM(bound))) >= 0.0
                good = ca.logic_and(good, inside)
        if self._course.dimension == POSE:
            q, size = raw[POSITION:], ca.norm_2(raw[POSITION:])
            good = ca.logic_and(good, size > _NO_TURN)
            q = q / where(size > _NO_TURN, size, 1.0)
            raw = ca.vertcat(position, where(ca.dot(q, before[POSITION:]) < 0.0, -q, q))
        return raw, good

    def _goes_on_gently(self, x: Values, known: Fields, waypoint: Any) -> Any:
        """Return whether a piece that would end at a way point bends gently enough."""
        control = self._growth.control(x.older, x.newest, waypoint)
        before = self._growth.among(known, self._course.spline.degree)
        controls = self._growth.ended_at([*before, control, waypoint], len(before) + 1)
        return self._growth.admissible(controls)

    def _begins_gently(self, x: Values, counts: Counts, waypoint: Any) -> Any:
        """Return whether a piece that would begin, and end at a way point, bends gently enough."""
        begin, fresh = x.rest[1:], ca.vertsplit(x.fresh, self._course.dimension)
        gentle = ca.DM(0.0)
        for count in range(self.needed):
            rows = [begin, *fresh[:count], waypoint]
            ahead = self.controls([*rows, waypoint])
            # the way point itself is the control point at which it ends
            controls = [*ahead[: count + 1], waypoint]
            good = self._growth.admissible(self._growth.whole_piece(controls))
            gentle = where(counts.fresh == count, good, gentle)
        return gentle

    def beyond(self, x: Values, counts: Counts) -> Any:
        """Return the way point that a piece to begin has beyond its last one, mirrored at it."""
        rows = [x.rest[1:], *ca.vertsplit(x.fresh, self._course.dimension)]
        point = rows[-1]
        for real in range(1, self.needed):
            for count in range(real, self.needed):
                other = 2 * real - count - 1
                far = rows[other] if other >= 0 else 2.0 * rows[0] - rows[-other]
                found = 2.0 * rows[real] - far
                here = ca.logic_and(counts.real == real, counts.fresh == count)
                point = where(here, found, point)
        return point
