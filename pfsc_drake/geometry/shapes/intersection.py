"""Paths along the edge in which two surfaces intersect."""

import dataclasses as dc
from typing import Annotated, Any

from pfsc_drake.checks import FARTHEST, require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.intersections.edge import Edge, find_edge, find_edges
from pfsc_drake.geometry.shapes.path_shapes import CurveShape
from pfsc_drake.geometry.shapes.shape import ShapeInputs
from pfsc_drake.geometry.shapes.surface_list import SurfaceShape
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.yaml.rules import MaybePoint, Parameters, Range


@dc.dataclass
class Intersection(Parameters, CurveShape):
    """The edge in which two surfaces intersect, along the cross product of their normals.

    Attributes:
        surfaces: Both, as ``surface.shape``; the edge ends at the border of either.
        near: A point [m] that selects the nearest of several edges; a closed one begins there;
            empty if there is only one.
        tolerance: Largest deviation of a spline from the edge, 1e-9 or more [m]. Lines, circles and
            ellipses are exact.
    """

    surfaces: list[SurfaceShape] = dc.field(default_factory=list)
    near: MaybePoint = dc.field(default_factory=list)
    tolerance: Annotated[float, Range(1e-9, FARTHEST, "m")] = 1e-6

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.surfaces)
        require(
            count in (0, 2), "surfaces", f"{count} given", "2, e.g. [!Plane {..}, !Sphere {..}]"
        )

    def curve(self, inputs: ShapeInputs) -> Curve:
        """Return the edge in which both surfaces intersect."""
        if len(self.surfaces) != 2:
            raise InputError(
                "path.shape.surfaces: none given; must be 2, e.g. [!Plane {..}, !Sphere {..}]"
            )
        first, second = (self._surface(k, inputs) for k in range(2))
        options: dict[str, Any] = {"smoothness": inputs.smoothness, "tolerance": self.tolerance}
        try:
            if self.near:
                return find_edge(first, second, near=self.near, **options).curve
            edges = find_edges(first, second, **options)
        except InputError as error:
            raise InputError(f"path.shape.{error}") from None
        if len(edges) > 1:
            begins = ", ".join(_begin(edge) for edge in edges)
            raise InputError(
                f"path.shape.near: none given, and the surfaces have {len(edges)} edges, through "
                f"{begins}; must be a point, [x, y, z] in m, next to the one that is meant"
            )
        return edges[0].curve

    def _surface(self, k: int, inputs: ShapeInputs) -> Surface:
        try:
            return self.surfaces[k].smooth_sheet(inputs).surface
        except InputError as error:
            raise InputError(f"path.shape.surfaces[{k}]: {error}") from None


def _begin(edge: Edge) -> str:
    begin = edge.curve.derivatives(edge.curve.domain[0], 0)[0]
    return f"[{', '.join(f'{value:.4g}' for value in begin)}]"
