"""One step towards the nearest point of a curve or surface, as a function of scalars."""

import math
from collections.abc import Sequence
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
