"""The page of a live session, served on this machine to whom its token was given."""

import asyncio
import hmac
import json
import logging
import secrets
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

from aiohttp import web

from pfsc_drake.errors import InputError

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


class PageServer:
    """Serves the page of a session to browsers on this machine.

    Behind ``/TOKEN/``, which nobody can guess, is the page; ``status`` there is what it shows, in
    JSON, and what it wants is posted to ``hear``. Every request has to name this machine as its
    host, which keeps out names of other sites that were made to point here, and must not come from
    a page of another origin; what is posted has to come from the page itself.

    Args:
        port: Port of the page; 0 for any that is free.
        status: Returns what the page shows; called in another thread.
        hear: Receives what the page posts, in another thread; returns whether the page leads, and
            raises InputError if it is nonsense.

    Raises:
        InputError: If the port is taken or not allowed.
    """

    def __init__(
        self,
        port: int,
        status: Callable[[], dict[str, object]],
        hear: Callable[[bytes], bool],
    ) -> None:
        self._token, self._status, self._hear = secrets.token_urlsafe(16), status, hear
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
                return _response(
                    200, json.dumps(self._status(), allow_nan=False), "application/json"
                )
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
            leads = self._hear(await request.read())
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
