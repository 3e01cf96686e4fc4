"""What a person sees and sets in a live session: controls, and a scene that only draws."""

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
_FARTHEST = 0.3  # m, of the place to hold at from where the hand took hold
_DRAGGED = 0.15  # m, by the half of a handle
_FREE_DAMPING = 90.0  # N s/m, where it varies along the manifold: Tab. 4.3
_AXES = "xyz"
_KEYS = (("KeyW", "KeyS"), ("KeyA", "KeyD"), ("KeyR", "KeyF"))
_STRENGTH, _GUIDE, _HOLD = "key force [N]", "guide (K, J)", "hold (T, G)"
# how often a scene begins anew
_MOST = 10


class Command(enum.Enum):
    """What a person can ask of the session, with the label and key of its button."""

    LET_GO = "let go (space)", "Space"
    RECORD = "record (C)", "KeyC"
    RESET = "reset (X)", "KeyX"
    END = "end (Q)", "KeyQ"


class Panel:
    """What the page that leads sets, read as the controls of an operator.

    Sliders and switches keep what they were set to. The hand itself is nothing but what the page
    says at this moment, see :class:`Pages`; whenever that has to let go, a hold opens, too.

    A device far away is dragged: its handles say how far from where the hand took hold of it, and
    do not pull.

    Args:
        pages: Who sets it.
        force_limit: Force limit of the hand [N].
        tuned: What of the impedance can be changed.
        regions: Names of what can be switched on and off.
        drags: Whether a device far away is led.
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
        # commands wait here until they are asked for
        self._buttons, self._commands = dict(c.value for c in Command), list[Command]()
        self._hand, self._drawn = dict[str, float](), list[list[float]]()
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
        """Take over what was set and pressed since the last look, and what the hand does."""
        heard = self._pages.heard()
        if heard.let_go:
            self._open()
        for name, value in heard.settings:
            if name in self._sliders:
                self._values[name] = self._sliders[name].nearest(value)
            elif value > 0.5:
                self._commands += [command for command in Command if command.value[0] == name]
        self._hand = heard.hand
        self._drawn += heard.drawn

    def drawn(self) -> list[list[float]]:
        """Return places of a pen that were drawn and not yet told, see :class:`Message`."""
        drawn, self._drawn = self._drawn, []
        return drawn

    def commands(self) -> list[Command]:
        """Return what was asked for and not yet told."""
        asked, self._commands = self._commands, []
        if Command.LET_GO in asked:
            self.let_go()
        return asked

    def let_go(self) -> None:
        """Take the hand off the tool, until it is heard again."""
        self._pages.open_hand()
        self._hand = {}
        self._open()

    def _open(self) -> None:
        self._values[_HOLD], self._held_from, self._dragged_from = 0.0, None, None

    def content(self) -> dict[str, object]:
        """Return what there is to set, for JSON.

        Sliders with their values, and buttons and pushes with their keys; what the hand does now,
        by name of what pulls or pushes, with how much a handle can pull [N], and how far it can
        drag [m], if it does that instead.
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
        """Return the controls as they are set now, see :class:`Operator`.

        Args:
            y_t: Where the tool point is [m], shape (3,); from there a hand that takes hold moves.
        """
        controls = self._idle.copy()
        controls[PULL] = self._asked(y_t)
        controls[REQUEST] = self._requests()
        if self._regions:
            controls[REGIONS] = [self._value(name) for name in self._regions]
        return controls

    def _value(self, name: str) -> float:
        return self._values[name]

    def _asked(self, y_t: np.ndarray) -> np.ndarray:
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
        """Return where a hand that drags wants the tool to be, shape (3,), if it does."""
        if not any(name in self._hand for name in self._drag):
            self._dragged_from = None
            return None
        if self._dragged_from is None and np.isfinite(y_t).all():
            self._dragged_from = y_t.copy()
        if self._dragged_from is None:
            return None
        way = [self._hand.get(name, 0.0) for name in self._drag]
        return self._dragged_from + np.clip(way, -_FARTHEST, _FARTHEST)

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
        """Return the damping of the tangential coordinates, in which free ones move [N s/m]."""
        sliders = (p.slider for p in self._tuned if p.index == index)
        return next((self._value(slider.name) for slider in sliders), _FREE_DAMPING)


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
