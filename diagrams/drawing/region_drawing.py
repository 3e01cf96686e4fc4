"""How regions that a tool may not enter are drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import DiagramBuilder, InputPort

from diagrams.drawing.manifold_drawing import skin_and_lines
from diagrams.tasks.fixtures import DrawnFixture
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.geometry.regions.moving import MovingRegion
from pfsc_drake.systems.drawing.surface_visualizer import RegionVisualizer


@dataclass(frozen=True)
class SpaceDrawing:
    """The surfaces of regions, drawn where they are at rest.

    Attributes:
        fixtures: The regions.
        manifold: Space as the law sees it.
    """

    fixtures: Sequence[DrawnFixture]
    manifold: SpaceManifold

    def outline(self) -> list[np.ndarray]:
        """See :class:`ManifoldDrawing`."""
        surfaces = [surface for fixture in self.fixtures for surface in fixture.surfaces]
        return [line for surface in surfaces for line in skin_and_lines(surface)[1]]

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """See :class:`ManifoldDrawing`."""
        shapes: list[tuple[np.ndarray, list[np.ndarray]]] = []
        placements = {}
        for fixture in self.fixtures:
            for surface in fixture.surfaces:
                if isinstance(fixture.region, MovingRegion):
                    placements[len(shapes)] = partial(_placement, fixture.region)
                shapes.append(skin_and_lines(surface))
        drawing = builder.AddNamedSystem(
            "region_visualizer",
            RegionVisualizer(shapes, placements, self.manifold.layout.size, meshcat, period),
        )
        return drawing.GetInputPort("manifold_point")


def _placement(region: MovingRegion, clock: float) -> RigidTransform:
    """Return where what moves with a region is at a time of the clock."""
    rotation, origin = region.placement(clock)
    return RigidTransform(RotationMatrix(rotation), origin)
