"""Impedance filters: how the reference of the virtual output yields to forces."""

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Union

import casadi as ca
import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from pfsc_drake.blocks.cases import all_finite, all_of, first_of, is_finite, where
from pfsc_drake.control.compliance.impedance_transition import rates_of, transition_of
from pfsc_drake.control.compliance.slow_ends import SlowEnds
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.manifold import indices
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.schema_check import REQUIRED

MASS, DAMPING, STIFFNESS = range(3)
# what a profile over the size of all transversal coordinates goes over
_ACROSS = Kind.TRANSVERSAL.value
# relative; what misses the length of a lap by less is a lap
_ROUNDING = 1e-6


class ImpedanceStatus(enum.IntFlag):
    """What an update of the filter could not use."""

    OK = 0
    FORCE_NOT_FINITE = 1
    IMPEDANCE_NOT_VALID = 2
    REFERENCE_NOT_FINITE = 4


@dataclass
class Profile:
    """A parameter: constant, or cubic, C^1, monotone between breakpoints, constant outside.

    Over the arc length of a closed path it is periodic instead: cubic, C^1 and monotone from the
    last breakpoint to the first of the next lap, too.

    Attributes:
        value: The constant, if there are no breakpoints.
        over: Name of a coordinate, e.g. ``eta`` [m], or ``xi`` for the size of all transversal
            ones, e.g. ``|(xi_1, xi_2)|`` [m].
        at: Breakpoints, increasing; none or at least two.
        values: Values there.
    """

    value: float = 0.0
    over: str = "eta"
    at: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not self.value >= 0.0:
            raise InputError(f"value: {self.value}; must be zero or a positive number")
        if len(self.at) != len(self.values) or len(self.at) == 1:
            counts = f"values: {len(self.values)} at {len(self.at)} breakpoints"
            raise InputError(f"{counts}; as many, and none or at least two, are needed")
        if not (np.all(np.isfinite(self.at)) and np.all(np.diff(self.at) > 0.0)):
            raise InputError(f"at: {self.at}; must be finite and increasing")
        if not all(math.isfinite(v) and v >= 0.0 for v in self.values):
            raise InputError(f"values: {self.values}; must be finite, none negative")

    @property
    def varies(self) -> bool:
        """Whether it is no constant."""
        return bool(self.at)

    def interpolant(self, lap: float | None = None) -> Callable[[Any], Any]:
        """Return the parameter as a function of what it goes over, a number or an expression.

        Args:
            lap: Period of what it goes over, if it has one.

        Raises:
            InputError: If the breakpoints do not fit into a period, or the values at its two
                ends differ.
        """
        if not self.at:
            constant = self.value
            return lambda _: constant
        at, values = np.array(self.at), np.array(self.values)
        if lap is None:
            slopes = PchipInterpolator(at, values).derivative()(at)
            slopes[[0, -1]] = 0.0
        else:
            at, values, slopes = self._periodic(at, values, lap)
        pieces = CubicHermiteSpline(at, values, slopes).c.T
        begins = [ca.DM([begin, *piece]) for begin, piece in zip(at, pieces, strict=False)]
        ends, first, last, lowest = at[1:], float(at[0]), float(at[-1]), min(self.values)

        def value(x: Any) -> Any:
            if lap is not None:
                x = x - lap * ca.floor((x - first) / lap)
            x = first_of((x < first, first), (x > last, last), otherwise=x)
            cases = zip([x < end for end in ends], begins, strict=True)
            piece = first_of(*list(cases)[:-1], otherwise=begins[-1])
            x = x - piece[0]
            y = ((piece[1] * x + piece[2]) * x + piece[3]) * x + piece[4]
            return where(y < lowest, lowest, y)

        return value

    def _periodic(
        self, at: np.ndarray, values: np.ndarray, lap: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return breakpoints, values and slopes over one period, both its ends included."""
        span, rounding = float(at[-1] - at[0]), _ROUNDING * lap
        if span > lap + rounding:
            raise InputError(f"at: {self.at}; the closed path is {lap:.6g} m long")
        if span >= lap - rounding:
            if abs(values[-1] - values[0]) > _ROUNDING * max(values[0], values[-1]):
                raise InputError(
                    f"values: {self.values}; the last must be the first one, a lap of "
                    f"{lap:.6g} m later"
                )
            at, values = at[:-1], values[:-1]
        # the laps around tell the slopes at the seam
        around = np.concatenate([at - lap, at, at + lap])
        slopes = PchipInterpolator(around, np.tile(values, 3)).derivative()(at)
        return (
            np.append(at, at[0] + lap),
            np.append(values, values[0]),
            np.append(slopes, slopes[0]),
        )


# the first is what one without a tag means
Damping = Union[Profile, SlowEnds]  # noqa: UP007 (Drake's YAML needs it)


@dataclass
class CoordinateImpedance:
    """Mass, damping and stiffness of one kind of coordinate.

    Attributes:
        mass: ``m`` [kg or kg m^2], positive.
        damping: ``d`` [N s/m or Nm s/rad]; zero is allowed; ``!SlowEnds`` for (5.4).
        stiffness: ``k`` [N/m or Nm/rad]; zero is allowed, and infinity is position
            control: ``y_p = y_d``.
    """

    mass: Profile = field(default_factory=lambda: Profile(1.0), metadata=REQUIRED)
    damping: Damping = field(default_factory=Profile, metadata=REQUIRED)
    stiffness: Profile = field(default_factory=lambda: Profile(math.inf), metadata=REQUIRED)

    def __post_init__(self) -> None:
        masses = self.mass.values or [self.mass.value]
        if not all(0.0 < mass < math.inf for mass in masses):
            raise InputError(f"mass: {masses}; must be positive and finite")
        # profiles themselves refuse the rest
        if isinstance(self.damping, Profile) and not math.isfinite(self.damping.value):
            raise InputError(f"damping: {self.damping.value}; must be finite")


@dataclass
class ImpedanceParameters:
    """Impedance of all coordinates; those not given are position-controlled.

    Attributes:
        tangential: Of the tangential coordinates.
        transversal: Of the transversal ones.
        rotational: Of the angles.
    """

    tangential: CoordinateImpedance = field(default_factory=CoordinateImpedance)
    transversal: CoordinateImpedance = field(default_factory=CoordinateImpedance)
    rotational: CoordinateImpedance = field(default_factory=CoordinateImpedance)

    def on_path(self, length: float) -> "ImpedanceParameters":
        """Return them with the length of a path [m] where slow ends do not say one."""
        kinds = (self.tangential, self.transversal, self.rotational)
        return ImpedanceParameters(*(_on_path(kind, length) for kind in kinds))

    def of(self, kind: Kind) -> CoordinateImpedance:
        """Return the impedance of a kind of coordinates."""
        return {
            Kind.TANGENTIAL: self.tangential,
            Kind.TRANSVERSAL: self.transversal,
            Kind.ROTATIONAL: self.rotational,
        }[kind]


def _on_path(kind: CoordinateImpedance, length: float) -> CoordinateImpedance:
    if isinstance(kind.damping, SlowEnds) and kind.damping.length == 0.0:
        return replace(kind, damping=replace(kind.damping, length=length))
    return kind


class ImpedanceState(NamedTuple):
    """What an impedance remembers, numbers (``casadi.DM``) or expressions.

    Attributes:
        position: y_p, shape (m,) [m, rad].
        velocity: y_p', shape (m,) [m/s, rad/s].
        force: Of the last interval, shape (m,) [N, Nm].
        impedance: Rows mass, damping, stiffness of the last interval, shape (3 m,).
    """

    position: Any
    velocity: Any
    force: Any
    impedance: Any


class ImpedanceLaw:
    """Impedance ``m e'' + d e' + k e = tau``, ``e = y_p - y_d``, of every coordinate, sampled.

    For a path it is (3.42) for eta and xi, (3.44) for the angles. The state is the *motion itself*,
    y_p and y_p', with the force and the parameters of the last interval. Whatever
    changes - parameters, external reference, force - changes only how the motion goes on:
    e is formed anew at every tick and absorbs it. Hence no step in y_p or y_p'.

    Over an interval e obeys its differential equation with force and parameters held, solved
    exactly (:mod:`~pfsc_drake.control.compliance.impedance_transition`); ``y_d`` goes on by its
    Taylor polynomial of order ``desired_order``. What that misses acts like a disturbance of e: on
    a sine of 1 m, 5 rad/s, 3e-5 m for order 2 and 6e-11 m for order 4 with Tab. 3.2, and
    5e-3 m and 1e-8 m for a free mass. Order 2 is the least, for (3.42) contains ``y_d''``.

    ``k = inf`` is position control; when a coordinate becomes rigid, y_p steps to y_d.
    With constant parameters the filter is passive: ``tau . (e(T) - e(0))`` is at least the
    change of ``(m e'^2 + k e^2) / 2``. A stiffness that grows while deflected adds energy.

    Args:
        parameters: Masses, dampings, stiffnesses.
        coordinates: The m coordinates of the virtual output.
        relative_degree: r of the law that follows the reference, 1..4.
        period: Sampling time T [s].
        desired_order: Highest derivative of y_d that is given, at least max(r, 2), which
            is the default.
        response_order: Highest derivative of y_p that contains the response to forces;
            those above are y_d's alone. With the force held y_p is C^1 and its higher
            derivatives jump, by powers of d/m: fed with all of them, a loop of r = 4 with
            poles at -50 1/s errs by 8 times the static deflection of Tab. 3.2, with the
            default, 2, by 14 %.
        lap: Length of a closed path [m], over which profiles over ``eta`` are periodic.

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
        lap: float | None = None,
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
        # they may have been changed since they were made
        for part in (p for k in used.values() for p in (k.mass, k.damping, k.stiffness, k)):
            part.__post_init__()
        self._check_profiles(used)
        table = [[kind.mass, kind.damping, kind.stiffness] for kind in used.values()]
        round_trip = {
            c.name: lap for c in coordinates if c.kind is Kind.TANGENTIAL and lap is not None
        }
        self._profiles = [
            [(p.over if p.varies else _ACROSS, p.interpolant(round_trip.get(p.over))) for p in row]
            for row in table
        ]
        self._row = [list(used).index(coordinate.kind) for coordinate in coordinates]
        self.is_constant = not any(p.varies for row in table for p in row)
        self._constant = self._at(dict.fromkeys([*self._names, _ACROSS], ca.DM(0.0)))

    def _check_profiles(self, used: dict[Kind, CoordinateImpedance]) -> None:
        """Refuse profiles over something that the manifold does not have."""
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
        """Return a state that moves on from ``[y_p, y_p']``, shape (2 m,)."""
        position, velocity = ca.vertsplit(motion, self.num_outputs)
        idle = ca.DM.zeros(self.num_outputs)
        return ImpedanceState(position, velocity, idle, self.impedance(position))

    def update(
        self, state: ImpedanceState, desired: Any, force: Any, impedance: Any = None
    ) -> tuple[ImpedanceState, Any]:
        """Return the state one period later, and what of the inputs could not be used.

        Args:
            state: At the last tick.
            desired: Derivatives 0..desired_order of y_d by rows, shape (.. m,); unless all are
                finite, y_p rests.
            force: Manifold forces [N, Nm], shape (m,); unless all are finite, zero.
            impedance: Rows mass, damping, stiffness, shape (3 m,); unless valid, the last. The
                constant one if omitted.

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
        weights = [T**k / math.factorial(k) for k in range(self.desired_order + 1)]
        position = sum(w * row for w, row in zip(weights, y_d, strict=True))
        velocity = sum(w * row for w, row in zip(weights, y_d[1:], strict=False))
        position += where(rates.yields, a * e + b * e_1 + p * f, 0.0)
        velocity += where(rates.yields, c * e + d * e_1 + b * f, 0.0)
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

    def push_to(self, state: ImpedanceState, speed: Any, force: Any, free: slice) -> Any:
        """Return the force after which some coordinates have other speeds, shape (m,).

        Args:
            state: What :meth:`update` made of a force.
            speed: ``y_p'`` that they are to have, shape of ``free`` [m/s].
            force: That force, shape (m,).
            free: Which coordinates; those that are rigid keep their force.
        """
        (_, b, _, _, _), rates = transition_of(state.impedance, self.period)
        mass = ca.vertsplit(state.impedance, self.num_outputs)[MASS]
        # e'(T) contains b f / m
        more = (speed - state.velocity[free]) * mass[free] / b[free]
        parts = [force[: free.start], force[free], force[free.stop :]]
        parts[1] += where(rates.yields[free], more, 0.0)
        return ca.vertcat(*parts)

    def _is_valid(self, impedance: Any) -> Any:
        """Return whether masses, dampings and stiffnesses are what they can be."""
        mass, damping, stiffness = ca.vertsplit(impedance, self.num_outputs)
        return all_of(
            mass > 0.0, is_finite(mass), damping >= 0.0, is_finite(damping), stiffness >= 0.0
        )

    def reference(self, state: ImpedanceState, desired: Any) -> Any:
        """Return derivatives 0..r of y_p by rows, shape ((r + 1) m,).

        From the second on they are those at the last interval's end, with its force and
        parameters. For the arguments see :meth:`update`.
        """
        y_d, rates = ca.vertsplit(desired, self.num_outputs), rates_of(state.impedance)
        mass = ca.vertsplit(state.impedance, self.num_outputs)[MASS]
        response = [state.position - y_d[0], state.velocity - y_d[1]]
        force = state.force / mass
        for _ in range(2, self._response_order + 1):
            response.append(force - rates.damping * response[-1] - rates.stiffness * response[-2])
            force = 0.0
        # a motion that is known is not rounded by a difference and a sum
        rows = [
            where(rates.yields, state.position, y_d[0]),
            where(rates.yields, state.velocity, y_d[1]),
        ]
        for k in range(2, self.relative_degree + 1):
            yielding = k <= self._response_order
            more = where(rates.yields, response[k], 0.0) if yielding else 0.0
            rows.append(y_d[k] + more)
        return ca.vertcat(*rows[: self.relative_degree + 1])
