"""The box of model errors that a loop is to bear."""

import itertools
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass

from diagrams.scenario import Scenario
from pfsc_drake.errors import InputError

_FACTORS = {"mass": "masses", "stiffness": "stiffnesses", "rotor_inertia": "rotor inertias"}


@dataclass(frozen=True)
class Box:
    """By how much the model may be off, one way or the other.

    Attributes:
        mass: Relative, of all masses and inertias.
        stiffness: Relative, of all joint stiffnesses.
        rotor_inertia: Relative, of all rotor inertias.
        tool_mass: [kg].
    """

    mass: float = 0.05
    stiffness: float = 0.05
    rotor_inertia: float = 0.0
    tool_mass: float = 0.1

    def __post_init__(self) -> None:
        for key in _FACTORS:
            value = getattr(self, key)
            if not 0.0 <= value < 1.0:
                option = {"rotor_inertia": "rotor"}.get(key, key)
                raise InputError(f"--{option} {value:g}: allowed: 0 or a fraction below 1")
        if not 0.0 <= self.tool_mass < float("inf"):
            raise InputError(f"--tool {self.tool_mass:g}: allowed: 0 or a positive number of kg")


@dataclass(frozen=True)
class Error:
    """What is believed wrongly, in units of the scenario's own ``model_error``.

    Attributes:
        parts: By key of ``model_error``: relative errors, and the tool's in kg.
        unknown_mass: What hangs below the force sensor beside what is believed [kg].
    """

    parts: tuple[tuple[str, float], ...] = ()
    unknown_mass: float = 0.0

    def applied_to(self, settings: Scenario) -> Scenario:
        """Return a scenario whose controller errs so.

        Args:
            settings: The scenario; unchanged.
        """
        result = deepcopy(settings)
        error = result.model_error
        for key, amount in self.parts:
            if key == "tool_mass":
                error.tool_mass += amount
            else:
                setattr(error, key, [(1.0 + amount) * value for value in getattr(error, key)])
        return result

    def __str__(self) -> str:
        """In words."""
        if self.unknown_mass > 0.0:
            return f"{self.unknown_mass:g} kg more below the force sensor than believed"
        if len(self.parts) > 1:
            return f"believed {', '.join(_short(*part) for part in self.parts)}"
        return "".join(_words(*part) for part in self.parts) or "as the scenario says"


def _words(key: str, amount: float) -> str:
    if key == "tool_mass":
        return f"tool believed {abs(amount):g} kg too {'heavy' if amount > 0.0 else 'light'}"
    side = "high" if amount > 0.0 else "low"
    return f"{_FACTORS[key]} believed {100.0 * abs(amount):.3g} % too {side}"


def _short(key: str, amount: float) -> str:
    if key == "tool_mass":
        return f"tool {amount:+g} kg"
    return f"{_FACTORS[key]} {100.0 * amount:+.3g} %"


def single_errors(box: Box, elastic: bool) -> Iterator[tuple[str, Error]]:
    """Yield the errors of one parameter at a time, with the parameter.

    Args:
        box: The box.
        elastic: Whether there is any stiffness to be wrong.
    """
    for key, size in _sizes(box, elastic):
        for sign in (-1.0, 1.0):
            yield key, Error(((key, sign * size),))


def corners(box: Box, elastic: bool) -> Iterator[Error]:
    """Yield the corners of the box, where all parameters are wrong.

    Args:
        box: The box.
        elastic: Whether there is any stiffness to be wrong.
    """
    sizes = _sizes(box, elastic)
    if len(sizes) > 1:
        for signs in itertools.product((-1.0, 1.0), repeat=len(sizes)):
            pairs = zip(sizes, signs, strict=True)
            yield Error(tuple((key, sign * size) for (key, size), sign in pairs))


def _sizes(box: Box, elastic: bool) -> list[tuple[str, float]]:
    keys = ("mass", "stiffness", "tool_mass", "rotor_inertia")
    sizes = [(key, getattr(box, key)) for key in keys if elastic or key != "stiffness"]
    return [(key, size) for key, size in sizes if size > 0.0]
