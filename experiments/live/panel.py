"""The controls of a live session: in Meshcat's own panel, on the page, on keys and a gamepad."""

import enum
import math
import time
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue

import numpy as np
from pydrake.geometry import Meshcat

from diagrams.surroundings.operator import PULL, REGIONS, WISH, idle_controls
from experiments.live.controls import Slider, TunedParameter
from pfsc_drake.control.compliance.tuned_impedance import wishes_of
from pfsc_drake.control.manifolds.manifold import Kind

# how long a key pushes after it was pressed; it repeats while it is held, first after half a second
_PRESS = 0.6  # s
_DEAD_ZONE = 0.12  # of a stick
_FARTHEST = 0.3  # m, of the place to hold at from where the hand took hold
_FREE_DAMPING = 90.0  # N s/m, where it varies along the manifold: Tab. 4.3
_AXES = "xyz"
_KEYS = (("KeyW", "KeyS"), ("KeyA", "KeyD"), ("KeyR", "KeyF"))
# axes of a gamepad that push along x, y, z: forward, to the left and up; sticks read down and right
_STICKS = (1, 0, 3)
_STRENGTH, _GUIDE, _HOLD = "key force [N]", "guide (K, J)", "hold (T, G)"

# from other threads
Requests = SimpleQueue[tuple[str, float]]


class Command(enum.Enum):
    """What a person can ask of the session, with the label and key of its button."""

    LET_GO = "let go (space)", "Space"
    RECORD = "record (C)", "KeyC"
    RESET = "reset (X)", "KeyX"
    END = "end (Q)", "KeyQ"


class Panel:
    """Sliders and buttons in Meshcat, read as the controls of an operator.

    What is set on the page comes here by a queue, from other threads, and is set in Meshcat: there
    is one truth, wherever it is looked at.

    Args:
        meshcat: Where they are shown.
        requests: What the page asks for: name of a slider and its value, or name of a button and
            1 while it is pressed, 0 when it is released.
        force_limit: Of the hand [N].
        tuned: What of the impedance can be changed.
        regions: Names of what can be switched on and off.
        clock: Tells the time [s].
    """

    def __init__(
        self,
        meshcat: Meshcat,
        requests: Requests,
        force_limit: float,
        tuned: Sequence[TunedParameter],
        regions: Sequence[str],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._requests, self._meshcat, self._tuned, self._clock = requests, meshcat, tuned, clock
        self._force_limit, self._idle = force_limit, idle_controls(regions)
        across, _ = wishes_of(Kind.TRANSVERSAL)
        self._can_be_free = any(parameter.index == across for parameter in tuned)
        self._pull = [f"pull {axis} [N]" for axis in _AXES]
        self._place = [f"hold d{axis} [m]" for axis in _AXES]
        self._regions = [f"region {name}" for name in regions]
        self._sliders = {slider.name: slider for slider in self._all_sliders()}
        self._pushes = {
            f"push {sign}{axis} ({key[-1]})": (i, 1.0 if sign == "+" else -1.0, key)
            for i, axis in enumerate(_AXES)
            for sign, key in zip("+-", _KEYS[i], strict=True)
        }
        buttons = {name: key for name, (_, _, key) in self._pushes.items()}
        self._buttons = buttons | dict(command.value for command in Command)
        self._clicks = dict.fromkeys(self._buttons, 0)
        # when a button was pressed last; commands wait here until they are asked for
        self._pressed, self._commands = dict[str, float](), list[Command]()
        self._held_from: np.ndarray | None = None
        for slider in self._sliders.values():
            meshcat.AddSlider(
                slider.name, slider.low, slider.high, slider.step, slider.value, *slider.keys
            )
        for name, key in self._buttons.items():
            meshcat.AddButton(name, key)

    def _all_sliders(self) -> list[Slider]:
        limit = self._force_limit
        found = [Slider(name, "pull", -limit, limit, limit / 45.0, 0.0) for name in self._pull]
        found.append(Slider(_STRENGTH, "keys", 0.0, limit, limit / 45.0, 20.0 * limit / 45.0))
        found.append(Slider(_HOLD, "switch", 0.0, 1.0, 1.0, 0.0, ("KeyG", "KeyT")))
        found += [Slider(name, "hold", -_FARTHEST, _FARTHEST, 0.005, 0.0) for name in self._place]
        if self._can_be_free:
            found.append(Slider(_GUIDE, "switch", 0.0, 1.0, 1.0, 1.0, ("KeyJ", "KeyK")))
        found += [parameter.slider for parameter in self._tuned]
        found += [Slider(name, "switch", 0.0, 1.0, 1.0, 1.0) for name in self._regions]
        return found

    def look(self) -> None:
        """Take over what was set and pressed since the last look."""
        for name in self._buttons:
            clicks = self._meshcat.GetButtonClicks(name)
            if clicks > self._clicks[name]:
                self._press(name)
            self._clicks[name] = clicks
        while True:
            try:
                name, value = self._requests.get_nowait()
            except Empty:
                return
            if name in self._sliders:
                self._meshcat.SetSliderValue(name, value)
            elif name in self._buttons and value > 0.5:
                self._press(name)
            else:
                self._pressed.pop(name, None)

    def _press(self, name: str) -> None:
        self._pressed[name] = self._clock()
        self._commands += [command for command in Command if command.value[0] == name]

    def commands(self) -> list[Command]:
        """Return what was asked for and not yet told."""
        asked, self._commands = self._commands, []
        if Command.LET_GO in asked:
            self.let_go()
        return asked

    def let_go(self) -> None:
        """Take the hand off the tool."""
        for name in (*self._pull, _HOLD):
            self._meshcat.SetSliderValue(name, 0.0)
        self._pressed.clear()
        self._held_from = None

    def content(self) -> dict[str, object]:
        """Return what there is to set, for JSON: sliders with their values, buttons with keys."""
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
        return {"sliders": sliders, "buttons": self._buttons}

    def read(self, y_t: np.ndarray) -> np.ndarray:
        """Return the controls as they are set now, see :class:`Operator`.

        Args:
            y_t: Where the tool point is [m], shape (3,); from there a hand that takes hold moves.
        """
        controls = self._idle.copy()
        controls[PULL] = self._asked(y_t)
        controls[WISH] = self._wishes()
        if self._regions:
            controls[REGIONS] = [self._value(name) for name in self._regions]
        return controls

    def _value(self, name: str) -> float:
        return float(self._meshcat.GetSliderValue(name))

    def _asked(self, y_t: np.ndarray) -> np.ndarray:
        """Return push, hold and target, shape (7,)."""
        push = np.array([self._value(name) for name in self._pull])
        push += self._key_push() + self._stick_push()
        holds = self._value(_HOLD) > 0.5
        if holds and self._held_from is None and np.isfinite(y_t).all():
            self._held_from = y_t.copy()
            for name in self._place:
                self._meshcat.SetSliderValue(name, 0.0)
        if not holds or self._held_from is None:
            self._held_from = None
            return np.concatenate([push, np.zeros(4)])
        moved = self._held_from + [self._value(name) for name in self._place]
        return np.concatenate([push, [1.0], moved])

    def _key_push(self) -> np.ndarray:
        now, push = self._clock(), np.zeros(3)
        strength = self._value(_STRENGTH)
        for name, (axis, sign, _) in self._pushes.items():
            if now - self._pressed.get(name, -math.inf) < _PRESS:
                push[axis] += sign * strength
        return push

    def _stick_push(self) -> np.ndarray:
        axes = self._meshcat.GetGamepad().axes
        if len(axes) <= max(_STICKS):
            return np.zeros(3)
        sticks = -np.array([axes[i] for i in _STICKS])
        beyond = np.maximum(np.abs(sticks) - _DEAD_ZONE, 0.0) / (1.0 - _DEAD_ZONE)
        return np.sign(sticks) * beyond * self._force_limit

    def _wishes(self) -> np.ndarray:
        wishes = self._idle[WISH].copy()
        for parameter in self._tuned:
            wishes[parameter.index] = parameter.wish(self._value(parameter.slider.name))
        if self._can_be_free and self._value(_GUIDE) < 0.5:
            _, along = wishes_of(Kind.TANGENTIAL)
            stiffness, damping = wishes_of(Kind.TRANSVERSAL)
            wishes[stiffness], wishes[damping] = 0.0, self._damping_along(along)
        return wishes

    def _damping_along(self, index: int) -> float:
        """Return the damping of the tangential coordinates, in which free ones move [N s/m]."""
        sliders = (p.slider for p in self._tuned if p.index == index)
        return next((self._value(slider.name) for slider in sliders), _FREE_DAMPING)
