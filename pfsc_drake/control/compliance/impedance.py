"""Impedance of virtual outputs: compliant reference under forces, solved exactly."""

import enum
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca

from pfsc_drake.blocks.cases import all_finite, all_of, is_finite, where
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
)
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.manifold import indices
from pfsc_drake.errors import InputError

MASS, DAMPING, STIFFNESS = range(3)
# argument of a profile over the norm of all transversal coordinates
_ACROSS = Kind.TRANSVERSAL.value


class ImpedanceStatus(enum.IntFlag):
    """Invalid inputs of an update of the filter."""

    OK = 0
    FORCE_NOT_FINITE = 1
    IMPEDANCE_NOT_VALID = 2
    REFERENCE_NOT_FINITE = 4


class ImpedanceState(NamedTuple):
    """State of an impedance, numbers (``casadi.DM``) or expressions.

    Attributes:
        position: y_p, shape (m,) [m, rad].
        velocity: y_p', shape (m,) [m/s, rad/s].
        force: Force of the last interval, shape (m,) [N, Nm].
        impedance: Rows mass, damping, stiffness of the last interval, shape (3 m,).
    """

    position: Any
    velocity: Any
    force: Any
    impedance: Any


class ImpedanceLaw:
    """Impedance ``m e'' + d e' + k e = tau``, ``e = y_p - y_d``, of every coordinate, sampled.

    For a path it is (3.42) for eta and xi, (3.44) for the angles. The state is the *motion itself*,
    y_p and y_p', with the force and the parameters of the last interval. A change of parameters,
    external reference or force changes only the further motion: e is computed anew at every tick
    and absorbs the change. Hence no step in y_p or y_p'.

    Over an interval e obeys its differential equation with constant force and parameters, solved
    exactly (:mod:`~pfsc_drake.control.compliance.impedance`); ``y_d`` is extrapolated by its Taylor
    polynomial of order ``desired_order``. The extrapolation error acts like a disturbance of e: for
    a sine of 1 m, 5 rad/s, 3e-5 m with order 2 and 6e-11 m with order 4 and Tab. 3.2, and
    5e-3 m and 1e-8 m for a free mass. Order 2 is the minimum because (3.42) contains ``y_d''``.

    ``k = inf`` is position control; when a coordinate becomes rigid, y_p steps to y_d.
    With constant parameters the filter is passive: ``tau . (e(T) - e(0))`` is at least the
    change of ``(m e'^2 + k e^2) / 2``. A stiffness that grows while deflected adds energy.

    Args:
        parameters: Masses, dampings, stiffnesses.
        coordinates: The m coordinates of the virtual output.
        relative_degree: r of the law that follows the reference, 1..4.
        period: Sampling time T [s].
        desired_order: Highest available derivative of y_d, at least max(r, 2), which is the
            default.
        response_order: Highest derivative of y_p that contains the response to forces;
            those above are those of y_d alone. With a constant force y_p is C^1 and its higher
            derivatives jump, by powers of d/m: with all of them, a loop of r = 4 with poles at
            -50 1/s has an error of 8 times the static deflection of Tab. 3.2, with the default, 2,
            of 14 %.
        revolution: Length of a closed path [m], the period of profiles over ``eta``.

    Raises:
        InputError: If a number is out of range.
    """

    def __init__(
        self,
        parameters: ImpedanceParameters,
        coordinates: Sequence[Coordinate],
        relative_degree: int,
        period: float,
        *,
        desired_order: int | None = None,
        response_order: int = 2,
        revolution: float | None = None,
    ) -> None:
        m, least = len(coordinates), max(relative_degree, 2)
        self.desired_order = least if desired_order is None else desired_order
        for name, value, allowed, is_allowed in [
            ("relative_degree", relative_degree, "1 to 4", 1 <= relative_degree <= 4),
            ("period", period, "a positive number of seconds", 0.0 < period < math.inf),
            ("desired_order", desired_order, f"{least} or more", self.desired_order >= least),
            ("response_order", response_order, "1 or more", response_order >= 1),
        ]:
            if not is_allowed:
                raise InputError(f"impedance filter, {name}: {value}; must be {allowed}")
        self.num_outputs, self.relative_degree, self.period = m, relative_degree, period
        self._response_order = min(response_order, relative_degree)
        self._across = indices(coordinates, Kind.TRANSVERSAL)
        self._names = [coordinate.name for coordinate in coordinates]
        used = {coordinate.kind: parameters.of(coordinate.kind) for coordinate in coordinates}
        # they may have been changed since their construction
        for part in (p for k in used.values() for p in (k.mass, k.damping, k.stiffness, k)):
            part.__post_init__()
        self._check_profiles(used)
        table = [[kind.mass, kind.damping, kind.stiffness] for kind in used.values()]
        round_trip = {
            c.name: revolution
            for c in coordinates
            if c.kind is Kind.TANGENTIAL and revolution is not None
        }
        self._profiles = [
            [(p.over if p.varies else _ACROSS, p.interpolant(round_trip.get(p.over))) for p in row]
            for row in table
        ]
        self._row = [list(used).index(coordinate.kind) for coordinate in coordinates]
        self.is_constant = not any(p.varies for row in table for p in row)
        self._constant = self._at(dict.fromkeys([*self._names, _ACROSS], ca.DM(0.0)))

    def _check_profiles(self, used: dict[Kind, CoordinateImpedance]) -> None:
        """Reject profiles over coordinates that the manifold does not have."""
        allowed = list(dict.fromkeys([*self._names, _ACROSS]))
        for kind, impedance in used.items():
            for name in ("mass", "damping", "stiffness"):
                profile = getattr(impedance, name)
                over = profile.over
                if profile.varies and over not in allowed:
                    raise InputError(
                        f"compliance.{kind.name.lower()}.{name}.over: {over!r}; must be one of "
                        f"{', '.join(allowed)}"
                    )

    def impedance(self, y: Any) -> Any:
        """Return masses, dampings, stiffnesses, shape (3 m,), at a virtual output y (m,)."""
        if self.is_constant:
            return self._constant
        x, across = dict(zip(self._names, ca.vertsplit(y), strict=True)), y[self._across]
        single = self._across.stop - self._across.start == 1
        return self._at(x | {_ACROSS: ca.fabs(across) if single else ca.norm_2(across)})

    def _at(self, x: dict[str, Any]) -> Any:
        rows = [[function(x[over]) for over, function in row] for row in self._profiles]
        return ca.vertcat(*[rows[i][k] for k in range(3) for i in self._row])

    def start(self, motion: Any) -> ImpedanceState:
        """Return the state with the motion ``[y_p, y_p']``, shape (2 m,)."""
        position, velocity = ca.vertsplit(motion, self.num_outputs)
        idle = ca.DM.zeros(self.num_outputs)
        return ImpedanceState(position, velocity, idle, self.impedance(position))

    def update(
        self, state: ImpedanceState, desired: Any, force: Any, impedance: Any = None
    ) -> tuple[ImpedanceState, Any]:
        """Return the state one period later, and the status of the inputs.

        Args:
            state: At the last tick.
            desired: Derivatives 0..desired_order of y_d by rows, shape (.. m,); y_p rests unless
                all are finite.
            force: Manifold forces [N, Nm], shape (m,); replaced by zero unless all are finite.
            impedance: Rows mass, damping, stiffness, shape (3 m,); replaced by the last one if
                invalid. The constant one if omitted.

        Returns:
            The state, and an :class:`ImpedanceStatus`.
        """
        T, valid = self.period, 1.0
        if impedance is None:
            impedance = self._constant
        else:
            valid = self._is_valid(impedance)
            impedance = where(valid, impedance, state.impedance)
        force_known, desired_known = all_finite(force), all_finite(desired)
        tau, y_d = where(force_known, force, 0.0), ca.vertsplit(desired, self.num_outputs)
        (a, b, c, d, p), rates = transition_of(impedance, T)
        e, e_1 = state.position - y_d[0], state.velocity - y_d[1]
        f = tau / ca.vertsplit(impedance, self.num_outputs)[MASS]
        position, velocity = self.extrapolate(desired)
        position += where(rates.compliant, a * e + b * e_1 + p * f, 0.0)
        velocity += where(rates.compliant, c * e + d * e_1 + b * f, 0.0)
        later = ImpedanceState(
            where(desired_known, position, state.position),
            where(desired_known, velocity, 0.0),
            tau,
            impedance,
        )
        status = (
            ImpedanceStatus.FORCE_NOT_FINITE * ca.logic_not(force_known)
            + ImpedanceStatus.IMPEDANCE_NOT_VALID * ca.logic_not(valid)
            + ImpedanceStatus.REFERENCE_NOT_FINITE * ca.logic_not(desired_known)
        )
        return later, status

    def extrapolate(self, desired: Any) -> tuple[Any, Any]:
        """Return y_d and y_d' extrapolated by one period, shapes (m,).

        Args:
            desired: Derivatives 0..desired_order of y_d by rows, shape (.. m,).
        """
        y_d = ca.vertsplit(desired, self.num_outputs)
        weights = [self.period**k / math.factorial(k) for k in range(self.desired_order + 1)]
        position = sum(w * row for w, row in zip(weights, y_d, strict=True))
        return position, sum(w * row for w, row in zip(weights, y_d[1:], strict=False))

    def push_to(self, state: ImpedanceState, speed: Any, force: Any, free: slice) -> Any:
        """Return the force that leads to given speeds of some coordinates, shape (m,).

        Args:
            state: State after :meth:`update` with ``force``.
            speed: Desired ``y_p'`` of these coordinates, shape of ``free`` [m/s].
            force: Force of that update, shape (m,).
            free: The coordinates; rigid ones keep their force.
        """
        (_, b, _, _, _), rates = transition_of(state.impedance, self.period)
        mass = ca.vertsplit(state.impedance, self.num_outputs)[MASS]
        # e'(T) contains b f / m
        more = (speed - state.velocity[free]) * mass[free] / b[free]
        parts = [force[: free.start], force[free], force[free.stop :]]
        parts[1] += where(rates.compliant[free], more, 0.0)
        return ca.vertcat(*parts)

    def _is_valid(self, impedance: Any) -> Any:
        """Return whether masses, dampings and stiffnesses are in their ranges."""
        mass, damping, stiffness = ca.vertsplit(impedance, self.num_outputs)
        return all_of(
            mass > 0.0, is_finite(mass), damping >= 0.0, is_finite(damping), stiffness >= 0.0
        )

    def reference(self, state: ImpedanceState, desired: Any) -> Any:
        """Return derivatives 0..r of y_p by rows, shape ((r + 1) m,).

        From the second on they are those at the end of the last interval, with its force and
        parameters. For the arguments see :meth:`update`.
        """
        y_d, rates = ca.vertsplit(desired, self.num_outputs), rates_of(state.impedance)
        mass = ca.vertsplit(state.impedance, self.num_outputs)[MASS]
        response = [state.position - y_d[0], state.velocity - y_d[1]]
        force = state.force / mass
        for _ in range(2, self._response_order + 1):
            response.append(force - rates.damping * response[-1] - rates.stiffness * response[-2])
            force = 0.0
        # a known motion is not rounded by a difference and a sum
        rows = [
            where(rates.compliant, state.position, y_d[0]),
            where(rates.compliant, state.velocity, y_d[1]),
        ]
        for k in range(2, self.relative_degree + 1):
            yielding = k <= self._response_order
            more = where(rates.compliant, response[k], 0.0) if yielding else 0.0
            rows.append(y_d[k] + more)
        return ca.vertcat(*rows[: self.relative_degree + 1])


# below these the roots of the characteristic polynomial lose digits that the series keeps
_SERIES_DAMPING, _SERIES_STIFFNESS, _SERIES_TERMS = 0.5, 0.25, 20


class Rates(NamedTuple):
    """Impedance per mass.

    Attributes:
        damping: ``d / m``, shape (m,) [1/s].
        stiffness: ``k / m``, zero where rigid, shape (m,) [1/s^2].
        compliant: 1 of coordinates that are not rigid, shape (m,).
    """

    damping: Any
    stiffness: Any
    compliant: Any


def rates_of(impedance: Any) -> Rates:
    """Return dampings and stiffnesses per mass.

    Args:
        impedance: Rows mass, damping, stiffness, shape (3 m,).
    """
    mass, damping, stiffness = ca.vertsplit(impedance, impedance.numel() // 3)
    compliant = stiffness < ca.inf
    return Rates(damping / mass, where(compliant, stiffness, 0.0) / mass, compliant)


def transition_of(impedance: Any, time: float) -> tuple[tuple[Any, ...], Rates]:
    """Return the :func:`transition` of all coordinates, and their rates.

    Args:
        impedance: Rows mass, damping, stiffness, shape (3 m,).
        time: T [s].
    """
    rates = rates_of(impedance)
    return transition(rates.damping, rates.stiffness, time), rates


def transition(damping: Any, stiffness: Any, time: float) -> tuple[Any, ...]:
    """Return the closed-form solution of ``e'' + damping e' + stiffness e = f``, f constant.

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
    oscillates, w = square < 0.0, ca.sqrt(ca.fabs(square))
    # two real roots, the slow one without cancellation
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
        where(oscillates, swing, real)
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
