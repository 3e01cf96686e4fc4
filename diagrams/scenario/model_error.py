"""Errors of the nominal model in the controller of a scenario."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.yaml.fields import ONE_OR_MANY, equal
from pfsc_drake.yaml.rules import Numbers, Parameters, Range, Seed

_FACTORS = ("mass", "inertia", "rotor_inertia", "stiffness", "friction", "link_length")
_LEAST, _MOST = 1e-3, 1e3
_LARGEST_OFFSET_DEG, _FARTHEST, _HEAVIEST = 90.0, 10.0, 1e3  # deg, m, kg
_DOUBTED = 0.5, 2.0

_Factors = Annotated[
    list[float],
    Numbers(
        each=Range(_LEAST, _MOST),
        fewest=1,
        words=f"factors from {_LEAST:g} to {_MOST:g}, one or one per link",
    ),
]
_Offsets = Annotated[
    list[float],
    Numbers(
        each=Range(-_LARGEST_OFFSET_DEG, _LARGEST_OFFSET_DEG),
        fewest=1,
        words=f"numbers of at most {_LARGEST_OFFSET_DEG:g} deg, one or one per joint",
    ),
]
_Share = Annotated[float, Range(0.0, 1.0, "as a fraction")]


def _one() -> list[float]:
    return [1.0]


@dc.dataclass
class RandomModelError(Parameters):
    """Standard deviations of random errors, independent for every link; none by default.

    Attributes:
        seed: Seed of the errors; those of a kind depend on nothing else.
        mass: Relative.
        inertia: Relative.
        center: Error of each link's centre of mass along every axis [m].
        rotor_inertia: Relative.
        stiffness: Relative.
        friction: Relative, Coulomb and viscous apart.
        link_length: Relative.
        joint_offset_deg: Error of the zero position [deg].
        tool_mass: Error of the tool's mass [kg].
    """

    seed: Seed = 0
    mass: _Share = 0.0
    inertia: _Share = 0.0
    center: Annotated[float, Range(0.0, 1.0, "m")] = 0.0
    rotor_inertia: _Share = 0.0
    stiffness: _Share = 0.0
    friction: _Share = 0.0
    link_length: _Share = 0.0
    joint_offset_deg: Annotated[float, Range(0.0, 30.0, "deg")] = 0.0
    tool_mass: Annotated[float, Range(0.0, 100.0, "kg")] = 0.0

    @classmethod
    def _kinds(cls) -> list[str]:
        return [f.name for f in dc.fields(cls) if f.name != "seed"]

    def draw(self, kind: str, shape: Sequence[int] | int) -> np.ndarray:
        """Return errors of a kind.

        Args:
            kind: Name of an attribute.
            shape: Shape of the array.
        """
        generator = np.random.default_rng([self.seed, self._kinds().index(kind)])
        return getattr(self, kind) * generator.standard_normal(shape)


@dc.dataclass
class ModelErrorParameters(Parameters):
    """Errors of the nominal model in the controller, relative to the simulated robot.

    A factor is the nominal value divided by the actual one: 0.95 is 5 % too low. Factors are one
    number for all links, or a list, base first; of a DELTA robot slides, rods and end-effector
    are the links, with ``l_A``, ``l_BC`` and ``l_EC`` their lengths.

    Attributes:
        mass: Factor of mass and inertia of each link.
        inertia: Further factor of its inertia about the centre of mass.
        rotor_inertia: Factor of the rotor inertias.
        stiffness: Factor of the joint stiffnesses.
        friction: Factor of the drives' friction, Coulomb and viscous.
        link_length: Factor of the distance to the next joint, the last to the tool point.
        joint_offset_deg: Error of each joint's zero position, nominal minus actual [deg; m for
            slides].
        tool_mass: Added to the tool [kg].
        tool_center: Error of the tool's centre of mass, axes of the tool frame [m].
        random: Random errors in addition.
    """

    mass: _Factors = dc.field(default_factory=_one, metadata=ONE_OR_MANY)
    inertia: _Factors = dc.field(default_factory=_one, metadata=ONE_OR_MANY)
    rotor_inertia: _Factors = dc.field(default_factory=_one, metadata=ONE_OR_MANY)
    stiffness: _Factors = dc.field(default_factory=_one, metadata=ONE_OR_MANY)
    friction: _Factors = dc.field(default_factory=_one, metadata=ONE_OR_MANY)
    link_length: _Factors = dc.field(default_factory=_one, metadata=ONE_OR_MANY)
    joint_offset_deg: _Offsets = dc.field(default_factory=lambda: [0.0], metadata=ONE_OR_MANY)
    tool_mass: Annotated[float, Range(-_HEAVIEST, _HEAVIEST, "kg")] = 0.0
    tool_center: Annotated[list[float], Numbers(3, Range(-_FARTHEST, _FARTHEST, "m"))] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3)
    )
    random: RandomModelError = dc.field(default_factory=RandomModelError)

    @property
    def warnings(self) -> list[str]:
        """Warnings about factors that may be meant as relative errors, one sentence each."""
        least, most = _DOUBTED
        doubted = {
            key: next((f for f in getattr(self, key) if not least <= f <= most), None)
            for key in _FACTORS
        }
        return [
            f"model_error.{key} = {factor:g} is a factor: the nominal value is {factor:g} times "
            "the actual one; 0.95 is 5 % too low, 1.05 is 5 % too high"
            for key, factor in doubted.items()
            if factor is not None
        ]

    @property
    def is_given(self) -> bool:
        """Whether there is an error."""
        return self != ModelErrorParameters(random=RandomModelError(seed=self.random.seed))

    def error(self, is_revolute: np.ndarray) -> ModelError:
        """Return the error, random parts drawn.

        Args:
            is_revolute: Whether each of the robot's N joints turns, shape (N,).

        Raises:
            InputError: If there are more or fewer links, or a random factor is not positive.
        """
        n, random = len(is_revolute), self.random
        unit = np.where(is_revolute, np.pi / 180.0, 1.0)
        offset = self._per_link("joint_offset_deg", n) + random.draw("joint_offset_deg", n)
        return ModelError(
            mass=self._factor("mass", n),
            inertia=self._factor("inertia", n),
            center=random.draw("center", (n, 3)),
            rotor_inertia=self._factor("rotor_inertia", n),
            stiffness=self._factor("stiffness", n),
            friction=self._factor("friction", n, rows=2),
            link_length=self._factor("link_length", n),
            joint_offset=unit * offset,
            tool_mass=self.tool_mass + float(random.draw("tool_mass", 1)[0]),
            tool_center=np.array(self.tool_center, dtype=float),
        )

    def _per_link(self, key: str, n: int) -> np.ndarray:
        values = getattr(self, key)
        if len(values) not in (1, n):
            raise InputError(
                f"model_error.{key}: {len(values)} values; allowed: one, or one for each of the "
                f"robot's {n} links"
            )
        return np.broadcast_to(np.array(values, dtype=float), n)

    def _factor(self, key: str, n: int, rows: int | None = None) -> np.ndarray:
        mean = self._per_link(key, n)
        factor = mean * (1.0 + self.random.draw(key, n if rows is None else (rows, n)))
        if not np.all(factor >= _LEAST):
            raise InputError(
                f"model_error.random.{key} = {getattr(self.random, key):g}: with seed "
                f"{self.random.seed} it draws a factor of {factor.min():.3g}; allowed: deviations "
                f"that leave {_LEAST:g} or more"
            )
        return factor
