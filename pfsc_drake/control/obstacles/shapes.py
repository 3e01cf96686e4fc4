"""Shapes of obstacles: spheres, columns, persons, and unions of capsules."""

import dataclasses as dc
from typing import Annotated

import casadi as ca

from pfsc_drake.errors import require
from pfsc_drake.yaml.rules import Numbers, OneOf, Parameters, Positive, Range

KINDS = ("sphere", "column", "person", "capsules")

# m: radius of a person's head, and largest coordinate
_HEAD, _FARTHEST = 0.15, 100.0


@dc.dataclass(frozen=True)
class Capsule(Parameters):
    """Points within a radius of a line segment; a sphere if the segment is a point.

    Attributes:
        start: One end of the segment relative to the obstacle's position, world axes [m].
        end: The other end [m].
        radius: Radius [m].
    """

    start: Annotated[tuple[float, float, float], Numbers(3, Range(-_FARTHEST, _FARTHEST, "m"))]
    end: Annotated[tuple[float, float, float], Numbers(3, Range(-_FARTHEST, _FARTHEST, "m"))]
    radius: Positive

    @property
    def is_sphere(self) -> bool:
        """Whether the segment is a point."""
        return self.start == self.end


@dc.dataclass(frozen=True)
class ObstacleShape(Parameters):
    """Shape of an obstacle that moves without turning.

    Attributes:
        kind: ``sphere``; ``column``, infinite along z; ``person``, trunk and head, standing at the
            obstacle's position; ``capsules``, a union of capsules.
        radius: Radius of a sphere, a column, or a person's trunk with arms [m].
        height: Height of a person [m].
        capsules: Parts, if the kind is ``capsules``.
    """

    kind: Annotated[str, OneOf(KINDS)]
    radius: Positive
    height: float = 1.75
    capsules: tuple[Capsule, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.kind == "capsules":
            require(bool(self.capsules), "parts", "none", "one or more where kind is capsules")
            return
        require(not self.capsules, "parts", "given", "none unless kind is capsules")
        if self.kind == "person":
            least = 2.0 * (self.radius + _HEAD)
            tall = least <= self.height <= _FARTHEST
            require(tall, "height", self.height, f"{least:g} m, trunk and head, to 100 m")

    @property
    def parts(self) -> tuple[Capsule, ...]:
        """Capsules of the shape; for a column one capsule whose height is ignored."""
        r, origin = self.radius, (0.0, 0.0, 0.0)
        if self.kind == "capsules":
            return self.capsules
        if self.kind == "person":
            top = (0.0, 0.0, self.height - _HEAD)
            trunk = Capsule((0.0, 0.0, r), (0.0, 0.0, self.height - 2.0 * _HEAD - r), r)
            return trunk, Capsule(top, top, _HEAD)
        return (Capsule(origin, origin, r),)

    @property
    def axes(self) -> ca.DM:
        """World axes that count for distances, 1 or 0 each, shape (3,)."""
        return ca.DM([1.0, 1.0, 0.0 if self.kind == "column" else 1.0])
