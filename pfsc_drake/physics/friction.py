"""Dry and viscous joint friction with true sticking."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from pfsc_drake.checks import checked_vector
from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive


@dataclass(frozen=True, eq=False)
class BristleFriction:
    """Coulomb and viscous friction (2.34), (2.41) behind a bristle of finite stiffness.

    The dry part of (2.34) is Coulomb's law in its set-valued form, on the velocity with
    which the tips of the bristles slip::

        f_d in f_c Sgn(v - delta s'),   f_d = f_c (s + tau s'),   tau_f = f_d + f_v v

    with the deflection ``s`` of the bristles in units of the presliding displacement
    ``delta``. Solved for ``s'`` this is an ordinary differential equation with a
    Lipschitz right side and without a switch::

        f_d = f_c sat(s + tau v / delta),   s' = (sat(s + tau v / delta) - s) / tau

    where ``sat`` limits to [-1, 1]. Properties:

    - **Stick**: as long as ``|f_d| < f_c`` holds, ``s' = v / delta``: the bristles are a
      spring of stiffness ``f_c / delta`` and a damper, the tips do not move at all. Under
      any constant load below ``f_c`` the joint comes to rest, velocity 0 and not merely
      small; oscillating loads cause no drift. Under a slowly changing load the deflection is
      ``delta / f_c`` per Nm; a step load of 0.95 ``f_c`` overshoots and slips once, to rest after
      about 2.4 ``delta`` (with the defaults below).
    - **Break-away** at ``f_c``; the dry part never exceeds it.
    - **Slip**: ``f_d = f_c sign(v)`` exactly, at every velocity, once the bristles are
      bent (``|s| = 1``), hence (2.34).
    - **Passive**: ``tau_f v - d/dt(f_c delta s^2 / 2) >= 0`` always.
    - **Not stiff**: the fastest rate of ``s`` is 1/tau at any sliding velocity, unlike in the
      models of Dahl or LuGre, where it grows with ``|v| / delta``.

    All arrays have shape (N,); the units are those of a revolute joint, for a slide m instead of
    rad and N instead of Nm.

    Attributes:
        coulomb: ``f_c`` [Nm], not negative; 0 for a joint without dry friction.
        viscous: ``f_v`` [Nm s/rad], not negative.
        presliding: ``delta`` [rad], positive.
        relaxation: ``tau`` [s], positive.

    Raises:
        InputError: If the shapes differ or a value is out of range.
    """

    coulomb: np.ndarray
    viscous: np.ndarray
    presliding: np.ndarray
    relaxation: np.ndarray

    def __post_init__(self) -> None:
        size = np.size(self.coulomb)
        for name in ("coulomb", "viscous", "presliding", "relaxation"):
            positive = name in ("presliding", "relaxation")
            object.__setattr__(
                self,
                name,
                checked_vector("friction", name, getattr(self, name), size, positive=positive),
            )

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return self.coulomb.size

    @property
    def stiffness(self) -> np.ndarray:
        """Stiffness of the bristles ``f_c / delta`` [Nm/rad], shape (N,)."""
        return self.coulomb / self.presliding

    @cached_property
    def _bound(self) -> BoundFunction:
        """``(s, v) -> (torque, rate)``; evaluated in every stage of an integration."""
        s, v = ca.SX.sym("s", self.dimension), ca.SX.sym("v", self.dimension)
        # unlike a minimum, a comparison lets NaN through
        bent = s + (self.relaxation / self.presliding) * v
        bent = ca.if_else(bent < -1.0, -1.0, bent)
        bent = ca.if_else(bent > 1.0, 1.0, bent)
        results = [self.coulomb * bent + self.viscous * v, (bent - s) / self.relaxation]
        dense = [ca.densify(result) for result in results]
        return BoundFunction(ca.Function("bristles", [s, v], dense, ["s", "v"], ["torque", "rate"]))

    def _evaluate(self, s: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
        bound = self._bound
        bound.arguments["s"][:], bound.arguments["v"][:] = s, v
        bound.evaluate()
        return bound.results

    def torque(self, s: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return ``tau_f`` [Nm], shape (N,), positive against a positive velocity.

        Args:
            s: Deflection of the bristles, shape (N,).
            v: Velocity [rad/s], shape (N,).
        """
        return self._evaluate(s, v)["torque"].copy()

    def rate(self, s: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return ``s'`` [1/s], shape (N,).

        Args:
            s: Deflection of the bristles, shape (N,).
            v: Velocity [rad/s], shape (N,).
        """
        return self._evaluate(s, v)["rate"].copy()

    def energy(self, s: np.ndarray) -> np.ndarray:
        """Return the energy of the bristles, ``f_c delta s^2 / 2`` [J], shape (N,).

        Args:
            s: Deflection of the bristles, shape (N,).
        """
        return 0.5 * self.coulomb * self.presliding * s**2

    def deflection(self, torque: np.ndarray) -> np.ndarray:
        """Return the deflection that holds a load at rest, limited to [-1, 1], shape (N,).

        Args:
            torque: Load that friction balances [Nm], shape (N,).
        """
        load = np.asarray(torque, dtype=float)
        limit = np.where(self.coulomb > 0.0, self.coulomb, np.inf)
        return np.clip(load / limit, -1.0, 1.0)


@dataclass
class FrictionDrift(Parameters):
    """Linear change of friction during a run, e.g. of a gear that warms up.

    Attributes:
        factor: Final friction relative to the initial one, positive.
        begin: Begin of the change [s].
        end: End of the change [s], after ``begin``.

    Raises:
        InputError: If a number is out of range.
    """

    factor: Positive = 1.0
    begin: NotNegative = 0.0
    end: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.begin < self.end < np.inf:
            raise InputError(
                f"begin = {self.begin} s, end = {self.end} s; must be 0 <= begin < end, finite"
            )

    def scale(self, t: float | np.ndarray) -> np.ndarray:
        """Return the friction relative to the initial one.

        Args:
            t: Time or times [s].
        """
        return np.asarray(np.interp(t, [self.begin, self.end], [1.0, self.factor]))


def bristles_for_step(
    coulomb: np.ndarray,
    viscous: np.ndarray,
    inertia: np.ndarray,
    step: float,
    *,
    frequency: float = 1.0,
    damping: float = 1.0,
    smallest: float = 1e-6,
) -> BristleFriction:
    """Return friction with the stiffest bristles that an integration step allows.

    A stuck inertia J oscillates with ``omega = sqrt(f_c / (delta J))`` and the damping ratio
    ``tau omega / 2``. Given ``omega h = frequency`` this makes::

        delta = f_c h^2 / (J frequency^2),   tau = 2 damping h / frequency

    Explicit integration of a continuous plant with RK3 or RK5 at a fixed step h takes the
    default (omega h = 1, poles at -1/h, which RK3 damps by 1/3 per step). A discrete plant
    that reads the torque at its ticks needs ``frequency=0.5``, four times the displacement:
    stability requires ``2 damping omega h < 2 - (omega h)^2 / 2``. Examples at h = 1 ms:
    5 N on 1.5 kg 3.3 um, 102 Nm on 5 kg m^2 21 urad, 3.7 Nm on 0.06 kg m^2 63 urad.

    Args:
        coulomb: ``f_c`` [Nm], shape (N,).
        viscous: ``f_v`` [Nm s/rad], shape (N,).
        inertia: Smallest inertia at the drive [kg m^2], shape (N,): ``D_M``,
            for elastic as for rigid joints (it bounds the rigid robot's from below); the
            mass of a slide.
        step: Integration step or sampling time h [s].
        frequency: ``omega h``, in (0, 1.5].
        damping: Damping ratio of the stuck inertia; larger inertias are damped less.
        smallest: Lower limit of ``delta`` [rad], for joints with little friction.

    Raises:
        InputError: If an argument is out of range.
    """
    size = np.size(coulomb)
    f_c = checked_vector("friction", "coulomb", coulomb, size, positive=False)
    J = checked_vector("friction", "inertia", inertia, size, positive=True)
    options = {"step": step, "frequency": frequency, "damping": damping, "smallest": smallest}
    for name, value in options.items():
        if not 0.0 < value < np.inf:
            raise InputError(f"friction: {name} = {value!r}; must be positive and finite")
    if frequency > 1.5:
        raise InputError(f"friction: frequency = {frequency!r}; must be at most 1.5")
    delta = np.maximum(f_c * step**2 / (J * frequency**2), smallest)
    return BristleFriction(f_c, viscous, delta, np.full(size, 2.0 * damping * step / frequency))
