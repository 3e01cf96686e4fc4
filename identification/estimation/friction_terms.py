"""Friction beyond Coulomb and viscous friction, in terms with unknown factors.

To ``f_c sign(v) + f_v v`` of (2.41) each joint may add

=============== =========================== =======================================================
``stribeck``    ``sign(v) exp(-(v / w)^2)`` more friction at low velocity than Coulomb's, within w
``offset``      ``1``                       Coulomb friction that differs between the directions
``slant``       ``|v|``                     viscous friction that differs between the directions
``saturation``  ``tanh(v / w)``             viscous friction that grows no further beyond w
``quadratic``   ``v |v|``                   viscous friction that grows or falls with velocity
=============== =========================== =======================================================

Each is a torque against the motion; the factors are linear parameters like those of
:mod:`~identification.model.dynamic_parameters`, the widths w are not and need a search.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.model.base import BaseParameters
from pfsc_drake.errors import InputError, shorten

# parameter name of each kind, and power of the velocity in its unit
_NAMES = {
    "stribeck": "f_s",
    "offset": "f_o",
    "slant": "f_a",
    "saturation": "f_t",
    "quadratic": "f_q",
}
_POWERS = {"stribeck": 0, "offset": 0, "slant": 1, "saturation": 0, "quadratic": 2}
KINDS = tuple(_NAMES)
KINDS_WITH_WIDTH = ("stribeck", "saturation")


@dataclass(frozen=True)
class FrictionTerm:
    """A term of the friction of one joint.

    Attributes:
        joint: Index of the joint, from 0.
        kind: One of :data:`KINDS`.
        width: w [rad/s or m/s] of a kind that has one, else None.

    Raises:
        InputError: If the kind is unknown, or its width is missing, needless or not positive.
    """

    joint: int
    kind: str
    width: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(
                f"friction term {shorten(repr(self.kind))}: must be one of {', '.join(KINDS)}"
            )
        if self.has_width != (self.width is not None):
            required = "is required" if self.has_width else "is not allowed"
            raise InputError(f"friction term {self.kind}: width = {self.width}; one {required}")
        if self.width is not None and not 0.0 < self.width < np.inf:
            raise InputError(f"friction term {self.kind}: width = {self.width}; must be positive")

    @property
    def has_width(self) -> bool:
        """Whether the kind has a width."""
        return self.kind in KINDS_WITH_WIDTH

    @property
    def name(self) -> str:
        """Name of the parameter, ``joint_2.f_s``, joints from 1."""
        return f"joint_{self.joint + 1}.{_NAMES[self.kind]}"

    def unit(self, joint_unit: str) -> str:
        """Return the unit of the parameter.

        Args:
            joint_unit: ``rad`` or ``m``.
        """
        torque, power = "Nm" if joint_unit == "rad" else "N", _POWERS[self.kind]
        return f"{torque}{('', f' s/{joint_unit}', f' s^2/{joint_unit}^2')[power]}"

    def column(self, v: np.ndarray) -> np.ndarray:
        """Return the friction with a factor of 1 [Nm or N], shape (K,).

        Args:
            v: Velocity of the joint [rad/s or m/s], shape (K,).
        """
        if self.kind == "offset":
            return np.ones_like(v)
        if self.kind == "slant":
            return np.abs(v)
        if self.kind == "quadratic":
            return v * np.abs(v)
        assert self.width is not None
        if self.kind == "stribeck":
            return np.sign(v) * np.exp(-((v / self.width) ** 2))
        return np.tanh(v / self.width)


@dataclass(frozen=True)
class FrictionTerms:
    """Terms of a robot's joints beside Coulomb and viscous friction.

    Attributes:
        terms: Terms in the order of their parameters; no kind twice for a joint.

    Raises:
        InputError: If a joint has a kind twice.
    """

    terms: tuple[FrictionTerm, ...] = ()

    def __post_init__(self) -> None:
        names = self.names
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"friction: {name} appears {names.count(name)} times; must be 1")

    @property
    def names(self) -> list[str]:
        """Names of the parameters."""
        return [term.name for term in self.terms]

    def check_size(self, joints: int) -> None:
        """Refuse terms of joints that the robot does not have.

        Raises:
            InputError: If there is one.
        """
        for term in self.terms:
            if not 0 <= term.joint < joints:
                raise InputError(f"friction: {term.name}; the robot has the joints 1 to {joints}")

    def columns(self, v: np.ndarray) -> np.ndarray:
        """Return the columns of the regression matrices, shape (K, N, number of terms).

        Args:
            v: Joint velocities [rad/s or m/s], shape (K, N).
        """
        columns = np.zeros((*v.shape, len(self.terms)))
        for i, term in enumerate(self.terms):
            columns[:, term.joint, i] = term.column(v[:, term.joint])
        return columns

    def extend(self, base: BaseParameters, joint_units: Sequence[str]) -> BaseParameters:
        """Return base parameters followed by the terms' parameters.

        Args:
            base: Base of the robot without the terms.
            joint_units: ``rad`` or ``m`` of each joint.
        """
        size, (rank, full) = len(self.terms), base.projection.shape
        projection = np.zeros((rank + size, full + size))
        projection[:rank, :full] = base.projection
        projection[rank:, full:] = np.eye(size)
        return BaseParameters(
            np.concatenate([base.indices, np.arange(full, full + size)]),
            projection,
            [*base.full_names, *self.names],
            [*base.full_units, *(term.unit(joint_units[term.joint]) for term in self.terms)],
        )

    def has(self, term: FrictionTerm) -> bool:
        """Return whether there is a term of that kind and joint."""
        return term.name in self.names

    def with_term(self, term: FrictionTerm) -> "FrictionTerms":
        """Return the model with one more term."""
        return FrictionTerms((*self.terms, term))

    def with_width(self, term: FrictionTerm) -> "FrictionTerms":
        """Return the model with another width of one of its terms."""
        return FrictionTerms(tuple(term if t.name == term.name else t for t in self.terms))

    def without(self, term: FrictionTerm) -> "FrictionTerms":
        """Return the model without the term of that kind and joint."""
        return FrictionTerms(tuple(t for t in self.terms if t.name != term.name))
