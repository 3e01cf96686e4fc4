"""The page of a live session, served on this machine alone, and what it asks for."""

import json
import math
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

from pfsc_drake.errors import InputError

HOST = "127.0.0.1"
_LONGEST = 1000  # bytes of a request
_POLL = 0.05  # s, in which it notices that it is to stop
_PAGE = Path(__file__).with_name("page.html")
# no other page may read the status or show this one; Meshcat is in a frame of it
_HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class PageServer:
    """Serves the page of a session to browsers on this machine.

    ``/`` is the page, ``/status`` what it shows, in JSON. What it asks for is posted to ``/set``, a
    JSON list of a name and a number; nobody but the page itself can do so.

    Args:
        port: Of the page; 0 for any that is free.
        meshcat_url: What the page shows in its frame.
        status: Returns what the page shows beside it; called in other threads.
        request: Told what the page asks for; called in other threads.

    Raises:
        InputError: If the port is taken or not allowed.
    """

    def __init__(
        self,
        port: int,
        meshcat_url: str,
        status: Callable[[], dict[str, object]],
        request: Callable[[tuple[str, float]], None],
    ) -> None:
        page = _PAGE.read_text(encoding="utf-8").replace("MESHCAT_URL", meshcat_url)
        documents = {
            "/": lambda: ("text/html; charset=utf-8", page),
            "/status": lambda: ("application/json", json.dumps(status(), allow_nan=False)),
        }
        try:
            self._server = _Server((HOST, port), _handler(documents, request))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "no port"
            raise InputError(
                f"--port {port}: {reason}; allowed: a free port from 1024 to 65535, or 0 for any"
            ) from None
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=[_POLL], daemon=True
        )
        self._thread.start()

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self._server.server_address[1]}/"

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    allow_reuse_address = True

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing about browsers that have gone."""


def _handler(
    documents: dict[str, Callable[[], tuple[str, str]]],
    request: Callable[[tuple[str, float]], None],
) -> type[BaseHTTPRequestHandler]:
    """Return what answers for documents, each with its type, by path, and takes requests."""

    class Handler(BaseHTTPRequestHandler):
        """Answers GET and POST."""

        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            document = documents.get(self.path.partition("?")[0])
            if document is None:
                self._answer(HTTPStatus.NOT_FOUND, "text/plain", "")
            else:
                self._answer(HTTPStatus.OK, *document())

        def do_POST(self) -> None:
            self.close_connection = True
            own = f"http://{self.headers.get('Host')}"
            if self.path != "/set" or self.headers.get("Origin") != own or not _is_here(own):
                self._answer(HTTPStatus.FORBIDDEN, "text/plain", "")
                return
            size = self.headers.get("Content-Length", "")
            asked = _asked(self.rfile.read(min(int(size), _LONGEST)) if size.isdecimal() else b"")
            if asked is not None:
                request(asked)
            fine = HTTPStatus.BAD_REQUEST if asked is None else HTTPStatus.NO_CONTENT
            self._answer(fine, "text/plain", "")

        def _answer(self, status: HTTPStatus, kind: str, text: str) -> None:
            content = text.encode("utf-8")
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            for name, value in _HEADERS.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Leave the terminal to the session."""

    return Handler


def _is_here(origin: str) -> bool:
    """Whether an address names this machine as no other site can."""
    return urlsplit(origin).hostname in (HOST, "localhost")


def _asked(content: bytes) -> tuple[str, float] | None:
    """Return a name and a finite number from JSON, or None if it is anything else."""
    try:
        name, value = json.loads(content)
        asked = str(name), float(value)
    except (ValueError, TypeError, RecursionError):
        return None
    return asked if math.isfinite(asked[1]) else None
