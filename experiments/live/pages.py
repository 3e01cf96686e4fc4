"""Who leads: of the pages of a session one at a time, and only for as long as it is heard."""

import json
import math
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from pfsc_drake.errors import InputError, shortened

# of silence, after which a hand lets go, and after which another page may lead [s]
SILENCE, _GONE = 0.3, 3.0
TAKE, LEAVE = "take", "leave"
_LEADS = ("", TAKE, LEAVE)
_LONGEST_NAME = 64
_KEYS = ("client", "hand", "set", "lead", "draw")
# numbers of each place of a pen: to the right and upwards [m], and what the pen does
_STROKE = 3
_LONGEST_STROKE = 400  # places in a message


@dataclass(frozen=True)
class Message:
    """What a page says, some twenty times a second.

    Attributes:
        client: Who says it, a name that the page gives itself.
        hand: What the hand does now, by name of what pulls or pushes; what has no name rests.
        settings: Sliders and buttons that are set now, once, by name.
        lead: TAKE, to lead from now on whoever did; LEAVE, to lead no more; or empty.
        drawn: Places of a pen since the last message, each ``[right, up, kind]`` [m, m, 1].
    """

    client: str
    hand: dict[str, float] = field(default_factory=dict)
    settings: dict[str, float] = field(default_factory=dict)
    lead: str = ""
    drawn: list[list[float]] = field(default_factory=list)


@dataclass(frozen=True)
class Heard:
    """What was heard since the last time.

    Attributes:
        hand: What the hand does now; nothing if it is silent.
        settings: What was set, in its order.
        let_go: Whether the hand has to open: it is silent, or it is another one.
        drawn: Places of a pen, in their order, see :class:`Message`.
    """

    hand: dict[str, float]
    settings: list[tuple[str, float]]
    let_go: bool
    drawn: list[list[float]] = field(default_factory=list)


class Pages:
    """Listens to pages in their threads, and tells the session what the one that leads wants.

    The first page that is heard leads. A hand is what the last message says it is, and nothing
    0.3 s after it: a page that is closed, hidden, or held up has let go. After 3 s, or when it says
    that it leaves, another one leads that is heard; any may take the lead at any time.

    Args:
        clock: Tells the time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._lock = clock, threading.Lock()
        self._hands, self._settables = frozenset[str](), frozenset[str]()
        self._leader: str | None = None
        self._last, self._changed = -math.inf, False
        self._hand, self._settings = dict[str, float](), list[tuple[str, float]]()
        self._drawn = list[list[float]]()

    def expect(self, hand: Collection[str], settings: Collection[str]) -> None:
        """Say which names there are.

        Args:
            hand: Hand of what pulls and pushes.
            settings: Settings of sliders and buttons.
        """
        self._hands, self._settables = frozenset(hand), frozenset(settings)

    def hear(self, content: bytes) -> bool:
        """Take over a message, if its page leads; return whether it does.

        Args:
            content: The message as JSON, see :func:`message_of`.

        Raises:
            InputError: If it is none, or names what is not there.
        """
        message = message_of(content)
        for group, known in ((message.hand, self._hands), (message.settings, self._settables)):
            for name in group:
                if name not in known:
                    raise InputError(f"{shortened(repr(name))} is no control of this session")
        with self._lock:
            return self._take(message)

    def _take(self, message: Message) -> bool:
        now = self._clock()
        is_new = message.client != self._leader
        if is_new and message.lead != TAKE and not self._is_free(now):
            return False
        if is_new or message.lead == LEAVE:
            self._settings.clear()
            self._drawn.clear()
            self._hand, self._changed = {}, True
        if message.lead == LEAVE:
            self._leader, self._last = None, -math.inf
            return False
        self._leader, self._last = message.client, now
        self._hand = message.hand
        self._settings += message.settings.items()
        self._drawn += message.drawn
        return True

    def _is_free(self, now: float) -> bool:
        return self._leader is None or now - self._last > _GONE

    @property
    def leader(self) -> str | None:
        """The page that leads, or None."""
        with self._lock:
            return None if self._is_free(self._clock()) else self._leader

    def heard(self) -> Heard:
        """Return what was heard since the last time."""
        with self._lock:
            silent = self._clock() - self._last > SILENCE
            hand, let_go = {} if silent else self._hand, silent or self._changed
            heard = Heard(hand, self._settings, let_go, self._drawn)
            self._settings, self._drawn, self._changed = [], [], False
        return heard

    def open_hand(self) -> None:
        """Forget what the hand does, until it is heard again."""
        with self._lock:
            self._hand = {}


def message_of(content: bytes) -> Message:
    """Return the message that JSON holds.

    An object with ``client``, and where there is something to say ``hand`` and ``set``, objects of
    names and finite numbers, ``lead``, and ``draw``, a list of places of a pen.

    Args:
        content: The JSON.

    Raises:
        InputError: If it is anything else; says what.
    """
    try:
        entries = json.loads(content)
    except (ValueError, RecursionError):
        raise InputError("the message is not JSON") from None
    if not isinstance(entries, dict):
        raise InputError("the message is no JSON object")
    for key in entries:
        if key not in _KEYS:
            raise InputError(f"{shortened(repr(key))}; allowed: {', '.join(_KEYS)}")
    client, lead = entries.get("client"), entries.get("lead", "")
    if not isinstance(client, str) or not 0 < len(client) <= _LONGEST_NAME:
        raise InputError(f"client; allowed: a name of 1 to {_LONGEST_NAME} characters")
    if lead not in _LEADS:
        raise InputError(f"lead = {shortened(repr(lead))}; allowed: {TAKE}, {LEAVE}, or empty")
    hand, settings = _numbers(entries, "hand"), _numbers(entries, "set")
    return Message(client, hand, settings, lead, _places(entries.get("draw", [])))


def _places(given: object) -> list[list[float]]:
    """Return places of a pen."""
    allowed = f"draw; allowed: a list of at most {_LONGEST_STROKE} places, {_STROKE} numbers each"
    if not isinstance(given, list) or len(given) > _LONGEST_STROKE:
        raise InputError(allowed)
    for place in given:
        if not isinstance(place, list) or len(place) != _STROKE:
            raise InputError(allowed)
    return [[_number("draw", value) for value in place] for place in given]


def _numbers(entries: dict[str, object], key: str) -> dict[str, float]:
    """Return an entry's finite numbers by name."""
    given = entries.get(key, {})
    if not isinstance(given, dict):
        raise InputError(f"{key}; allowed: an object of names and numbers")
    return {name: _number(name, value) for name, value in given.items()}


def _number(name: str, value: object) -> float:
    number = math.nan
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{shortened(repr(name))}; allowed: a finite number")
    return number
