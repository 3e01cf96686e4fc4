"""List of the shapes of surfaces and regions. A tag ``!Name`` chooses one of them."""

from typing import Union

from pfsc_drake.geometry.shapes.cone import Cone
from pfsc_drake.geometry.shapes.cylinder import Cylinder
from pfsc_drake.geometry.shapes.fitted import Fitted
from pfsc_drake.geometry.shapes.paraboloid import Paraboloid
from pfsc_drake.geometry.shapes.plane import Plane
from pfsc_drake.geometry.shapes.polyhedron import Box
from pfsc_drake.geometry.shapes.profiles import Extruded, Revolved
from pfsc_drake.geometry.shapes.sphere import Sphere
from pfsc_drake.geometry.shapes.torus import Torus

# the first is the default of a shape without a tag
SurfaceShape = Union[  # noqa: UP007 (Drake's YAML needs it)
    Paraboloid, Plane, Cylinder, Cone, Sphere, Torus, Fitted, Revolved, Extruded
]
RegionShape = Union[Plane, Box, SurfaceShape]  # noqa: UP007
