"""Nearest point of a curve or surface to the tool, as an expression."""

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import combinations_with_replacement

import casadi as ca

# All relative to the lengths of the domain.
_TOLERANCE = 1e-12
_COARSE = 1e-7
# What lies less far beyond an end is on it.
_BEYOND = 1e-9
# Smallest eigenvalue of H relative to the first form that Newton's step is taken with.
_DEFINITE = 1e-6
# Largest part of a step by which it is corrected for the bend of its way.
_CORRECTION = 0.5

# How an iteration ended.
GOES_ON, MINIMUM, NO_MINIMUM = 0.0, 1.0, 2.0

Ends = tuple[float, float]
# A symmetric form by pairs (i, j) of parameters, i <= j.
Form = dict[tuple[int, int], ca.SX]


def step_function(
    domain: Sequence[Ends], closed: Sequence[bool], longest_step: float
) -> ca.Function:
    """Return one step, ``(state, y, terms) -> state``.

    See :class:`~pfsc_drake.geometry.foot.FootFinder` for what it does.

    The state is ``[theta, origin, way, least, alpha, beyond_end, ended]``: where f is evaluated
    next, where the last step began and what it was, f there, and how the iteration ended.

    Args:
        domain: First and last value of each of the p parameters.
        closed: For each whether it is periodic.
        longest_step: Relative to the length of the domain.
    """
    p = len(domain)
    lengths = [end - begin for begin, end in domain]
    state, y = ca.SX.sym("state", 3 * p + 4), ca.SX.sym("y", 3)
    pairs = list(combinations_with_replacement(range(p), 2))
    terms = ca.SX.sym("terms", 3, 1 + p + len(pairs))
    theta, origin, way = (ca.vertsplit(part) for part in ca.vertsplit(state[: 3 * p], p))
    least, _, _, ended = ca.vertsplit(state[3 * p :])

    slopes = [terms[:, 1 + i] for i in range(p)]
    bends = {pair: terms[:, 1 + p + i] for i, pair in enumerate(pairs)}
    d = y - terms[:, 0]
    f = 0.5 * ca.dot(d, d)
    descent = [ca.dot(d, slope) for slope in slopes]
    first, bend = first_and_bend(y, terms, p)
    alpha = largest_eigenvalue(first, bend)

    held = []
    for k, (begin, end) in enumerate(domain):
        falls = ca.logic_or(
            ca.logic_and(theta[k] <= begin, descent[k] < 0.0),
            ca.logic_and(theta[k] >= end, descent[k] > 0.0),
        )
        held.append(ca.SX(0.0) if closed[k] else falls)
    is_held = _largest(held)
    alone = [first[k, k] - bend[k, k] for k in range(p)]
    # Newton's step of those that are not held, ...
    by_itself = [
        ca.if_else(
            held[k], 0.0, descent[k] / ca.if_else(alone[k] == 0.0, first[k, k], ca.fabs(alone[k]))
        )
        for k in range(p)
    ]
    strict = ca.SX(1.0)
    for k in range(p):
        strict = ca.logic_and(strict, ca.logic_or(held[k], alone[k] > 0.0))
    strict = ca.logic_and(strict, ca.logic_or(is_held, alpha < 1.0))
    # ... of all of them, ...
    definite = alpha < 1.0 - _DEFINITE
    shift = ca.if_else(definite, 0.0, 2.0 * (alpha - 1.0) + 2.0 * _DEFINITE)
    H = {pair: (1.0 + shift) * first[pair] - bend[pair] for pair in pairs}
    newton = _solved(H, descent)
    # ... and with how the residual bends on the way, without the part that d . sigma_ijk has in it.
    tangent = sum((slopes[i] * newton[i] for i in range(p)), start=ca.SX.zeros(3))
    turning = [
        sum((bends[min(i, j), max(i, j)] * newton[j] for j in range(p)), start=ca.SX.zeros(3))
        for i in range(p)
    ]
    sag = 0.5 * sum((turning[i] * newton[i] for i in range(p)), start=ca.SX.zeros(3))
    correction = _solved(
        H, [-ca.dot(tangent, turning[i]) - ca.dot(sag, slopes[i]) for i in range(p)]
    )
    small = _largest([ca.fabs(correction[k]) / lengths[k] for k in range(p)]) <= (
        _CORRECTION * _largest([ca.fabs(newton[k]) / lengths[k] for k in range(p)])
    )
    corrected = ca.logic_and(definite, small)
    free = [newton[k] + ca.if_else(corrected, correction[k], 0.0) for k in range(p)]
    wanted = [ca.if_else(is_held, by_itself[k], free[k]) for k in range(p)]
    size = _largest([ca.fabs(wanted[k]) / lengths[k] for k in range(p)])
    scale = ca.fmin(1.0, longest_step / ca.fmax(size, 1e-300))
    target, met = _inside(theta, [scale * part for part in wanted], domain, closed)
    taken = [target[k] - theta[k] for k in range(p)]

    grew = ca.logic_and(
        f > least, _largest([ca.fabs(way[k]) / lengths[k] for k in range(p)]) > _COARSE
    )
    halved = [0.5 * part for part in way]
    arrived = ca.logic_and(
        ca.logic_not(met),
        _largest([ca.fabs(taken[k]) / lengths[k] for k in range(p)]) < _TOLERANCE,
    )
    beyond = _largest(
        [held[k] * ca.fabs(descent[k]) / (first[k, k] * lengths[k]) for k in range(p)]
    )
    back = ca.vertcat(*[origin[k] + halved[k] for k in range(p)], *origin, *halved, state[3 * p :])
    on = ca.vertcat(
        *target,
        *theta,
        *taken,
        f,
        alpha,
        beyond > _BEYOND,
        ca.if_else(arrived, ca.if_else(strict, MINIMUM, NO_MINIMUM), GOES_ON),
    )
    nowhere = ca.vertcat(state[: 3 * p], f, math.nan, 0.0, NO_MINIMUM)
    further = ca.if_else(grew, back, on)
    further = ca.if_else(ca.logic_and(f < math.inf, ca.fabs(alpha) < math.inf), further, nowhere)
    further = ca.if_else(ended == GOES_ON, further, state)
    return ca.Function(
        "foot_step", [state, y, terms], [further], ["state", "y", "terms"], ["next"], {"cse": True}
    )


def _inside(
    theta: Sequence[ca.SX], step: Sequence[ca.SX], domain: Sequence[Ends], closed: Sequence[bool]
) -> tuple[list[ca.SX], ca.SX]:
    """Where a step leads to, or its way to the first end it meets, and whether it met one.

    A step out of an end that theta is on already goes along it.
    """
    way, shares = list(step), [ca.SX(1.0)] * len(step)
    for k, (begin, end) in enumerate(domain):
        if not closed[k]:
            room = ca.if_else(way[k] > 0.0, end, begin) - theta[k]
            way[k] = ca.if_else(room == 0.0, 0.0, way[k])
            short = ca.fabs(way[k]) > ca.fabs(room)
            shares[k] = ca.if_else(short, room / way[k], 1.0)
    share = -_largest([-part for part in shares])
    target = []
    for k, (begin, end) in enumerate(domain):
        place = theta[k] + share * way[k]
        if not closed[k]:
            met = ca.logic_and(shares[k] < 1.0, shares[k] == share)
            place = ca.fmin(ca.fmax(place, begin), end)
            place = ca.if_else(met, ca.if_else(way[k] > 0.0, end, begin), place)
        target.append(place)
    return target, share < 1.0


def _solved(H: Form, right: Sequence[ca.SX]) -> list[ca.SX]:
    """Solution of a symmetric system of one or two equations."""
    if len(right) == 1:
        return [right[0] / H[0, 0]]
    determinant = H[0, 0] * H[1, 1] - H[0, 1] * H[0, 1]
    return [
        (H[1, 1] * right[0] - H[0, 1] * right[1]) / determinant,
        (H[0, 0] * right[1] - H[0, 1] * right[0]) / determinant,
    ]


def first_and_bend(y: ca.SX, terms: ca.SX, p: int) -> tuple[Form, Form]:
    """Return the first form sigma_i . sigma_j, and (y - sigma) . sigma_ij, by (i, j), i <= j.

    Args:
        y: The point, shape (3,).
        terms: Position, first and second partial derivatives as columns.
        p: Number of parameters.
    """
    pairs = list(combinations_with_replacement(range(p), 2))
    slopes, d = terms[:, 1 : 1 + p], y - terms[:, 0]
    first = {(i, j): ca.dot(slopes[:, i], slopes[:, j]) for i, j in pairs}
    bend = {pair: ca.dot(d, terms[:, 1 + p + i]) for i, pair in enumerate(pairs)}
    return first, bend


def largest_eigenvalue(first: Form, form: Form) -> ca.SX:
    """Return that of a form relative to the first one, as `curvature.mean_and_spread`."""
    along = form[0, 0] / first[0, 0]
    if len(first) == 1:
        return along
    E, F, G = first[0, 0], first[0, 1], first[1, 1]
    determinant = E * G - F * F
    mixed = form[0, 1] - F * along
    across = (form[1, 1] * E - 2.0 * F * form[0, 1] + F * F * along) / determinant
    half = 0.5 * (along - across)
    spread = ca.sqrt(half * half + mixed * mixed / determinant)
    return 0.5 * (along + across) + spread


def _largest(values: Sequence[ca.SX]) -> ca.SX:
    """The largest of one or two."""
    return values[0] if len(values) == 1 else ca.fmax(values[0], values[1])


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
        lengths: Lengths of the domain.
        size: Size of the iteration's state.
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
        state: State of the iteration, see :func:`step_function`.
        lengths: Lengths of the domain.

    Attributes:
        state: State of the iteration.
        theta: Parameters of the closest point, unwrapped, shape (p,).
        distance: Distance of the point from there [m].
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
