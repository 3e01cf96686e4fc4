"""Nearest point of a curve or surface to the tool, as an expression."""

import math
from collections.abc import Callable, Sequence
from functools import cached_property

import casadi as ca

from pfsc_drake.geometry.foot_step import GOES_ON, MINIMUM, Ends, step_function

# Steps that are always taken, which is more than the way of a tick needs, and all of them.
_TICK_STEPS, _MAX_STEPS = 4, 60
# Of the lengths of the domain.
_STALLED = 1e-8


class FootFinder:
    """Local minimum of f(theta) = |y - sigma(theta)|^2 / 2 near a guess, (3.6), (4.9).

    Newton's method (3.72), (4.48) in one or two parameters, with a bounded number of masked steps.
    A step is corrected for the bend of its way, limited, halved while f grows, and taken with a
    definite matrix where ``H = first form - (y - sigma) . sigma_ij`` (4.12) is not. At an end of an
    open direction that f falls beyond, that parameter is kept and the other goes on alone. Started
    from the last result it follows its branch through self-intersections.

    Args:
        terms: theta, shape (p,) -> position, its first and then its second partial derivatives as
            columns, shape (3, 3) for p = 1, (3, 6) for p = 2.
        domain: First and last value of each of the p parameters.
        closed: For each whether it is periodic; theta is not wrapped.
        longest_step: Relative to the length of the domain.

    Attributes:
        lengths: Of the domain.
        size: Of the iteration's state.
    """

    def __init__(
        self,
        terms: Callable[[ca.MX], ca.MX],
        domain: Sequence[Ends],
        closed: Sequence[bool],
        longest_step: float,
    ) -> None:
        self.lengths = [end - begin for begin, end in domain]
        self._terms, self._domain, self._closed = terms, domain, closed
        self._step = step_function(domain, closed, longest_step)
        self.size = self._step.size1_in(0)

    def find(self, y: ca.MX, guess: ca.MX) -> "Foot":
        """Return the nearest point next to a guess.

        Args:
            y: The point [m], shape (3,).
            guess: Where to begin, unwrapped, shape (p,).
        """
        begin = self.clamped(guess)
        still = ca.DM.zeros(len(self.lengths))
        state = ca.vertcat(begin, begin, still, math.inf, math.nan, 0.0, GOES_ON)
        for _ in range(_TICK_STEPS):
            state = self._advanced(state, y)
        return Foot(self._long_way(state[-1], state, y), self.lengths)

    def nearest(self, y: ca.MX, starts: Sequence[ca.MX]) -> ca.MX:
        """Return the parameters of the nearest of the minima that are found from several places.

        Args:
            y: The point [m], shape (3,).
            starts: Where to begin, each of shape (p,).
        """
        feet = [self.find(y, start) for start in starts]
        theta, least = feet[0].theta, feet[0].rank
        for foot in feet[1:]:
            nearer = foot.rank < least
            theta = ca.if_else(nearer, foot.theta, theta)
            least = ca.if_else(nearer, foot.rank, least)
        return theta

    def clamped(self, guess: ca.MX) -> ca.MX:
        """A guess moved into open directions' domains; what is not finite is not a number."""
        parts = []
        for k, ((begin, end), closed) in enumerate(zip(self._domain, self._closed, strict=True)):
            theta = guess[k]
            if not closed:
                theta = ca.if_else(theta < begin, begin, ca.if_else(theta > end, end, theta))
            parts.append(ca.if_else(ca.fabs(guess[k]) < math.inf, theta, math.nan))
        return ca.vertcat(*parts)

    def _advanced(self, state: ca.MX, y: ca.MX) -> ca.MX:
        return self._step(state, y, self._terms(state[: len(self.lengths)]))

    @cached_property
    def _long_way(self) -> ca.Function:
        """The steps that a tick does not need as a rule, ``(ended, state, y) -> state``."""
        state, y = ca.MX.sym("state", self.size), ca.MX.sym("y", 3)
        advance = _unless_ended(ca.Function("advance", [state, y], [self._advanced(state, y)]))
        last = state
        for _ in range(_TICK_STEPS, _MAX_STEPS):
            last = advance(last[-1], last, y)
        return _unless_ended(ca.Function("long_way", [state, y], [last]))


class Foot:
    """How an iteration ended.

    Args:
        state: Of the iteration, see :func:`step_function`.
        lengths: Of the domain.

    Attributes:
        state: Of the iteration.
        theta: Parameters of the closest point, unwrapped, shape (p,).
        distance: Of the point from there [m].
        known: Whether point and guess are finite; nothing else means anything if not.
        alpha: Largest (d . sigma_uu) / |sigma_u|^2, d = y - sigma, over all directions u of the
            parameters, (3.9), (4.13): H is definite if and only if alpha < 1.
        beyond_end: Whether the point lies beyond an end of an open direction; theta is then the
            closest point of the border.
        converged: Whether a strict minimum was found.
    """

    def __init__(self, state: ca.MX, lengths: Sequence[float]) -> None:
        p = len(lengths)
        self.state, self.theta = state, state[:p]
        least, self.alpha, self.beyond_end, ended = ca.vertsplit(state[3 * p :])
        self.known = ca.fabs(self.alpha) < math.inf
        self.distance = ca.sqrt(2.0 * least)
        # Near alpha = 1 rounding errors of the slope can exceed the tolerance.
        last_step = ca.norm_inf(state[2 * p : 3 * p] / ca.DM(list(lengths)))
        stalled = ca.logic_and(last_step < _STALLED, self.alpha < 1.0)
        self.converged = ca.if_else(ended == GOES_ON, stalled, ended == MINIMUM)

    @property
    def rank(self) -> ca.MX:
        """The distance [m], or infinite where there is no minimum."""
        return ca.if_else(self.converged, self.distance, math.inf)


def _unless_ended(advance: ca.Function) -> ca.Function:
    """``(ended, state, y) -> state``, that of a function if the iteration goes on."""
    state, y = ca.MX.sym("state", advance.size1_in(0)), ca.MX.sym("y", 3)
    stay = ca.Function("stay", [state, y], [state])
    return ca.Function.if_else(f"{advance.name()}_unless_ended", stay, advance)
