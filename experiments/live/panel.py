"""Controls of a live session, and its Meshcat scene."""

import enum
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from pydrake.geometry import Meshcat

from diagrams.environment.operator import PULL, REGIONS, REQUEST, idle_controls
from diagrams.live_view import LiveFrame, LiveView
from experiments.live.controls import Slider, TunedParameter
from experiments.live.page_server import Pages
from pfsc_drake.control.compliance.tuned_impedance import requests_of
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat

_DEAD_ZONE = 0.12  # of a stick
_FARTHEST = 0.3  # m, largest displacement of the held position from the grasp
_DRAGGED = 0.15  # m, travel for half of a handle
_FREE_DAMPING = 90.0  # N s/m, where it varies along the manifold: Tab. 4.3
_AXES = "xyz"
_KEYS = (("KeyW", "KeyS"), ("KeyA", "KeyD"), ("KeyR", "KeyF"))
_STRENGTH, _GUIDE, _HOLD = "key force [N]", "guide (K, J)", "hold (T, G)"
# largest number of restarts of a scene
_MOST = 10


class Command(enum.Enum):
    """Commands to the session, with label and key of their buttons."""

    LET_GO = "let go (space)", "Space"
    RECORD = "record (C)", "KeyC"
    RESET = "reset (X)", "KeyX"
    END = "end (Q)", "KeyQ"


class Panel:
    """Controls of an operator from the input of the controlling page.

    Sliders and switches retain their values. The hand follows the current input, see
    :class:`Pages`; when it lets go, a hold opens, too.

    A teleoperated leader device is dragged: its handles give a displacement from the grasp instead
    of a force.

    Args:
        pages: Source of the input.
        force_limit: Force limit of the hand [N].
        tuned: Tunable impedance parameters.
        regions: Names of regions that can be switched.
        drags: Whether a teleoperated leader device is dragged.
    """

    def __init__(
        self,
        pages: Pages,
        force_limit: float,
        tuned: Sequence[TunedParameter],
        regions: Sequence[str],
        *,
        drags: bool = False,
    ) -> None:
        self._drags = drags
        self._pages, self._tuned, self._force_limit = pages, tuned, force_limit
        self._idle = idle_controls(regions)
        across, _ = requests_of(Kind.TRANSVERSAL)
        self._can_be_free = any(parameter.index == across for parameter in tuned)
        self._pull = [f"pull {axis} [N]" for axis in _AXES]
        self._drag = [f"drag {axis} [m]" for axis in _AXES]
        self._stick = [f"stick {axis}" for axis in _AXES]
        self._place = [f"hold d{axis} [m]" for axis in _AXES]
        self._regions = [f"region {name}" for name in regions]
        self._sliders = {slider.name: slider for slider in self._all_sliders()}
        self._values = {slider.name: slider.value for slider in self._sliders.values()}
        self._pushes = {
            f"push {sign}{axis} ({key[-1]})": (i, 1.0 if sign == "+" else -1.0, key)
            for i, axis in enumerate(_AXES)
            for sign, key in zip("+-", _KEYS[i], strict=True)
        }
        # commands are queued here
        self._buttons, self._commands = dict(c.value for c in Command), list[Command]()
        self._hand, self._strokes = dict[str, float](), list[list[float]]()
        self._held_from: np.ndarray | None = None
        self._dragged_from: np.ndarray | None = None
        pages.expect(
            [*self._pull, *self._drag, *self._stick, *self._pushes],
            [*self._sliders, *self._buttons],
        )

    def _all_sliders(self) -> list[Slider]:
        limit = self._force_limit
        found = [Slider(_STRENGTH, "keys", 0.0, limit, limit / 45.0, 20.0 * limit / 45.0)]
        found.append(Slider(_HOLD, "switch", 0.0, 1.0, 1.0, 0.0, ("KeyG", "KeyT")))
        found += [Slider(name, "hold", -_FARTHEST, _FARTHEST, 0.005, 0.0) for name in self._place]
        if self._can_be_free:
            found.append(Slider(_GUIDE, "switch", 0.0, 1.0, 1.0, 1.0, ("KeyJ", "KeyK")))
        found += [parameter.slider for parameter in self._tuned]
        found += [Slider(name, "switch", 0.0, 1.0, 1.0, 1.0) for name in self._regions]
        return found

    def look(self) -> None:
        """Update settings, commands and hand from the input since the last call."""
        heard = self._pages.collect()
        if heard.let_go:
            self._open()
        for name, value in heard.settings:
            if name in self._sliders:
                self._values[name] = self._sliders[name].nearest(value)
            elif value > 0.5:
                self._commands += [command for command in Command if command.value[0] == name]
        self._hand = heard.hand
        self._strokes += heard.strokes

    def take_strokes(self) -> list[list[float]]:
        """Return the points of a pen since the last call, see :class:`PageInput`."""
        strokes, self._strokes = self._strokes, []
        return strokes

    def commands(self) -> list[Command]:
        """Return the commands since the last call."""
        commands, self._commands = self._commands, []
        if Command.LET_GO in commands:
            self.let_go()
        return commands

    def let_go(self) -> None:
        """Release the tool until the next input."""
        self._pages.open_hand()
        self._hand = {}
        self._open()

    def _open(self) -> None:
        self._values[_HOLD], self._held_from, self._dragged_from = 0.0, None, None

    def content(self) -> dict[str, object]:
        """Return the controls as JSON content.

        It has sliders with values, buttons and pushes with keys, current actions of the hand by
        name, the largest force of a handle [N], or its largest displacement [m] if it drags.
        """
        rigid = {p.slider.name for p in self._tuned if p.top_is_rigid}
        sliders = [
            slider.content(self._value(slider.name), rigid_top=slider.name in rigid)
            for slider in self._sliders.values()
        ]
        pushes = {name: key for name, (_, _, key) in self._pushes.items()}
        return {
            "sliders": sliders,
            "buttons": self._buttons,
            "pushes": pushes,
            "hand": self._hand,
            "force_limit": self._force_limit,
            "drag": _DRAGGED if self._drags else None,
        }

    def read(self, y_t: np.ndarray) -> np.ndarray:
        """Return the current controls, see :class:`Operator`.

        Args:
            y_t: Tool point [m], shape (3,); origin of displacements of a new grasp.
        """
        controls = self._idle.copy()
        controls[PULL] = self._hand_controls(y_t)
        controls[REQUEST] = self._requests()
        if self._regions:
            controls[REGIONS] = [self._value(name) for name in self._regions]
        return controls

    def _value(self, name: str) -> float:
        return self._values[name]

    def _hand_controls(self, y_t: np.ndarray) -> np.ndarray:
        """Return push, hold and target, shape (7,)."""
        limit = self._force_limit
        pull = [self._hand.get(name, 0.0) for name in self._pull]
        push = np.clip(pull, -limit, limit) + self._key_push() + self._stick_push()
        dragged = self._dragged(y_t)
        if dragged is not None:
            return np.concatenate([push, [1.0], dragged])
        holds = self._value(_HOLD) > 0.5
        if holds and self._held_from is None and np.isfinite(y_t).all():
            self._held_from = y_t.copy()
            self._values |= dict.fromkeys(self._place, 0.0)
        if not holds or self._held_from is None:
            self._held_from = None
            return np.concatenate([push, np.zeros(4)])
        moved = self._held_from + [self._value(name) for name in self._place]
        return np.concatenate([push, [1.0], moved])

    def _dragged(self, y_t: np.ndarray) -> np.ndarray | None:
        """Return the desired position of a dragged tool, shape (3,), or None."""
        if not any(name in self._hand for name in self._drag):
            self._dragged_from = None
            return None
        if self._dragged_from is None and np.isfinite(y_t).all():
            self._dragged_from = y_t.copy()
        if self._dragged_from is None:
            return None
        offset = [self._hand.get(name, 0.0) for name in self._drag]
        return self._dragged_from + np.clip(offset, -_FARTHEST, _FARTHEST)

    def _key_push(self) -> np.ndarray:
        push, strength = np.zeros(3), self._value(_STRENGTH)
        for name, (axis, sign, _) in self._pushes.items():
            if self._hand.get(name, 0.0) > 0.5:
                push[axis] += sign * strength
        return push

    def _stick_push(self) -> np.ndarray:
        sticks = np.clip([self._hand.get(name, 0.0) for name in self._stick], -1.0, 1.0)
        beyond = np.maximum(np.abs(sticks) - _DEAD_ZONE, 0.0) / (1.0 - _DEAD_ZONE)
        return np.sign(sticks) * beyond * self._force_limit

    def _requests(self) -> np.ndarray:
        requests = self._idle[REQUEST].copy()
        for parameter in self._tuned:
            requests[parameter.index] = parameter.request(self._value(parameter.slider.name))
        if self._can_be_free and self._value(_GUIDE) < 0.5:
            _, along = requests_of(Kind.TANGENTIAL)
            stiffness, damping = requests_of(Kind.TRANSVERSAL)
            requests[stiffness], requests[damping] = 0.0, self._damping_along(along)
        return requests

    def _damping_along(self, index: int) -> float:
        """Return the damping of the tangential coordinates, also used for free ones [N s/m]."""
        sliders = (p.slider for p in self._tuned if p.index == index)
        return next((self._value(slider.name) for slider in sliders), _FREE_DAMPING)


class Scene:
    """Drawing of a station in Meshcat, shown by the page in a frame.

    Meshcat has no access control, and a malformed message terminates it. Its input is therefore
    ignored; its local address is random, one of 16 million and 28 thousand ports if available, and
    known to the page only; after a termination it is restarted at another address.

    Attributes:
        url: Its address.

    Args:
        view: Returns the drawing of a station, from a first frame on.
        first: The first frame.
        notify: Receives lines about events.
    """

    def __init__(
        self,
        view: Callable[[LiveFrame, Meshcat], LiveView],
        first: LiveFrame,
        notify: Callable[[str], None],
    ) -> None:
        self._make, self._notify, self._losses = view, notify, 0
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
            interrupted: Whether the tool's trace is not continued from the last frame.
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
            self._notify("the scene was terminated too often; it is no longer drawn")
            return
        self._notify("the scene was terminated and has been restarted")
        with suppress(RuntimeError):  # an immediate termination is found with the next frame
            self._begin(frame)
