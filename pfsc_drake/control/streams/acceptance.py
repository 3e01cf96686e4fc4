"""Acceptance of waypoints into a growing path."""

from typing import Any, NamedTuple

import casadi as ca

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.streams.growing_path import POSE, POSITION, GrowingPath, pick
from pfsc_drake.control.streams.growth import Fields, Growth
from pfsc_drake.control.streams.messages import StreamStatus, WaypointLayout
from pfsc_drake.control.streams.stream_parameters import StreamParameters

# phases of a piece: no piece; waypoints extend it; its end is added; it has its end
RESTING, GROWING, ENDING, ENDED = range(4)
# least distance of a last waypoint, relative to the spacing
_LAST = 0.5
_APART = 2.0  # times the spacing: beyond it waypoints are joined by a line
_NO_TURN = 1e-6  # norm below which a quaternion is invalid


class Counts(NamedTuple):
    """Counters of an intake, see :class:`WaypointIntake`."""

    phase: Any
    fresh: Any
    real: Any
    last: Any
    taken: Any
    path_begin: Any
    silence: Any
    heard: Any
    reason: Any
    most: Any
    behind: Any

    @classmethod
    def of(cls, counts: Any) -> "Counts":
        """Return the counters of a state."""
        return cls(*ca.vertsplit(counts))


class Offer(NamedTuple):
    """Evaluation of the next waypoint for a path.

    Attributes:
        waypoint: Point to be accepted: the waypoint, or a point on the line to it.
        dry: Whether the piece accepts waypoints, and none is left that would extend it.
        missed: Whether the waypoint has been missed.
        new: Whether it begins a new path that has not been begun yet.
        refused: Whether it is NaN, infinite, or out of bounds.
        sharp: Whether the path would bend too sharply.
        accepted: Whether it is accepted.
        passed: Whether its processing is complete.
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
    """Acceptance test of waypoints.

    Args:
        path: Layout of the path.
        parameters: Parameters of the stream.
        layout: Layout of the messages.
        growth: Operations on the path.
    """

    def __init__(
        self,
        path: GrowingPath,
        parameters: StreamParameters,
        layout: WaypointLayout,
        growth: Growth,
    ) -> None:
        self._path, self._parameters = path, parameters
        self._layout, self._growth = layout, growth
        # number of waypoints that a new piece needs
        self.needed = path.spline.reach + 1

    def row(self, message: Any, counts: Counts) -> tuple[Any, Any]:
        """Return the next row of the message, and whether it has been missed."""
        d, M = self._layout.dimension, self._layout.length
        waiting = counts.heard - counts.taken
        index = ca.fmin(ca.fmax(M - waiting, 0.0), M - 1.0)
        return pick(message, 2.0 + (d + 1) * index + ca.DM(range(d + 1))), waiting > M

    def offer(self, x: Values, known: Fields, message: Any, has_space: Any, runs_dry: Any) -> Offer:
        """Return the evaluation of the next waypoint.

        Args:
            x: States of the intake.
            known: Fields of the path.
            message: Newest message.
            has_space: Whether the path has space for one more control point.
            runs_dry: Whether no more waypoints arrive for now.
        """
        d, counts, limits = self._path.dimension, Counts.of(x.counts), self._parameters
        row, missed = self.row(message, counts)
        waits = counts.heard > counts.taken
        missed = ca.logic_and(waits, missed)
        waits = ca.logic_and(waits, ca.logic_not(missed))
        new = ca.logic_and(
            waits, ca.logic_and(row[d] == 1.0, counts.path_begin != counts.taken + 1.0)
        )
        rests = counts.phase == RESTING
        is_open = ca.logic_and(
            counts.reason == 0.0,
            ca.logic_or(counts.phase == GROWING, ca.logic_and(rests, counts.fresh < self.needed)),
        )
        waits = ca.logic_and(waits, ca.logic_not(new))
        examined = ca.logic_and(ca.logic_and(waits, is_open), ca.logic_or(rests, has_space))
        skipped = ca.logic_and(waits, counts.reason >= StreamStatus.MISSED)

        before = where(rests, self._last_fresh(x, counts), x.newest)
        raw, good = self._validate(row[:d], before)
        step = raw - before
        distance = ca.norm_2(step[:POSITION])
        last = counts.heard == counts.taken + 1.0
        final = ca.logic_and(runs_dry, last)
        near = distance < limits.spacing * where(final, _LAST, 1.0)
        parts = ca.fmax(ca.ceil(distance / (_APART * limits.spacing)), 1.0)
        waypoint = before + step / parts
        gentle = where(
            rests,
            self._begins_gently(x, counts, waypoint),
            self._goes_on_gently(x, known, waypoint),
        )
        is_valid = ca.logic_and(examined, good)
        far = ca.logic_and(is_valid, ca.logic_not(near))
        accepted = ca.logic_and(far, gentle)
        whole = ca.logic_and(accepted, parts == 1.0)
        # the last one remains, as it may become the end
        done = ca.logic_and(near, ca.logic_or(final, ca.logic_not(last)))
        passed = ca.logic_or(skipped, ca.logic_or(ca.logic_and(is_valid, done), whole))
        none = ca.logic_or(ca.logic_not(waits), ca.logic_and(final, ca.logic_and(good, near)))
        return Offer(
            waypoint=waypoint,
            dry=ca.logic_and(ca.logic_and(runs_dry, is_open), none),
            missed=missed,
            new=new,
            refused=ca.logic_and(examined, ca.logic_not(good)),
            sharp=ca.logic_and(far, ca.logic_not(gentle)),
            accepted=accepted,
            passed=passed,
        )

    def _last_fresh(self, x: Values, counts: Counts) -> Any:
        """Return the last waypoint of a new piece, or its begin."""
        last = x.rest[1:]
        for k, row in enumerate(ca.vertsplit(x.fresh, self._path.dimension)):
            last = where(counts.fresh > k, row, last)
        return last

    def controls(self, waypoints: list[Any]) -> list[Any]:
        """Return the control points of waypoints but the last; the first one is unchanged."""
        inner = [
            self._growth.control(*waypoints[k - 1 : k + 2]) for k in range(1, len(waypoints) - 1)
        ]
        return [waypoints[0], *inner]

    def _validate(self, raw: Any, before: Any) -> tuple[Any, Any]:
        """Return a waypoint with its quaternion on the side of another, and whether it is valid."""
        position, good = raw[:POSITION], all_finite(raw)
        for bound, sign in ((self._parameters.lower, 1.0), (self._parameters.upper, -1.0)):
            if bound:
                inside = ca.mmin(sign * (position - ca.DM(bound))) >= 0.0
                good = ca.logic_and(good, inside)
        if self._path.dimension == POSE:
            q, size = raw[POSITION:], ca.norm_2(raw[POSITION:])
            good = ca.logic_and(good, size > _NO_TURN)
            q = q / where(size > _NO_TURN, size, 1.0)
            raw = ca.vertcat(position, where(ca.dot(q, before[POSITION:]) < 0.0, -q, q))
        return raw, good

    def _goes_on_gently(self, x: Values, known: Fields, waypoint: Any) -> Any:
        """Return whether a piece that would end at a waypoint bends gently enough."""
        control = self._growth.control(x.older, x.newest, waypoint)
        before = self._growth.among(known, self._path.spline.degree)
        controls = self._growth.end_at([*before, control, waypoint], len(before) + 1)
        return self._growth.admissible(controls)

    def _begins_gently(self, x: Values, counts: Counts, waypoint: Any) -> Any:
        """Return whether a new piece that would end at a waypoint bends gently enough."""
        begin, fresh = x.rest[1:], ca.vertsplit(x.fresh, self._path.dimension)
        gentle = ca.DM(0.0)
        for count in range(self.needed):
            rows = [begin, *fresh[:count], waypoint]
            ahead = self.controls([*rows, waypoint])
            # the waypoint itself is the control point at which the piece ends
            controls = [*ahead[: count + 1], waypoint]
            good = self._growth.admissible(self._growth.whole_piece(controls))
            gentle = where(counts.fresh == count, good, gentle)
        return gentle

    def beyond(self, x: Values, counts: Counts) -> Any:
        """Return the waypoint of a new piece beyond its last one, mirrored at it."""
        rows = [x.rest[1:], *ca.vertsplit(x.fresh, self._path.dimension)]
        point = rows[-1]
        for real in range(1, self.needed):
            for count in range(real, self.needed):
                other = 2 * real - count - 1
                far = rows[other] if other >= 0 else 2.0 * rows[0] - rows[-other]
                found = 2.0 * rows[real] - far
                here = ca.logic_and(counts.real == real, counts.fresh == count)
                point = where(here, found, point)
        return point
