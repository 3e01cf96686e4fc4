"""What obstacles look like: spheres, columns, persons, and anything made of capsules."""

import dataclasses as dc
from typing import Annotated

import casadi as ca

from pfsc_drake.errors import require
from pfsc_drake.yaml.rules import Numbers, OneOf, Parameters, Positive, Range

KINDS = ("sphere", "column", "person", "capsules")

# m: radius of a person's head, and what is too far away
_HEAD, _FARTHEST = 0.15, 100.0


@dc.dataclass(frozen=True)
class Capsule(Parameters):
    """All that is nearer to a line than a radius; a sphere where the line is a point.

    Attributes:
        start: One end of the line, from the obstacle's position on, axes of the world [m].
        end: The other one [m].
        radius: [m].
    """

    start: Annotated[tuple[float, float, float], Numbers(3, Range(-_FARTHEST, _FARTHEST, "m"))]
    end: Annotated[tuple[float, float, float], Numbers(3, Range(-_FARTHEST, _FARTHEST, "m"))]
    radius: Positive

    @property
    def is_sphere(self) -> bool:
        """Whether its line is a point."""
        return self.start == self.end


@dc.dataclass(frozen=True)
class ObstacleShape(Parameters):
    """What moves, without turning.

    Attributes:
        kind: ``sphere``; ``column`` along z that has no end; ``person`` who stands on
            the obstacle's position, trunk and head; ``capsules`` as they are given.
        radius: Of sphere, column, and a person's trunk with its arms [m].
        height: Of a person [m].
        given: Of ``capsules``: which.
    """

    kind: Annotated[str, OneOf(KINDS)]
    radius: Positive
    height: float = 1.75
    given: tuple[Capsule, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.kind == "capsules":
            require(bool(self.given), "parts", "none", "one or more where kind is capsules")
            return
        require(not self.given, "parts", "given", "none unless kind is capsules")
        if self.kind == "person":
            least = 2.0 * (self.radius + _HEAD)
            tall = least <= self.height <= _FARTHEST
            require(tall, "height", self.height, f"{least:g} m, trunk and head, to 100 m")

    @property
    def parts(self) -> tuple[Capsule, ...]:
        """The capsules that it is made of; of a column one whose height is left out of account."""
        r, origin = self.radius, (0.0, 0.0, 0.0)
        if self.kind == "capsules":
            return self.given
        if self.kind == "person":
            top = (0.0, 0.0, self.height - _HEAD)
            trunk = Capsule((0.0, 0.0, r), (0.0, 0.0, self.height - 2.0 * _HEAD - r), r)
            return trunk, Capsule(top, top, _HEAD)
        return (Capsule(origin, origin, r),)

    @property
    def axes(self) -> ca.DM:
        """Which axes of the world count for distances, shape (3,)."""
        return ca.DM([1.0, 1.0, 0.0 if self.kind == "column" else 1.0])
