"""The exact motion of an impedance over an interval in which its force is held."""

from typing import Any, NamedTuple

import casadi as ca

from pfsc_drake.blocks.cases import where

# below these the roots of the characteristic polynomial lose digits that the series keeps
_SERIES_DAMPING, _SERIES_STIFFNESS, _SERIES_TERMS = 0.5, 0.25, 20


class Rates(NamedTuple):
    """What an impedance is per mass.

    Attributes:
        damping: ``d / m``, shape (m,) [1/s].
        stiffness: ``k / m``, zero where rigid, shape (m,) [1/s^2].
        yields: Where it is not rigid, shape (m,).
    """

    damping: Any
    stiffness: Any
    yields: Any


def rates_of(impedance: Any) -> Rates:
    """Return dampings and stiffnesses per mass.

    Args:
        impedance: Rows mass, damping, stiffness, shape (3 m,).
    """
    mass, damping, stiffness = ca.vertsplit(impedance, impedance.numel() // 3)
    yields = stiffness < ca.inf
    return Rates(damping / mass, where(yields, stiffness, 0.0) / mass, yields)


def transition_of(impedance: Any, time: float) -> tuple[tuple[Any, ...], Rates]:
    """Return the :func:`transition` of all coordinates, and their rates.

    Args:
        impedance: Rows mass, damping, stiffness, shape (3 m,).
        time: T [s].
    """
    rates = rates_of(impedance)
    return transition(rates.damping, rates.stiffness, time), rates


def transition(damping: Any, stiffness: Any, time: float) -> tuple[Any, ...]:
    """Return the solution of ``e'' + damping e' + stiffness e = f``, f held, in closed form.

    Args:
        damping: ``d / m`` >= 0, shape (m,) [1/s].
        stiffness: ``k / m`` >= 0, shape (m,) [1/s^2].
        time: ``T`` > 0 [s].

    Returns:
        ``(a, b, c, d, p)`` with ``e(T) = a e + b e' + p f``, ``e'(T) = c e + d e' + b f``;
        accurate to rounding for any damping ratio, and for zero stiffness and damping.
    """
    h = 0.5 * damping
    square = h * h - stiffness
    swings, w = square < 0.0, ca.sqrt(ca.fabs(square))
    # two real roots, the slow one without a difference of what is nearly equal
    slow = where(h > 0.0, -stiffness / (h + w), 0.0)
    decay = ca.exp(slow * time)
    b_real = decay * where(w > 0.0, -ca.expm1(-2.0 * w * time) / (2.0 * w), time)
    a_real, d_real = decay - slow * b_real, decay - (h + w) * b_real
    x = slow * time
    p_real = (time * where(ca.fabs(x) > 0.0, ca.expm1(x) / x, 1.0) - b_real) / (h + w)
    # two complex ones
    decay = ca.exp(-h * time)
    b_swing, cosine = decay * ca.sin(w * time) / w, decay * ca.cos(w * time)
    a_swing, d_swing = cosine + h * b_swing, cosine - h * b_swing
    p_swing = (1.0 - a_swing) / stiffness
    a, b, d, p = (
        where(swings, swing, real)
        for swing, real in (
            (a_swing, a_real),
            (b_swing, b_real),
            (d_swing, d_real),
            (p_swing, p_real),
        )
    )
    gentle = ca.logic_and(h * time < _SERIES_DAMPING, stiffness * time**2 < _SERIES_STIFFNESS)
    series = _series(damping * time, stiffness * time**2) * time**2
    return a, b, -stiffness * b, d, where(gentle, series, p)


def _series(damping: Any, stiffness: Any) -> Any:
    """Return e(1) from rest for f = 1, as a Taylor series."""
    c_0, c_1, total = 0.0, 0.5, 0.5
    for n in range(1, _SERIES_TERMS):
        c_0, c_1 = c_1, -(damping * (n + 1) * c_1 + stiffness * c_0) / ((n + 1) * (n + 2))
        total += c_1
    return total
