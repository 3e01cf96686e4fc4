"""The way of a point in Meshcat."""

from collections.abc import Callable

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

_WIDTH = 4.0


class TrailVisualizer(LeafSystem):
    """Draws the way that a point has come, piece by piece.

    Frames carry the time, so that a recording in progress gets them.

    Ports:
        point (input): World axes [m], shape (3,); nothing is drawn where it is not finite.
        value (input): What the colour tells, shape (1,), if it tells anything.

    State:
        Discrete: the point at the last frame [m], shape (3,), NaN before the first, and the
        number of frames, shape (1,).

    Args:
        name: Meshcat path of the trail.
        color: Its colour, or the colour that a value gives the piece that ends there.
        meshcat: Where to draw, axes of the world.
        period: Time between frames [s].
        longest: How many pieces stay; all of them by default.
    """

    def __init__(
        self,
        name: str,
        color: Rgba | Callable[[float], Rgba],
        meshcat: Meshcat,
        period: float,
        longest: int | None = None,
    ) -> None:
        super().__init__()
        self._longest = longest
        self._name, self._color, self._meshcat = name, color, meshcat
        self._last = self.DeclareDiscreteState(np.full(3, np.nan))
        self._frames = self.DeclareDiscreteState(1)
        self._point = self.DeclareVectorInputPort("point", 3)
        if not isinstance(color, Rgba):
            self.DeclareVectorInputPort("value", 1)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def _draw(self, context: Context) -> None:
        ends = np.column_stack(
            [context.get_discrete_state(self._last).value(), self._point.Eval(context)]
        )
        if not np.isfinite(ends).all():
            return
        time = context.get_time()
        frame = int(context.get_discrete_state(self._frames).value()[0])
        if self._longest is not None:
            frame %= self._longest
        piece = f"{self._name}/trail/{frame:05d}"
        self._meshcat.SetLine(piece, ends, _WIDTH, self._piece_color(context))
        if time > 0.0:
            self._meshcat.SetProperty(piece, "visible", False, 0.0)
        self._meshcat.SetProperty(piece, "visible", True, time)

    def _piece_color(self, context: Context) -> Rgba:
        if isinstance(self._color, Rgba):
            return self._color
        return self._color(float(self.GetInputPort("value").Eval(context)[0]))

    def _remember(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._last, self._point.Eval(context))
        frames = context.get_discrete_state(self._frames).value()
        state.set_value(self._frames, frames + 1)
