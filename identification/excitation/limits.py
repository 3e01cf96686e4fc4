"""Limits of a robot's joints, and the shares of them that a motion uses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from identification.model.subject import Subject
from pfsc_drake.errors import InputError, shorten

# for all joints, or by names of joints
LimitValues = ArrayLike | Mapping[str, ArrayLike]


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of N joints.

    Attributes:
        position: Lower and upper limits [rad or m], shape (N, 2).
        velocity: Magnitudes [rad/s or m/s], shape (N,).
        acceleration: Magnitudes [rad/s^2 or m/s^2], shape (N,).
        effort: Magnitudes of the drives' torques [Nm or N], shape (N,); infinite if unknown.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        """Middles of the position limits [rad or m], shape (N,)."""
        return self.position.mean(axis=1)

    @property
    def reach(self) -> np.ndarray:
        """Distances from the middles to the limits [rad or m], shape (N,)."""
        return (self.position[:, 1] - self.position[:, 0]) / 2.0

    def shrink(self, share: float) -> "JointLimits":
        """Return a share of the limits, about the middles of the positions."""
        reach = share * self.reach
        return JointLimits(
            np.column_stack([self.middle - reach, self.middle + reach]),
            share * self.velocity,
            share * self.acceleration,
            share * self.effort,
        )


def chosen_limits(
    subject: Subject, limits: "JointLimits | Mapping[str, LimitValues] | None" = None
) -> JointLimits:
    """Return a robot's limits, from its model or as specified.

    Args:
        subject: The robot.
        limits: All of them; or ``position`` [rad or m], shape (N, 2), lower and upper, and
            ``velocity``, ``acceleration`` [per s, per s^2] and ``effort`` [Nm or N], shape (N,) or
            one number for all joints; or by names of joints, ``{"velocity": {"joint_2": 1.0}}``.

    Raises:
        InputError: If a limit or joint is unknown, a value out of range, or one is neither in the
            model nor specified. Effort alone may be unknown.
    """
    n, names = subject.dimension, subject.joint_names
    if isinstance(limits, JointLimits):
        if limits.velocity.size != n:
            raise InputError(f"limits: of {limits.velocity.size} joints; {subject.name} has {n}")
        return limits
    own = {
        "position": subject.position_limits,
        "velocity": subject.velocity_limit,
        "acceleration": subject.acceleration_limit,
        "effort": subject.effort_limit,
    }
    chosen = dict(limits or {})
    for key in chosen:
        if key not in own:
            raise InputError(f"limits: {shorten(key)!r}; must be one of {', '.join(own)}")
    values = {
        key: _joint_values(subject, key, chosen.get(key, array), array)
        for key, array in own.items()
    }
    unbounded = np.flatnonzero(~np.isfinite(values["position"]).all(axis=1))
    if unbounded.size:
        _refuse_unknown(subject, "position", [names[i] for i in unbounded])
    for name, (lower, upper) in zip(names, values["position"], strict=True):
        if not lower < upper:
            raise InputError(
                f"position limits of {name} = [{lower:g}, {upper:g}]; lower must be below upper"
            )
    for key in ("velocity", "acceleration"):
        unknown = [name for name, x in zip(names, values[key], strict=True) if np.isinf(x)]
        if unknown:
            _refuse_unknown(subject, key, unknown)
    for key in ("velocity", "acceleration", "effort"):
        for name, x in zip(names, values[key], strict=True):
            if not x > 0.0:
                raise InputError(f"{key} limit of {name} = {x:g}; must be positive")
    return JointLimits(**values)


def _joint_values(subject: Subject, key: str, value: LimitValues, own: np.ndarray) -> np.ndarray:
    """Return one kind of limits of all joints, in the shape of the model's."""
    if isinstance(value, Mapping):
        table = own.copy()
        for joint, entry in value.items():
            i, where = _joint(subject, joint, f"{key} limits"), f"{key} limit of {joint}"
            row = numbers(where, entry)
            if row.shape != table[i].shape:
                raise InputError(f"{where}: shape {row.shape}; must be {table[i].shape}")
            table[i] = row
        return table
    n, array = subject.dimension, numbers(f"{key} limits", value)
    if key == "position" and array.shape != (n, 2):
        raise InputError(f"position limits: shape {array.shape}; must be ({n}, 2), lower and upper")
    if key != "position" and array.shape not in ((), (1,), (n,)):
        raise InputError(f"{key} limits: shape {array.shape}; must be one number or {n}")
    return np.broadcast_to(array, own.shape).copy()


def numbers(name: str, value: ArrayLike) -> np.ndarray:
    """Return an array of numbers; raises InputError with the name for anything else."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {shorten(repr(value))}; must be numbers") from None


def _joint(subject: Subject, joint: str, where: str) -> int:
    if joint not in subject.joint_names:
        raise InputError(
            f"{where}: {subject.name} has no joint {shorten(str(joint))!r}; must be one of "
            f"{', '.join(subject.joint_names)}"
        )
    return subject.joint_names.index(joint)


def _refuse_unknown(subject: Subject, key: str, joints: Sequence[str]) -> None:
    raise InputError(
        f"{subject.name}: the model has no {key} limits of {', '.join(joints)}; give them"
    )


def used_shares(
    limits: JointLimits, motion: tuple[np.ndarray, np.ndarray, np.ndarray], tau: np.ndarray
) -> Mapping[str, np.ndarray]:
    """Return the largest share of each limit that a motion uses, 1 being the limit.

    Args:
        limits: Limits of the robot.
        motion: Positions, velocities and accelerations, each of shape (K, N).
        tau: Predicted torques of the drives [Nm or N], shape (K, N).

    Returns:
        ``position`` (of the distance from the middle), ``velocity``, ``acceleration`` and
        ``effort``, each of shape (N,).
    """
    q, v, a = motion
    used = {
        "position": (q - limits.middle) / limits.reach,
        "velocity": v / limits.velocity,
        "acceleration": a / limits.acceleration,
        "effort": tau / limits.effort,
    }
    return {key: np.abs(share).max(axis=0) for key, share in used.items()}
