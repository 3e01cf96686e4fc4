"""Coordinates of a manifold: their kinds, names and ends."""

import enum
import math
from dataclasses import dataclass


class Kind(enum.Enum):
    """Kind of a manifold's coordinate; the value is its symbol in the dissertation."""

    TANGENTIAL = "eta"
    TRANSVERSAL = "xi"
    ROTATIONAL = "phi"

    @property
    def unit(self) -> str:
        """SI unit of the coordinate."""
        return "rad" if self is Kind.ROTATIONAL else "m"


@dataclass(frozen=True)
class Coordinate:
    """One coordinate of the virtual output.

    Attributes:
        name: Its name.
        kind: Its kind, which decides gains, compliance and unit.
        force: Name of the generalized force along it.
        ends: First and last value on an open path [m]; infinite without ends.
    """

    name: str
    kind: Kind
    force: str
    ends: tuple[float, float] = (-math.inf, math.inf)
