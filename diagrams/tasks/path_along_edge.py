"""The path of a scenario, where it is an edge of two surfaces."""

from pathlib import Path as FilePath

from diagrams.scenario import Intersection
from diagrams.tasks.surface import make_surface
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Curve, Edge, find_edge, find_edges
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.surfaces.surface import Surface


def make_edge(
    shape: Intersection, law: str, folder: FilePath, progress: Progress | None = None
) -> Curve:
    """Return the edge in which two surfaces meet, smooth enough for the law.

    Args:
        shape: What the scenario says.
        law: Key of ``RELATIVE_DEGREE``, r; decides the class C^(r+1) of splines.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If a surface cannot be made, or they have no edge, or several and nothing
            tells which.
    """
    if len(shape.surfaces) != 2:
        raise InputError(
            "path.shape.surfaces: none given; must be 2, e.g. [!Plane {..}, !Sphere {..}]"
        )
    first, second = (_surface(shape, k, law, folder, progress) for k in range(len(shape.surfaces)))
    smoothness = RELATIVE_DEGREE[law] + 1
    try:
        if shape.near:
            return find_edge(
                first, second, near=shape.near, smoothness=smoothness, tolerance=shape.tolerance
            ).curve
        edges = find_edges(first, second, smoothness=smoothness, tolerance=shape.tolerance)
    except InputError as error:
        raise InputError(f"path.shape.{error}") from None
    if len(edges) > 1:
        places = ", ".join(_place(edge) for edge in edges)
        raise InputError(
            f"path.shape.near: none given, and the surfaces have {len(edges)} edges, through "
            f"{places}; must be a point, [x, y, z] in m, next to the one that is meant"
        )
    return edges[0].curve


def _surface(
    shape: Intersection, k: int, law: str, folder: FilePath, progress: Progress | None
) -> Surface:
    try:
        return make_surface(shape.surfaces[k], law, folder, progress).surface
    except InputError as error:
        raise InputError(f"path.shape.surfaces[{k}]: {error}") from None


def _place(edge: Edge) -> str:
    begin = edge.curve.derivatives(edge.curve.domain[0], 0)[0]
    return f"[{', '.join(f'{value:.4g}' for value in begin)}]"
