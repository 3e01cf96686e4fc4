"""The page of a live session: served on this machine alone, and led by one browser at a time."""

import asyncio
import hmac
import json
import logging
import math
import secrets
import socket
import sys
import threading
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from aiohttp import web

from pfsc_drake.errors import InputError, shortened

HOST = "127.0.0.1"
_LONGEST = 8192  # bytes of a message
_PATIENCE = 0.5  # s, with requests that are not complete at the end
_SILENT = logging.Logger("live page", logging.CRITICAL + 1)
_PAGE, _LOOK = (Path(__file__).with_name(f"page.{kind}") for kind in ("html", "css"))
_STYLE = "<style></style>"
# no other page may read the answers, show this page in a frame, or learn its address from it; it
# loads nothing from anywhere but the scene
_HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data:; connect-src 'self'; frame-src http:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
}
# of silence, after which a hand lets go, and after which another page may lead [s]
SILENCE, _GONE = 0.3, 3.0
TAKE, LEAVE = "take", "leave"
_LONGEST_NAME = 64
_KEYS = ("client", "hand", "set", "lead", "draw")
# numbers of each place of a pen: to the right and upwards [m], and what the pen does
_STROKE = 3
_LONGEST_STROKE = 400  # places in a message
_LARGEST = sys.float_info.max


class Heard(NamedTuple):
    """What the page that leads has sent since the last time.

    Attributes:
        hand: What the hand does now, by name of what pulls or pushes; what has no name rests, and
            all of it if the page is silent.
        settings: Sliders and buttons that were set, with their values, in their order.
        let_go: Whether the hand has to open: it is silent, or it is another one.
        drawn: Places of a pen in their order, each ``[right, up, kind]`` [m, m, 1].
    """

    hand: dict[str, float]
    settings: list[tuple[str, float]]
    let_go: bool
    drawn: list[list[float]]


class Pages:
    """Receives messages of pages in other threads, and reports what the one that leads wants.

    The first page that is heard leads. A hand is what the last message says it is, and nothing
    0.3 s after it: a page that is closed, hidden, or held up has let go. After 3 s, or when it says
    that it leaves, another one leads that is heard; any may take the lead at any time.

    Args:
        clock: Returns the time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._lock = clock, threading.Lock()
        self._hands, self._settables = frozenset[str](), frozenset[str]()
        self._leader: str | None = None
        self._last, self._changed = -math.inf, False
        self._hand, self._settings = dict[str, float](), list[tuple[str, float]]()
        self._drawn = list[list[float]]()

    def expect(self, hand: Collection[str], settings: Collection[str]) -> None:
        """Define which names there are.

        Args:
            hand: Names of what pulls and pushes.
            settings: Names of sliders and buttons.
        """
        self._hands, self._settables = frozenset(hand), frozenset(settings)

    def hear(self, content: bytes) -> bool:
        """Take over a message, if its page leads; return whether it does.

        Args:
            content: A JSON object with ``client``, a name that the page gives itself, and where
                there is something to say ``hand`` and ``set``, objects of names and finite numbers,
                ``draw``, a list of places of a pen, and ``lead``: TAKE, to lead from now on whoever
                did, or LEAVE, to lead no more.

        Raises:
            InputError: If it is anything else, or names what is not there.
        """
        entries = _entries(content)
        hand = _numbers(entries, "hand", self._hands)
        settings = _numbers(entries, "set", self._settables)
        drawn, client, lead = _places(entries), entries["client"], entries.get("lead", "")
        with self._lock:
            now = self._clock()
            is_new = client != self._leader
            if is_new and lead != TAKE and not self._is_free(now):
                return False
            if is_new or lead == LEAVE:
                self._hand, self._settings, self._drawn, self._changed = {}, [], [], True
            if lead == LEAVE:
                self._leader, self._last = None, -math.inf
                return False
            self._leader, self._last, self._hand = client, now, hand
            self._settings += settings.items()
            self._drawn += drawn
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


def _entries(content: bytes) -> dict[str, Any]:
    """Return the entries of a message."""
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
    if lead not in ("", TAKE, LEAVE):
        raise InputError(f"lead = {shortened(repr(lead))}; allowed: {TAKE}, {LEAVE}, or empty")
    return entries


def _places(entries: dict[str, Any]) -> list[list[float]]:
    """Return places of a pen."""
    places = entries.get("draw", [])
    if not (
        isinstance(places, list)
        and len(places) <= _LONGEST_STROKE
        and all(isinstance(place, list) and len(place) == _STROKE for place in places)
    ):
        raise InputError(
            f"draw; allowed: a list of at most {_LONGEST_STROKE} places, {_STROKE} numbers each"
        )
    return [[_number("draw", value) for value in place] for place in places]


def _numbers(entries: dict[str, Any], key: str, known: Collection[str]) -> dict[str, float]:
    """Return an entry's finite numbers by name."""
    given = entries.get(key, {})
    if not isinstance(given, dict):
        raise InputError(f"{key}; allowed: an object of names and numbers")
    numbers = {name: _number(name, value) for name, value in given.items()}
    for name in numbers:
        if name not in known:
            raise InputError(f"{shortened(repr(name))} is no control of this session")
    return numbers


def _number(name: str, value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    # a larger integer has no float
    if not (is_number and -_LARGEST <= value <= _LARGEST):
        raise InputError(f"{shortened(repr(name))}; allowed: a finite number")
    return float(value)


class PageServer:
    """Serves the page of a session to browsers on this machine.

    Behind ``/TOKEN/``, which nobody can guess, is the page; ``status`` there is what it shows, in
    JSON, and what it wants is posted to ``hear``. Every request has to name this machine as its
    host, which keeps out names of other sites that were made to point here, and must not come from
    a page of another origin; what is posted has to come from the page itself.

    Args:
        port: Port of the page; 0 for any that is free.
        pages: Receives what the page posts, in another thread.
        status: Returns what the page shows beside who leads; called in another thread.

    Raises:
        InputError: If the port is taken or not allowed.
    """

    def __init__(self, port: int, pages: Pages, status: Callable[[], dict[str, object]]) -> None:
        self._token, self._pages, self._status = secrets.token_urlsafe(16), pages, status
        look = _LOOK.read_text(encoding="utf-8")
        self._page = _PAGE.read_text(encoding="utf-8").replace(_STYLE, f"<style>\n{look}</style>")
        try:
            listening = socket.create_server((HOST, port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "no port"
            raise InputError(
                f"--port {port}: {reason}; allowed: a free port from 1024 to 65535, or 0 for any"
            ) from None
        self.url = f"http://{HOST}:{listening.getsockname()[1]}/{self._token}/"
        self._asyncio = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        loop = self._asyncio.get_loop()
        # the terminal is the session's
        server = web.Server(self._answer, loop=loop, access_log=None, logger=_SILENT)
        self._served = web.ServerRunner(server, shutdown_timeout=_PATIENCE)
        loop.run_until_complete(self._served.setup())
        loop.run_until_complete(web.SockSite(self._served, listening).start())
        self._thread = threading.Thread(target=loop.run_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        loop = self._asyncio.get_loop()
        loop.call_soon_threadsafe(loop.stop)
        self._thread.join()
        loop.run_until_complete(self._served.cleanup())
        self._asyncio.close()

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        path = request.raw_path.partition("?")[0]
        own = f"http://{request.headers.get('Host')}"
        origin = request.headers.get("Origin", own if request.method == "GET" else "")
        token, _, document = path.removeprefix("/").partition("/")
        knows = hmac.compare_digest(*(t.encode("utf-8", "replace") for t in (token, self._token)))
        if not (knows and origin == own and _is_here(own)):
            refusal = _response(403, "open the address that the session has printed")
            refusal.force_close()
            return refusal
        match request.method, document:
            case "GET", "":
                return _response(200, self._page, "text/html")
            case "GET", "status":
                shown = self._status() | {"lead": self._pages.leader}
                return _response(200, json.dumps(shown, allow_nan=False), "application/json")
            case "POST", "hear":
                return await self._take(request)
        return _response(404)

    async def _take(self, request: web.BaseRequest) -> web.Response:
        size = request.content_length
        if size is None:
            return _response(411, "Content-Length is no number of bytes")
        if size > _LONGEST:
            return _response(413, f"allowed: {_LONGEST} bytes")
        try:
            leads = self._pages.hear(await request.read())
        except InputError as error:
            return _response(400, str(error))
        return _response(204 if leads else 409)


def _response(status: int, text: str = "", kind: str = "text/plain") -> web.Response:
    return web.Response(status=status, text=text, content_type=kind, headers=_HEADERS)


def _is_here(origin: str) -> bool:
    """Whether an address names this machine as no other site can."""
    try:
        return urlsplit(origin).hostname in (HOST, "localhost")
    except ValueError:
        return False
