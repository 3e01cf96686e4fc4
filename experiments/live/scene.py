"""The scene of a live session: it only draws, and begins anew when it is disturbed."""

import secrets
from collections.abc import Callable
from contextlib import suppress

from pydrake.geometry import Meshcat, MeshcatParams

from diagrams.drawing.live_view import LiveFrame, LiveView
from experiments.live.server import HOST

# how often it begins anew
_MOST = 10


class Scene:
    """Draws a station in Meshcat, for the page to show in a frame.

    Meshcat asks nobody who they are and where they come from, and one message that is none ends it.
    So nothing that is done in it is listened to; it has an address on this machine that only the
    page is told, one of 16 million and 28 thousand ports, where the system has so many; and when it
    was ended all the same, there is a new one elsewhere.

    Attributes:
        url: Where it is.

    Args:
        view: Returns what draws a station there, from a first frame on.
        first: The first frame.
        tell: Told in words what happens.
    """

    def __init__(
        self,
        view: Callable[[LiveFrame, Meshcat], LiveView],
        first: LiveFrame,
        tell: Callable[[str], None],
    ) -> None:
        self._make, self._tell, self._losses = view, tell, 0
        self._begin(first)

    def _begin(self, frame: LiveFrame) -> None:
        self._meshcat = hidden_meshcat()
        self.url = str(self._meshcat.web_url())
        self._view = self._make(frame, self._meshcat)

    def draw(self, frame: LiveFrame, factor: float, *, interrupted: bool = False) -> None:
        """Draw a frame.

        Args:
            frame: The frame.
            factor: Simulated over real time.
            interrupted: Whether the tool's way does not lead there from the last one.
        """
        if self._losses > _MOST:
            return
        try:
            self._view.draw(frame, interrupted=interrupted)
            self._meshcat.SetRealtimeRate(factor)
        except RuntimeError:
            self._begin_anew(frame)

    def _begin_anew(self, frame: LiveFrame) -> None:
        self._losses += 1
        if self._losses > _MOST:
            self._tell("the scene was ended from outside too often; it is drawn no more")
            return
        self._tell("the scene was ended from outside, and begins anew")
        with suppress(RuntimeError):  # that it is ended at once, too, the next frame finds
            self._begin(frame)


def hidden_meshcat() -> Meshcat:
    """Return a Meshcat at an address of this machine that cannot be guessed, if there are many."""
    own = ".".join(["127", *(str(secrets.choice(range(1, 255))) for _ in range(3))])
    try:
        return Meshcat(MeshcatParams(host=own, port=0))
    except RuntimeError:
        return Meshcat(MeshcatParams(host=HOST, port=0))
