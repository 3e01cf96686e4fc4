"""Masses, dampings and stiffnesses of an impedance, constant or varying over a manifold."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import casadi as ca
import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from pfsc_drake.blocks.cases import first_of, where
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.errors import InputError, require
from pfsc_drake.yaml.fields import REQUIRED
from pfsc_drake.yaml.rules import NotNegative, Numbers, Parameters, Positive, Range

# relative tolerance of the length of a revolution
_ROUNDING = 1e-6


# of masses, dampings and stiffnesses; the owner of the profile decides which
_UNIT, _LARGEST = "kg, N s/m or N/m", 1e10


@dataclass
class Profile(Parameters):
    """A parameter: constant, or cubic, C^1, monotone between breakpoints, constant outside.

    Over the arc length of a closed path it is periodic instead: cubic, C^1 and monotone from the
    last breakpoint to the first of the next revolution, too.

    Attributes:
        value: The constant, if there are no breakpoints.
        over: Name of a coordinate, e.g. ``eta`` [m], or ``xi`` for the size of all transversal
            ones, e.g. ``|(xi_1, xi_2)|`` [m].
        at: Breakpoints, increasing; none or at least two.
        values: Values there.
    """

    value: Annotated[float, Range(0.0, _LARGEST, _UNIT, infinite=True)] = 0.0
    over: str = "eta"
    at: list[float] = field(default_factory=list)
    values: Annotated[list[float], Numbers(each=Range(0.0, _LARGEST, _UNIT))] = field(
        default_factory=list
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.at) != len(self.values) or len(self.at) == 1:
            counts = f"values: {len(self.values)} at {len(self.at)} breakpoints"
            raise InputError(f"{counts}; as many, and none or at least two, are needed")
        if not (np.all(np.isfinite(self.at)) and np.all(np.diff(self.at) > 0.0)):
            raise InputError(f"at: {self.at}; must be finite and increasing")

    @property
    def varies(self) -> bool:
        """Whether it is no constant."""
        return bool(self.at)

    def interpolant(self, revolution: float | None = None) -> Callable[[Any], Any]:
        """Return the parameter as a function of its coordinate, a number or an expression.

        Args:
            revolution: Period of the coordinate; None if it is not periodic.

        Raises:
            InputError: If the breakpoints do not fit into a period, or the values at its two
                ends differ.
        """
        if not self.at:
            constant = self.value
            return lambda _: constant
        at, values = np.array(self.at), np.array(self.values)
        if revolution is None:
            slopes = PchipInterpolator(at, values).derivative()(at)
            slopes[[0, -1]] = 0.0
        else:
            at, values, slopes = self._periodic(at, values, revolution)
        pieces = CubicHermiteSpline(at, values, slopes).c.T
        begins = [ca.DM([begin, *piece]) for begin, piece in zip(at, pieces, strict=False)]
        ends, first, last, lowest = at[1:], float(at[0]), float(at[-1]), min(self.values)

        def value(x: Any) -> Any:
            if revolution is not None:
                x = x - revolution * ca.floor((x - first) / revolution)
            x = first_of((x < first, first), (x > last, last), otherwise=x)
            cases = zip([x < end for end in ends], begins, strict=True)
            piece = first_of(*list(cases)[:-1], otherwise=begins[-1])
            x = x - piece[0]
            y = ((piece[1] * x + piece[2]) * x + piece[3]) * x + piece[4]
            return where(y < lowest, lowest, y)

        return value

    def _periodic(
        self, at: np.ndarray, values: np.ndarray, revolution: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return breakpoints, values and slopes over one period, both its ends included."""
        span, rounding = float(at[-1] - at[0]), _ROUNDING * revolution
        if span > revolution + rounding:
            raise InputError(f"at: {self.at}; the closed path is {revolution:.6g} m long")
        if span >= revolution - rounding:
            if abs(values[-1] - values[0]) > _ROUNDING * max(values[0], values[-1]):
                raise InputError(
                    f"values: {self.values}; the last must be the first one, a revolution of "
                    f"{revolution:.6g} m later"
                )
            at, values = at[:-1], values[:-1]
        # the neighbouring revolutions determine the slopes at the seam
        around = np.concatenate([at - revolution, at, at + revolution])
        slopes = PchipInterpolator(around, np.tile(values, 3)).derivative()(at)
        return (
            np.append(at, at[0] + revolution),
            np.append(values, values[0]),
            np.append(slopes, slopes[0]),
        )


@dataclass
class SlowEnds(Parameters):
    """Damping over the arc length, large next to the ends of a path (5.4), as printed.

    ::

        d(eta) = d_min + (d_max - d_min) (3 - 2 tanh(40 eta) + tanh(80 (eta - eta_max)))

    The bracket is 2 at the start, where ``d = 2 d_max - d_min``, and not 1 as its name suggests;
    it is 0 in between and 1 at the end, where ``d = d_max``. Beyond the ends it rises further, to
    ``4 (d_max - d_min) + d_min`` before the start and ``2 d_max - d_min`` after the end. It is
    positive on paths of any length, and C^infinity.

    Attributes:
        least: ``d_min``, in the middle of a long path [N s/m].
        most: ``d_max``, at its end [N s/m], not less.
        start_rate: Rate of change at the start [1/m]; 40 as printed.
        end_rate: Rate of change at the end [1/m]; 80 as printed.
        length: ``eta_max`` [m]; 0 for the length of the path.
    """

    least: NotNegative = 90.0
    most: float = 3000.0
    start_rate: Positive = 40.0
    end_rate: Positive = 80.0
    length: NotNegative = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.least <= self.most < math.inf, "most", self.most, f"{self.least:g} or more")

    @property
    def over(self) -> str:
        """Name of its coordinate."""
        return "eta"

    @property
    def varies(self) -> bool:
        """Whether it is no constant."""
        return self.most > self.least

    def interpolant(self, revolution: float | None = None) -> Callable[[Any], Any]:
        """Return the damping as a function of the arc length [m], a number or an expression.

        Args:
            revolution: Length of a closed path, which has no ends; None for an open one.

        Raises:
            InputError: If the path is closed, or its length is not known.
        """
        if revolution is not None:
            raise InputError("!SlowEnds: the path is closed and has no ends; allowed: open paths")
        if self.length == 0.0:
            raise InputError("!SlowEnds: length = 0; must be positive without a path")
        least, span, length = self.least, self.most - self.least, self.length
        start_rate, end_rate = self.start_rate, self.end_rate

        def value(eta: Any) -> Any:
            slow = 3.0 - 2.0 * ca.tanh(start_rate * eta)
            return least + span * (slow + ca.tanh(end_rate * (eta - length)))

        return value


# the first is the type of an entry without a tag
Damping = Profile | SlowEnds


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
        # profiles themselves check the rest
        if isinstance(self.damping, Profile) and not math.isfinite(self.damping.value):
            raise InputError(f"damping: {self.damping.value}; must be finite")


@dataclass
class ImpedanceParameters:
    """Impedance of all coordinates; omitted ones are position-controlled.

    Attributes:
        tangential: Impedance of the tangential coordinates.
        transversal: Impedance of the transversal coordinates.
        rotational: Impedance of the angles.
    """

    tangential: CoordinateImpedance = field(default_factory=CoordinateImpedance)
    transversal: CoordinateImpedance = field(default_factory=CoordinateImpedance)
    rotational: CoordinateImpedance = field(default_factory=CoordinateImpedance)

    def on_path(self, length: float) -> "ImpedanceParameters":
        """Return the parameters with the length of a path [m] for slow ends without a length."""
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
