"""The controls of a live session: handles, sliders and buttons, keys and a gamepad."""

import enum
from collections.abc import Sequence

import numpy as np

from diagrams.surroundings.operator import PULL, REGIONS, REQUEST, idle_controls
from experiments.live.controls import Slider, TunedParameter
from experiments.live.pages import Pages
from pfsc_drake.control.compliance.tuned_impedance import requests_of
from pfsc_drake.control.manifolds.coordinate import Kind

_DEAD_ZONE = 0.12  # of a stick
_FARTHEST = 0.3  # m, of the place to hold at from where the hand took hold
_FREE_DAMPING = 90.0  # N s/m, where it varies along the manifold: Tab. 4.3
_AXES = "xyz"
_KEYS = (("KeyW", "KeyS"), ("KeyA", "KeyD"), ("KeyR", "KeyF"))
_STRENGTH, _GUIDE, _HOLD = "key force [N]", "guide (K, J)", "hold (T, G)"


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

    Args:
        pages: Who sets it.
        force_limit: Of the hand [N].
        tuned: What of the impedance can be changed.
        regions: Names of what can be switched on and off.
    """

    def __init__(
        self,
        pages: Pages,
        force_limit: float,
        tuned: Sequence[TunedParameter],
        regions: Sequence[str],
    ) -> None:
        self._pages, self._tuned, self._force_limit = pages, tuned, force_limit
        self._idle = idle_controls(regions)
        across, _ = requests_of(Kind.TRANSVERSAL)
        self._can_be_free = any(parameter.index == across for parameter in tuned)
        self._pull = [f"pull {axis} [N]" for axis in _AXES]
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
        self._hand = dict[str, float]()
        self._held_from: np.ndarray | None = None
        pages.expect([*self._pull, *self._stick, *self._pushes], [*self._sliders, *self._buttons])

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
        self._values[_HOLD], self._held_from = 0.0, None

    def content(self) -> dict[str, object]:
        """Return what there is to set, for JSON.

        Sliders with their values, and buttons and pushes with their keys; what the hand does now,
        by name of what pulls or pushes, and with how much a handle can pull [N].
        """
        rigid = {p.slider.name for p in self._tuned if p.top_is_rigid}
        sliders = [
            {
                "name": slider.name,
                "group": slider.group,
                "low": slider.low,
                "high": slider.high,
                "step": slider.step,
                "keys": slider.keys,
                "rigid_top": slider.name in rigid,
                "value": self._value(slider.name),
            }
            for slider in self._sliders.values()
        ]
        pushes = {name: key for name, (_, _, key) in self._pushes.items()}
        return {
            "sliders": sliders,
            "buttons": self._buttons,
            "pushes": pushes,
            "hand": self._hand,
            "force_limit": self._force_limit,
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
        holds = self._value(_HOLD) > 0.5
        if holds and self._held_from is None and np.isfinite(y_t).all():
            self._held_from = y_t.copy()
            self._values |= dict.fromkeys(self._place, 0.0)
        if not holds or self._held_from is None:
            self._held_from = None
            return np.concatenate([push, np.zeros(4)])
        moved = self._held_from + [self._value(name) for name in self._place]
        return np.concatenate([push, [1.0], moved])

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
