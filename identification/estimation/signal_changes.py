"""Signals without an assumed mistake in sign, order or unit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

_DEGREES = 180.0 / np.pi
# largest number of joints for which all combinations of signs are tried
_MOST_SIGNS = 8


@dataclass(frozen=True, eq=False)
class SignalChange:
    """Change of the signals of N joints that undoes a mistake.

    Attributes:
        cause: The mistake, in words; empty without.
        steps: Number of wrong signals; the larger, the less likely.
        order: Joint that each joint's positions come from, shape (N,).
        factors: Factors of the positions, shape (N,).
        rate: Additional factor of the velocities; its square is the factor of the accelerations.
        torque_order: Joint that each joint's torques come from, shape (N,).
        torque_factors: Factors of the torques, shape (N,).
    """

    cause: str
    steps: float
    order: np.ndarray
    factors: np.ndarray
    rate: float
    torque_order: np.ndarray
    torque_factors: np.ndarray

    @classmethod
    def nothing(cls, joints: int) -> "SignalChange":
        """Return the change without a mistake.

        Args:
            joints: Number N of joints.
        """
        order, ones = np.arange(joints), np.ones(joints)
        return cls("", 0.0, order, ones, 1.0, order.copy(), ones.copy())

    @property
    def motion(self) -> tuple[bytes, ...]:
        """Key that is equal for changes with the same effect on the motion."""
        return self.order.tobytes(), self.factors.tobytes(), np.float64(self.rate).tobytes()

    def of_motion(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the changed positions, velocities and accelerations, each (K, N)."""
        rates = 1.0, self.rate, self.rate**2
        return tuple(
            x[:, self.order] * self.factors * rate for x, rate in zip((q, v, a), rates, strict=True)
        )

    def of_torques(self, tau: np.ndarray) -> np.ndarray:
        """Return the changed torques, shape (K, N)."""
        return tau[:, self.torque_order] * self.torque_factors

    def of_noise(self, deviation: np.ndarray) -> np.ndarray:
        """Return the changed standard deviations of torques, shape (N,)."""
        return deviation[self.torque_order] * np.abs(self.torque_factors)


def likely_changes(names: Sequence[str], units: Sequence[str]) -> Iterator[SignalChange]:
    """Yield changes that undo common mistakes.

    Args:
        names: Names of N joints.
        units: ``rad`` or ``m`` of each.
    """
    n = len(names)
    nothing = SignalChange.nothing(n)
    for group in _sign_groups(n):
        whose = "all joints" if len(group) == n else " and ".join(names[j] for j in group)
        has = "have" if len(group) > 1 else "has"
        yield replace(
            nothing,
            cause=f"tau of {whose} {has} the wrong sign",
            steps=1.0 if len(group) == n else float(len(group)),
            torque_factors=_with(n, group, -1.0),
        )
    for i, j in combinations(range(n), 2):
        order = nothing.order.copy()
        order[[i, j]] = j, i
        pair, swapped = f"{names[i]} and {names[j]}", replace(nothing, steps=1.0)
        yield replace(swapped, cause=f"tau of {pair} are exchanged", torque_order=order)
        for group in ([i], [j], [i, j]):
            yield replace(
                swapped,
                cause=f"tau of {pair} are exchanged, "
                f"{' and '.join(names[k] for k in group)} with the wrong sign",
                steps=1.0 + len(group),
                torque_order=order,
                torque_factors=_with(n, group, -1.0),
            )
        yield replace(swapped, cause=f"q of {pair} are exchanged", order=order)
        both = f"q and tau of {pair} are exchanged"
        yield replace(swapped, cause=both, order=order, torque_order=order)
    for group in [*([j] for j in range(n)), *([range(n)] if n > 1 else [])]:
        whose = "all joints" if len(group) > 1 else names[group[0]]
        turned, has = _with(n, group, -1.0), "have" if len(group) > 1 else "has"
        one = replace(nothing, steps=1.0, factors=turned)
        yield replace(one, cause=f"q of {whose} {has} the wrong sign")
        both = f"q and tau of {whose} count the other way than the model"
        yield replace(one, cause=both, torque_factors=turned)
    yield from _units(nothing, names, units)


def _units(
    nothing: SignalChange, names: Sequence[str], units: Sequence[str]
) -> Iterator[SignalChange]:
    """Yield changes of the units of angles and of time."""
    n, turning = len(names), [j for j, unit in enumerate(units) if unit == "rad"]
    groups = [[j] for j in turning] + ([turning] if len(turning) > 1 else [])
    for group in groups:
        whose = "all turning joints" if len(group) > 1 else names[group[0]]
        for factor, words in ((_DEGREES, "rad, not in deg"), (1.0 / _DEGREES, "deg, not in rad")):
            cause = f"q of {whose} is in {words}"
            yield replace(nothing, cause=cause, steps=1.0, factors=_with(n, group, factor))
    yield replace(nothing, cause="t is in ms, not in s", steps=1.0, rate=1e3)
    yield replace(nothing, cause="t is in s, not in ms", steps=1.0, rate=1e-3)


def _sign_groups(joints: int) -> Iterator[Sequence[int]]:
    most = joints if joints <= _MOST_SIGNS else 2
    for size in range(1, most + 1):
        yield from combinations(range(joints), size)
    if most < joints:
        yield range(joints)


def _with(joints: int, group: Sequence[int], value: float) -> np.ndarray:
    factors = np.ones(joints)
    factors[list(group)] = value
    return factors
