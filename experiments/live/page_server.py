"""Web page of a live session: served on localhost, controlled by one browser at a time."""

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

from pfsc_drake.errors import InputError, shorten

HOST = "127.0.0.1"
_LONGEST = 8192  # bytes of a message
_PATIENCE = 0.5  # s, for incomplete requests at the end
_SILENT = logging.Logger("live page", logging.CRITICAL + 1)
_HTML = "page.html"
# empty elements of the page, and the files of their contents
_CONTENTS = {"style": ("page.css",), "script": ("controls.js", "readings.js")}
# no other page may read the responses, show this page in a frame, or learn its address; it
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
# silence after which the hand lets go, and after which another page may take control [s]
SILENCE, _GONE = 0.3, 3.0
TAKE, LEAVE = "take", "leave"
_LONGEST_NAME = 64
_KEYS = ("client", "hand", "set", "lead", "draw")
# numbers of each point of a pen: right and up [m], and action of the pen
_STROKE = 3
_LONGEST_STROKE = 400  # points in a message
_LARGEST = sys.float_info.max


class PageInput(NamedTuple):
    """Input of the controlling page since the last call.

    Attributes:
        hand: Current actions of the hand by name of the control; others are zero, and all of them
            if the page is silent.
        settings: Sliders and buttons that were set, with their values, in order.
        let_go: Whether the hand has to open, since the page is silent or a different one.
        strokes: Points of a pen in order, each ``[right, up, kind]`` [m, m, 1].
    """

    hand: dict[str, float]
    settings: list[tuple[str, float]]
    let_go: bool
    strokes: list[list[float]]


class Pages:
    """Receiver of messages from pages in other threads, with the input of the controlling page.

    The first page that sends a message has control. The hand follows the last message, and lets go
    0.3 s after it, e.g. of a page that is closed, hidden or delayed. After 3 s, or when it leaves,
    another page gets control; any page may take control at any time.

    Args:
        clock: Returns the time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._lock = clock, threading.Lock()
        self._hands, self._settables = frozenset[str](), frozenset[str]()
        self._leader: str | None = None
        self._last, self._changed = -math.inf, False
        self._hand, self._settings = dict[str, float](), list[tuple[str, float]]()
        self._strokes = list[list[float]]()

    def expect(self, hand: Collection[str], settings: Collection[str]) -> None:
        """Define the known names.

        Args:
            hand: Names of controls of the hand.
            settings: Names of sliders and buttons.
        """
        self._hands, self._settables = frozenset(hand), frozenset(settings)

    def hear(self, content: bytes) -> bool:
        """Process a message, if its page has control; return whether it has.

        Args:
            content: A JSON object with ``client``, the name of the page, and optionally ``hand``
                and ``set``, objects of names and finite numbers, ``draw``, a list of points of a
                pen, and ``lead``: TAKE to take control, or LEAVE to release it.

        Raises:
            InputError: If it is malformed, or has unknown names.
        """
        entries = _entries(content)
        hand = _numbers(entries, "hand", self._hands)
        settings = _numbers(entries, "set", self._settables)
        strokes, client, lead = _pen_points(entries), entries["client"], entries.get("lead", "")
        with self._lock:
            now = self._clock()
            is_new = client != self._leader
            if is_new and lead != TAKE and not self._is_free(now):
                return False
            if is_new or lead == LEAVE:
                self._hand, self._settings, self._strokes, self._changed = {}, [], [], True
            if lead == LEAVE:
                self._leader, self._last = None, -math.inf
                return False
            self._leader, self._last, self._hand = client, now, hand
            self._settings += settings.items()
            self._strokes += strokes
        return True

    def _is_free(self, now: float) -> bool:
        return self._leader is None or now - self._last > _GONE

    @property
    def leader(self) -> str | None:
        """The controlling page, or None."""
        with self._lock:
            return None if self._is_free(self._clock()) else self._leader

    def collect(self) -> PageInput:
        """Return the input since the last call."""
        with self._lock:
            silent = self._clock() - self._last > SILENCE
            hand, let_go = {} if silent else self._hand, silent or self._changed
            heard = PageInput(hand, self._settings, let_go, self._strokes)
            self._settings, self._strokes, self._changed = [], [], False
        return heard

    def open_hand(self) -> None:
        """Clear the hand's actions until the next message."""
        with self._lock:
            self._hand = {}


def _entries(content: bytes) -> dict[str, Any]:
    """Return the entries of a message."""
    try:
        entries = json.loads(content)
    except (ValueError, RecursionError):
        raise InputError("the message is not JSON") from None
    if not isinstance(entries, dict):
        raise InputError("the message is not a JSON object")
    for key in entries:
        if key not in _KEYS:
            raise InputError(f"{shorten(repr(key))}; allowed: {', '.join(_KEYS)}")
    client, lead = entries.get("client"), entries.get("lead", "")
    if not isinstance(client, str) or not 0 < len(client) <= _LONGEST_NAME:
        raise InputError(f"client; allowed: a name of 1 to {_LONGEST_NAME} characters")
    if lead not in ("", TAKE, LEAVE):
        raise InputError(f"lead = {shorten(repr(lead))}; allowed: {TAKE}, {LEAVE}, or empty")
    return entries


def _pen_points(entries: dict[str, Any]) -> list[list[float]]:
    """Return the points of a pen."""
    points = entries.get("draw", [])
    if not (
        isinstance(points, list)
        and len(points) <= _LONGEST_STROKE
        and all(isinstance(point, list) and len(point) == _STROKE for point in points)
    ):
        raise InputError(
            f"draw; allowed: a list of at most {_LONGEST_STROKE} points, {_STROKE} numbers each"
        )
    return [[_number("draw", value) for value in point] for point in points]


def _numbers(entries: dict[str, Any], key: str, known: Collection[str]) -> dict[str, float]:
    """Return an entry's finite numbers by name."""
    values = entries.get(key, {})
    if not isinstance(values, dict):
        raise InputError(f"{key}; allowed: an object of names and numbers")
    numbers = {name: _number(name, value) for name, value in values.items()}
    for name in numbers:
        if name not in known:
            raise InputError(f"{shorten(repr(name))} is not a control of this session")
    return numbers


def _number(name: str, value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    # a larger integer has no float
    if not (is_number and -_LARGEST <= value <= _LARGEST):
        raise InputError(f"{shorten(repr(name))}; allowed: a finite number")
    return float(value)


class PageServer:
    """HTTP server of a session's page for browsers on this machine.

    The page is at ``/TOKEN/`` with a random token; ``status`` below it is the status in JSON, and
    its input is posted to ``hear``. Each request must name this machine as its host, which prevents
    DNS rebinding, and must not come from another origin; posts must come from the page itself.

    Args:
        port: Port of the page; 0 for any free port.
        pages: Receiver of the page's posts, in another thread.
        status: Returns the status for the page; called in another thread.

    Raises:
        InputError: If the port is taken or not allowed.
    """

    def __init__(self, port: int, pages: Pages, status: Callable[[], dict[str, object]]) -> None:
        self._token, self._pages, self._status = secrets.token_urlsafe(16), pages, status
        self._page = _page()
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
        # no messages to the terminal
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
            refusal = _response(403, "open the address printed by the session")
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
            return _response(411, "Content-Length must be a number of bytes")
        if size > _LONGEST:
            return _response(413, f"allowed: {_LONGEST} bytes")
        try:
            leads = self._pages.hear(await request.read())
        except InputError as error:
            return _response(400, str(error))
        return _response(204 if leads else 409)


def _page() -> str:
    """Return the page with its style and scripts in it."""
    page = _read(_HTML)
    for element, files in _CONTENTS.items():
        content = "\n".join(map(_read, files))
        page = page.replace(f"<{element}></{element}>", f"<{element}>\n{content}</{element}>")
    return page


def _read(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def _response(status: int, text: str = "", kind: str = "text/plain") -> web.Response:
    return web.Response(status=status, text=text, content_type=kind, headers=_HEADERS)


def _is_here(origin: str) -> bool:
    """Return whether an address names this machine literally."""
    try:
        return urlsplit(origin).hostname in (HOST, "localhost")
    except ValueError:
        return False
