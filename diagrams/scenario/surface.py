"""The surface of a scenario. Lengths in m, angles in degrees."""

import dataclasses as dc
from typing import Union

from diagrams.scenario.checks import LARGEST_ANGLE, require, require_direction, require_numbers
from diagrams.scenario.surface_files import Extruded, Fitted, Revolved
from diagrams.scenario.surface_shapes import Cone, Cylinder, Paraboloid, Plane, Sphere, Torus

_KINDS = ("none", "given", "normal")
_TASKS = ("full", "tool_axis", "yaw")
_CONVENTIONS = ("zyx", "zyz")
_JACOBIANS = ("geometric", "analytic")

FileShape = Fitted | Revolved | Extruded
NumberShape = Paraboloid | Plane | Cylinder | Cone | Sphere | Torus
# the first is what a shape without a tag means
SurfaceShape = Union[  # noqa: UP007
    Paraboloid, Plane, Cylinder, Cone, Sphere, Torus, Fitted, Revolved, Extruded
]


def require_jacobian(jacobian: str, key: str, value: str) -> None:
    """Refuse an unknown Jacobian, and the analytic one where not all of an orientation matters.

    Args:
        jacobian: What the scenario says.
        key: What says how much of the orientation matters.
        value: Its value; ``full`` for all of it.
    """
    require(jacobian in _JACOBIANS, "jacobian", jacobian, ", ".join(_JACOBIANS))
    good = jacobian == "geometric" or value == "full"
    require(good, "jacobian", jacobian, f"geometric with {key}: {value}")


@dc.dataclass
class SurfaceOrientationParameters:
    """Orientation of the tool along a surface.

    Attributes:
        kind: ``none``: position only; ``given``: the same everywhere; ``normal``: that of the
            frame of first tangent, second and normal.
        convention: ``zyx`` (2.7) or ``zyz`` (2.6); of an ``analytic`` Jacobian too.
        angles_deg: Euler angles [deg]: of the orientation, or of its turn away from the frame.
        task: ``full``; ``tool_axis``, whose turn about itself is free; or ``yaw``, the turn about
            an axis in the world alone.
        tool_axis: Axis in the tool frame, of any length, for ``tool_axis``.
        yaw_axis: Axis in the world, of any length, for ``yaw``; by default the vertical.
        jacobian: ``geometric`` or ``analytic``, see ``path.orientation.jacobian``.
    """

    kind: str = "none"
    convention: str = "zyx"
    angles_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    task: str = "full"
    tool_axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    yaw_axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    jacobian: str = "geometric"

    def __post_init__(self) -> None:
        for key, values in {"kind": _KINDS, "convention": _CONVENTIONS, "task": _TASKS}.items():
            require(getattr(self, key) in values, key, getattr(self, key), ", ".join(values))
        require_jacobian(self.jacobian, "task", self.task)
        require_jacobian(self.jacobian, "kind", "full" if self.kind != "none" else self.kind)
        require_numbers("angles_deg", self.angles_deg, 3)
        good = max(map(abs, self.angles_deg)) <= LARGEST_ANGLE
        allowed = f"3 numbers of at most {LARGEST_ANGLE:g} deg"
        require(good, "angles_deg", self.angles_deg, allowed)
        require_direction("tool_axis", self.tool_axis)
        require_direction("yaw_axis", self.yaw_axis)


@dc.dataclass
class SurfaceParameters:
    """The surface.

    Attributes:
        shape: Position, one of ``!Paraboloid``, ``!Plane``, ``!Cylinder``, ``!Cone``, ``!Sphere``,
            ``!Torus``, or from a file ``!Fitted``, ``!Revolved``, ``!Extruded``.
        orientation: Orientation.
    """

    shape: SurfaceShape = dc.field(default_factory=Paraboloid)
    orientation: SurfaceOrientationParameters = dc.field(
        default_factory=SurfaceOrientationParameters
    )
