"""Closest point of a curve or surface to the tool, as an expression."""

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import combinations_with_replacement

import casadi as ca

# All relative to the lengths of the domain.
_TOLERANCE = 1e-12
_COARSE = 1e-7
# A point that lies less far beyond an end counts as on it.
_BEYOND = 1e-9
# Smallest eigenvalue of H relative to the first form that Newton's step is taken with.
_DEFINITE = 1e-6
# Largest correction for the curvature along a step, relative to the step.
_CORRECTION = 0.5

# Status of an iteration.
GOES_ON, MINIMUM, NO_MINIMUM = 0.0, 1.0, 2.0

Ends = tuple[float, float]
# A symmetric form by pairs (i, j) of parameters, i <= j.
Form = dict[tuple[int, int], ca.SX]


def step_function(
    domain: Sequence[Ends], closed: Sequence[bool], longest_step: float
) -> ca.Function:
    """Return one step, ``(state, y, terms) -> state``.

    See :class:`~pfsc_drake.geometry.closest_point.ClosestPointFinder` for the method.

    The state is ``[theta, origin, move, least, alpha, beyond_end, ended]``: the parameters at which
    f is evaluated next, start and size of the last step, f at its start, and the status.

    Args:
        domain: First and last value of each of the p parameters.
        closed: Whether each parameter is periodic.
        longest_step: Relative to the length of the domain.
    """
    p = len(domain)
    lengths = [end - begin for begin, end in domain]
    state, y = ca.SX.sym("state", 3 * p + 4), ca.SX.sym("y", 3)
    pairs = list(combinations_with_replacement(range(p), 2))
    terms = ca.SX.sym("terms", 3, 1 + p + len(pairs))
    theta, origin, move = (ca.vertsplit(part) for part in ca.vertsplit(state[: 3 * p], p))
    least, _, _, ended = ca.vertsplit(state[3 * p :])

    slopes = [terms[:, 1 + i] for i in range(p)]
    bends = {pair: terms[:, 1 + p + i] for i, pair in enumerate(pairs)}
    d = y - terms[:, 0]
    f = 0.5 * ca.dot(d, d)
    descent = [ca.dot(d, slope) for slope in slopes]
    first, bend = first_and_bend(y, terms, p)
    alpha = largest_eigenvalue(first, bend)

    at_end = []
    for k, (begin, end) in enumerate(domain):
        falls = ca.logic_or(
            ca.logic_and(theta[k] <= begin, descent[k] < 0.0),
            ca.logic_and(theta[k] >= end, descent[k] > 0.0),
        )
        at_end.append(ca.SX(0.0) if closed[k] else falls)
    any_at_end = _largest(at_end)
    alone = [first[k, k] - bend[k, k] for k in range(p)]
    # Newton's step of the parameters that are not at an end, ...
    by_itself = [
        ca.if_else(
            at_end[k], 0.0, descent[k] / ca.if_else(alone[k] == 0.0, first[k, k], ca.fabs(alone[k]))
        )
        for k in range(p)
    ]
    strict = ca.SX(1.0)
    for k in range(p):
        strict = ca.logic_and(strict, ca.logic_or(at_end[k], alone[k] > 0.0))
    strict = ca.logic_and(strict, ca.logic_or(any_at_end, alpha < 1.0))
    # ... of all of them, ...
    definite = alpha < 1.0 - _DEFINITE
    shift = ca.if_else(definite, 0.0, 2.0 * (alpha - 1.0) + 2.0 * _DEFINITE)
    H = {pair: (1.0 + shift) * first[pair] - bend[pair] for pair in pairs}
    newton = _solve(H, descent)
    # ... and corrected for the curvature along the step, without the term of d . sigma_ijk.
    tangent = sum((slopes[i] * newton[i] for i in range(p)), start=ca.SX.zeros(3))
    turning = [
        sum((bends[min(i, j), max(i, j)] * newton[j] for j in range(p)), start=ca.SX.zeros(3))
        for i in range(p)
    ]
    sag = 0.5 * sum((turning[i] * newton[i] for i in range(p)), start=ca.SX.zeros(3))
    correction = _solve(
        H, [-ca.dot(tangent, turning[i]) - ca.dot(sag, slopes[i]) for i in range(p)]
    )
    small = _largest([ca.fabs(correction[k]) / lengths[k] for k in range(p)]) <= (
        _CORRECTION * _largest([ca.fabs(newton[k]) / lengths[k] for k in range(p)])
    )
    corrected = ca.logic_and(definite, small)
    free = [newton[k] + ca.if_else(corrected, correction[k], 0.0) for k in range(p)]
    full_step = [ca.if_else(any_at_end, by_itself[k], free[k]) for k in range(p)]
    size = _largest([ca.fabs(full_step[k]) / lengths[k] for k in range(p)])
    scale = ca.fmin(1.0, longest_step / ca.fmax(size, 1e-300))
    target, met = _inside(theta, [scale * part for part in full_step], domain, closed)
    taken = [target[k] - theta[k] for k in range(p)]

    grew = ca.logic_and(
        f > least, _largest([ca.fabs(move[k]) / lengths[k] for k in range(p)]) > _COARSE
    )
    halved = [0.5 * part for part in move]
    arrived = ca.logic_and(
        ca.logic_not(met),
        _largest([ca.fabs(taken[k]) / lengths[k] for k in range(p)]) < _TOLERANCE,
    )
    beyond = _largest(
        [at_end[k] * ca.fabs(descent[k]) / (first[k, k] * lengths[k]) for k in range(p)]
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
    """Return the end of a step, cut at the first end of the domain, and whether it was cut.

    A step out of an end that theta is already on goes along it.
    """
    move, shares = list(step), [ca.SX(1.0)] * len(step)
    for k, (begin, end) in enumerate(domain):
        if not closed[k]:
            margin = ca.if_else(move[k] > 0.0, end, begin) - theta[k]
            move[k] = ca.if_else(margin == 0.0, 0.0, move[k])
            short = ca.fabs(move[k]) > ca.fabs(margin)
            shares[k] = ca.if_else(short, margin / move[k], 1.0)
    share = -_largest([-part for part in shares])
    target = []
    for k, (begin, end) in enumerate(domain):
        value = theta[k] + share * move[k]
        if not closed[k]:
            met = ca.logic_and(shares[k] < 1.0, shares[k] == share)
            value = ca.fmin(ca.fmax(value, begin), end)
            value = ca.if_else(met, ca.if_else(move[k] > 0.0, end, begin), value)
        target.append(value)
    return target, share < 1.0


def _solve(H: Form, right: Sequence[ca.SX]) -> list[ca.SX]:
    """Return the solution of a symmetric system of one or two equations."""
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
    """Return the largest eigenvalue of a form relative to the first form.

    As `curvature.mean_and_spread`.
    """
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
    """Return the larger of two values, or the only one."""
    return values[0] if len(values) == 1 else ca.fmax(values[0], values[1])


# Steps that are always taken, more than the motion within a tick needs, and the most of them.
_TICK_STEPS, _MAX_STEPS = 4, 60
# Of the lengths of the domain.
_STALLED = 1e-8


class ClosestPointFinder:
    """Newton iteration for the closest point, (3.6), (4.9).

    It finds a local minimum of f(theta) = |y - sigma(theta)|^2 / 2 near a guess.

    Newton's method (3.72), (4.48) in one or two parameters, with a bounded number of masked steps.
    A step is corrected for the curvature along it, limited, halved while f grows, and taken with a
    definite matrix where ``H = first form - (y - sigma) . sigma_ij`` (4.12) is not. At an end of an
    open direction beyond which f falls, that parameter stays and the other one is iterated alone.
    Started from the last result, the iteration follows its branch through self-intersections.

    Args:
        terms: theta, shape (p,) -> position, its first and then its second partial derivatives as
            columns, shape (3, 3) for p = 1, (3, 6) for p = 2.
        domain: First and last value of each of the p parameters.
        closed: Whether each parameter is periodic; theta is not wrapped.
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

    def find(self, y: ca.MX, guess: ca.MX) -> "ClosestPoint":
        """Return the closest point near a guess.

        Args:
            y: The point [m], shape (3,).
            guess: Initial parameters, unwrapped, shape (p,).
        """
        begin = self.clamp(guess)
        still = ca.DM.zeros(len(self.lengths))
        state = ca.vertcat(begin, begin, still, math.inf, math.nan, 0.0, GOES_ON)
        for _ in range(_TICK_STEPS):
            state = self._advance(state, y)
        return ClosestPoint(self._further_steps(state[-1], state, y), self.lengths)

    def nearest(self, y: ca.MX, starts: Sequence[ca.MX]) -> ca.MX:
        """Return the parameters of the nearest of the minima that are found from several starts.

        Args:
            y: The point [m], shape (3,).
            starts: Initial parameters, each of shape (p,).
        """
        closest_points = [self.find(y, start) for start in starts]
        theta, least = closest_points[0].theta, closest_points[0].rank
        for closest_point in closest_points[1:]:
            nearer = closest_point.rank < least
            theta = ca.if_else(nearer, closest_point.theta, theta)
            least = ca.if_else(nearer, closest_point.rank, least)
        return theta

    def clamp(self, guess: ca.MX) -> ca.MX:
        """Return a guess moved into open directions' domains; infinite values become NaN."""
        parts = []
        for k, ((begin, end), closed) in enumerate(zip(self._domain, self._closed, strict=True)):
            theta = guess[k]
            if not closed:
                theta = ca.if_else(theta < begin, begin, ca.if_else(theta > end, end, theta))
            parts.append(ca.if_else(ca.fabs(guess[k]) < math.inf, theta, math.nan))
        return ca.vertcat(*parts)

    def _advance(self, state: ca.MX, y: ca.MX) -> ca.MX:
        return self._step(state, y, self._terms(state[: len(self.lengths)]))

    @cached_property
    def _further_steps(self) -> ca.Function:
        """Steps that a tick rarely needs, ``(ended, state, y) -> state``."""
        state, y = ca.MX.sym("state", self.size), ca.MX.sym("y", 3)
        advance = _unless_ended(ca.Function("advance", [state, y], [self._advance(state, y)]))
        last = state
        for _ in range(_TICK_STEPS, _MAX_STEPS):
            last = advance(last[-1], last, y)
        return _unless_ended(ca.Function("long_way", [state, y], [last]))


class ClosestPoint:
    """Result of an iteration for the closest point.

    Args:
        state: State of the iteration, see :func:`step_function`.
        lengths: Lengths of the domain.

    Attributes:
        state: State of the iteration.
        theta: Parameters of the closest point, unwrapped, shape (p,).
        distance: Distance of the point from the closest point [m].
        known: Whether point and guess are finite; all other attributes are undefined if not.
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
    """Return ``(ended, state, y) -> state``, a function that acts while the iteration goes on."""
    state, y = ca.MX.sym("state", advance.size1_in(0)), ca.MX.sym("y", 3)
    stay = ca.Function("stay", [state, y], [state])
    return ca.Function.if_else(f"{advance.name()}_unless_ended", stay, advance)
