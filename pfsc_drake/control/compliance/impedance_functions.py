"""The numbers of an impedance filter: the exact solution over an interval, and compiled steps."""

import functools
import math

import casadi as ca
import numpy as np

# below these the roots of the characteristic polynomial lose digits that the series keeps
_SERIES_DAMPING, _SERIES_STIFFNESS, _SERIES_TERMS = 0.5, 0.25, 20


@functools.lru_cache(maxsize=64)
def transition(damping: float, stiffness: float, time: float) -> tuple[float, ...]:
    """Return the solution of ``e'' + damping e' + stiffness e = f``, f held, in closed form.

    Args:
        damping: ``d / m`` >= 0 [1/s].
        stiffness: ``k / m`` >= 0 [1/s^2].
        time: ``T`` > 0 [s].

    Returns:
        ``(a, b, c, d, p)`` with ``e(T) = a e + b e' + p f``, ``e'(T) = c e + d e' + b f``;
        accurate to rounding for any damping ratio, and for zero stiffness and damping.
    """
    h = 0.5 * damping
    square = h * h - stiffness
    if square >= 0.0:
        w = math.sqrt(square)
        slow = -stiffness / (h + w) if h > 0.0 else 0.0
        p = math.exp(slow * time)
        b = p * (-math.expm1(-2.0 * w * time) / (2.0 * w) if w > 0.0 else time)
        a, d = p - slow * b, p - (h + w) * b
    else:
        w = math.sqrt(-square)
        decay = math.exp(-h * time)
        b = decay * math.sin(w * time) / w
        cosine = decay * math.cos(w * time)
        a, d = cosine + h * b, cosine - h * b
    if h * time < _SERIES_DAMPING and stiffness * time**2 < _SERIES_STIFFNESS:
        deflection = _series(damping * time, stiffness * time**2) * time**2
    elif square >= 0.0:
        x = slow * time
        deflection = (time * (math.expm1(x) / x if x else 1.0) - b) / (h + w)
    else:
        deflection = (1.0 - a) / stiffness
    return a, b, -stiffness * b, d, deflection


def _series(damping: float, stiffness: float) -> float:
    """Return e(1) from rest for f = 1, as a Taylor series."""
    c_0, c_1, total = 0.0, 0.5, 0.5
    for n in range(1, _SERIES_TERMS):
        c_0, c_1 = c_1, -(damping * (n + 1) * c_1 + stiffness * c_0) / ((n + 1) * (n + 2))
        total += c_1
    return total


def coefficients(impedance: np.ndarray, period: float) -> np.ndarray:
    """Return all that the compiled steps need of an impedance.

    Args:
        impedance: Rows mass, damping, stiffness, shape (3, m), valid.
        period: T [s].

    Returns:
        Rows ``a, b, c, d, p`` of :func:`transition`, ``d / m``, ``k / m`` (zero where
        rigid), and 1 where compliant, else 0; shape (8, m).
    """
    mass, damping, stiffness = impedance
    compliant = np.isfinite(stiffness)
    damping, stiffness = damping / mass, np.where(compliant, stiffness, 0.0) / mass
    rates = zip(damping.tolist(), stiffness.tolist(), strict=True)
    solution = np.array([transition(*rate, period) for rate in rates]).T
    return np.vstack([solution, damping, stiffness, compliant])


def update_function(num_outputs: int, desired_order: int, period: float) -> ca.Function:
    """Return the step over a period as a function of numbers.

    Args:
        num_outputs: m.
        desired_order: p.
        period: T [s].

    Returns:
        ``(motion, desired, force, mass, coefficients) -> (next, unusable)``, all arrays by
        rows: motion y_p, y_p', shape (2 m,); derivatives 0..p of y_d; force and mass, shape
        (m,); the impedance's :func:`coefficients`; next motion and force used, shape (3 m,).
        A force that is not finite counts as zero, and y_p rests if y_d is not finite;
        ``unusable``, shape (2,), is 1 for the force and for y_d then.
    """
    m = num_outputs
    motion, desired = ca.SX.sym("motion", 2 * m), ca.SX.sym("desired", (desired_order + 1) * m)
    force, mass = ca.SX.sym("force", m), ca.SX.sym("mass", m)
    known = ca.SX.sym("coefficients", 8 * m)
    y, y_1 = ca.vertsplit(motion, m)
    y_d = ca.vertsplit(desired, m)
    a, b, c, d, p, _, _, compliant = ca.vertsplit(known, m)
    force_lost, desired_lost = _not_finite(force), _not_finite(desired)
    tau = ca.if_else(force_lost, 0.0, force)
    e, e_1, f = y - y_d[0], y_1 - y_d[1], tau / mass
    weights = [period**k / math.factorial(k) for k in range(desired_order + 1)]
    position = sum(w * row for w, row in zip(weights, y_d, strict=True))
    velocity = sum(w * row for w, row in zip(weights, y_d[1:], strict=False))
    position += ca.if_else(compliant, a * e + b * e_1 + p * f, 0.0)
    velocity += ca.if_else(compliant, c * e + d * e_1 + b * f, 0.0)
    result = ca.vertcat(
        ca.if_else(desired_lost, y, position), ca.if_else(desired_lost, 0.0, velocity), tau
    )
    return _function(
        "impedance_update",
        [motion, desired, force, mass, known],
        [result, ca.vertcat(force_lost, desired_lost)],
        ["motion", "desired", "force", "mass", "coefficients"],
        ["next", "unusable"],
    )


def reference_function(
    num_outputs: int, desired_order: int, relative_degree: int, response_order: int
) -> ca.Function:
    """Return the reference of the loop as a function of numbers.

    Args:
        num_outputs: m.
        desired_order: p.
        relative_degree: r.
        response_order: Highest derivative of y_p that contains the response to forces.

    Returns:
        ``(motion, desired, last_force, mass, coefficients) -> reference``: derivatives 0..r
        of y_p by rows, shape ((r + 1) m,); for the arguments see :func:`update_function`.
    """
    m = num_outputs
    motion, desired = ca.SX.sym("motion", 2 * m), ca.SX.sym("desired", (desired_order + 1) * m)
    tau, mass = ca.SX.sym("last_force", m), ca.SX.sym("mass", m)
    known = ca.SX.sym("coefficients", 8 * m)
    y, y_1 = ca.vertsplit(motion, m)
    y_d = ca.vertsplit(desired, m)
    *_, damping, stiffness, compliant = ca.vertsplit(known, m)
    response, force = [y - y_d[0], y_1 - y_d[1]], tau / mass
    for _ in range(2, response_order + 1):
        response.append(force - damping * response[-1] - stiffness * response[-2])
        force = 0.0
    # a motion that is known is not rounded by a difference and a sum
    rows = [ca.if_else(compliant, y, y_d[0]), ca.if_else(compliant, y_1, y_d[1])]
    for k in range(2, relative_degree + 1):
        yielding = k <= response_order
        rows.append(y_d[k] + ca.if_else(compliant, response[k], 0.0) if yielding else y_d[k])
    return _function(
        "impedance_reference",
        [motion, desired, tau, mass, known],
        [ca.vertcat(*rows[: relative_degree + 1])],
        ["motion", "desired", "last_force", "mass", "coefficients"],
        ["reference"],
    )


def _not_finite(vector: ca.SX) -> ca.SX:
    """Return 1 if an entry is NaN or infinite, for then the sum is too."""
    return ca.logic_not(ca.fabs(ca.sum1(vector)) < ca.inf)


def _function(
    name: str,
    arguments: list[ca.SX],
    results: list[ca.SX],
    names: list[str],
    result_names: list[str],
) -> ca.Function:
    dense = ca.cse([ca.densify(result) for result in results])
    return ca.Function(name, arguments, dense, names, result_names)
