"""Forces as arrows in Meshcat."""

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, EventStatus, LeafSystem

_COLOR = Rgba(0.95, 0.65, 0.05, 1.0)
_LENGTH = 0.25  # m, of the largest force
_RADIUS, _HEAD_RADIUS, _HEAD_LENGTH = 0.008, 0.022, 0.06  # m
_AWAY = 0.08  # m, of the tip from the point, which may be inside a link
_LEAST = 0.02  # of the largest force; what is smaller is not drawn


class ForceArrows(LeafSystem):
    """Draws forces as arrows that point at where they act, longer for larger forces.

    Frames carry the time, so that a recording in progress gets them.

    Ports:
        points (input): Where K forces act, world axes [m], shape (3K,).
        forces (input): World axes [N], shape (3K,).

    Args:
        count: Number K of forces.
        largest: Force whose arrow is the longest [N].
        meshcat: Where to draw, axes of the world.
        period: Time between frames [s].
        root: Meshcat path of the arrows.
    """

    def __init__(
        self, count: int, largest: float, meshcat: Meshcat, period: float, root: str = "push"
    ) -> None:
        super().__init__()
        self._largest, self._meshcat = largest, meshcat
        self._arrows = [f"{root}/{k + 1}" for k in range(count)]
        self._points = self.DeclareVectorInputPort("points", 3 * count)
        self._forces = self.DeclareVectorInputPort("forces", 3 * count)
        self.DeclareInitializationPublishEvent(self._draw_parts)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_parts(self, context: Context) -> EventStatus:
        """Draw heads before the origins, pointing along z, with shafts of length 1 behind them."""
        for arrow in self._arrows:
            head, shaft = f"{arrow}/head", f"{arrow}/shaft/cylinder"
            # a cone stands on its tip
            self._meshcat.SetObject(
                head, MeshcatCone(_HEAD_LENGTH, _HEAD_RADIUS, _HEAD_RADIUS), _COLOR
            )
            turned = RotationMatrix.MakeXRotation(np.pi)
            self._meshcat.SetTransform(head, RigidTransform(turned, [0.0, 0.0, -_AWAY]))
            self._meshcat.SetObject(shaft, Cylinder(_RADIUS, 1.0), _COLOR)
            self._meshcat.SetTransform(shaft, RigidTransform([0.0, 0.0, -0.5]))
            behind = RigidTransform([0.0, 0.0, -_AWAY - _HEAD_LENGTH])
            self._meshcat.SetTransform(f"{arrow}/shaft", behind)
        self._draw(context)
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        time = context.get_time()
        points = self._points.Eval(context).reshape(-1, 3)
        forces = self._forces.Eval(context).reshape(-1, 3)
        for arrow, point, force in zip(self._arrows, points, forces, strict=True):
            size = float(np.linalg.norm(force))
            seen = bool(np.isfinite(size + point.sum()) and size > _LEAST * self._largest)
            self._meshcat.SetProperty(arrow, "visible", seen, time)
            if not seen:
                continue
            R_WA = RotationMatrix.MakeFromOneVector(force, 2)
            self._meshcat.SetTransform(arrow, RigidTransform(R_WA, point), time)
            length = _LENGTH * size / self._largest
            self._meshcat.SetProperty(f"{arrow}/shaft", "scale", [1.0, 1.0, length], time)
