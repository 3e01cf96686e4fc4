"""Admissible regions: what every one of them offers."""

from abc import ABC, abstractmethod

Distance = tuple[float, float, float, float]


class Region(ABC):
    """A part of space whose boundary a tool must not cross, at rest (Sec. 5.1.1).

    The distance is that to the nearest point of the whole boundary, not one found from a guess. So
    it is 1-Lipschitz: a tool that moved by dz is not nearer than h - |dz|.
    """

    @abstractmethod
    def distance(self, x: float, y: float, z: float) -> Distance:
        """Signed distance to the boundary, positive in the admissible region.

        Args:
            x: Of the tool point, world axes, finite, m.
            y: See x.
            z: See x.

        Returns:
            h, m, and its gradient, the unit normal n at the foot into the admissible region, as
            plain floats: in a tick of 1 ms an array costs more than the formula. Where several
            points of the boundary are the nearest, that of one of them, always the same.
        """
