"""What a coordinate of a manifold is."""

import enum
import math
from dataclasses import dataclass


class Kind(enum.Enum):
    """What a coordinate of a manifold means; the value is its symbol in the dissertation."""

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
        ends: Where what is followed ends [m], an open path; infinite where nothing ends.
    """

    name: str
    kind: Kind
    force: str
    ends: tuple[float, float] = (-math.inf, math.inf)
