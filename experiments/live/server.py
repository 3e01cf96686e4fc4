"""The page of a live session, served on this machine to whom its token was given."""

import hmac
import json
import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

from pfsc_drake.errors import InputError

HOST = "127.0.0.1"
_LONGEST = 8192  # bytes of a message
# who still sends when it has its answer is heard out as far, and as long, so that it gets there
_MOST_READ, _HEARD_OUT = 1 << 20, 0.5  # bytes, s
_PATIENCE = 10.0  # s, until a connection on which nothing comes is closed
_POLL = 0.05  # s, in which it notices that it is to stop
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
        status: Returns what the page shows; called in other threads.
        hear: Told what the page posts, in other threads; returns whether the page leads, and
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
        self._token = secrets.token_urlsafe(16)
        page = _PAGE.read_text(encoding="utf-8")
        look = _LOOK.read_text(encoding="utf-8")
        page = page.replace(_STYLE, f"<style>\n{look}</style>")
        documents = {
            "": lambda: ("text/html; charset=utf-8", page),
            "status": lambda: ("application/json", json.dumps(status(), allow_nan=False)),
        }
        try:
            self._server = _Server((HOST, port), _handler(self._token, documents, hear))
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
        """Where the page is; whoever knows it may lead."""
        return f"http://{HOST}:{self._server.server_address[1]}/{self._token}/"

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
    token: str,
    documents: dict[str, Callable[[], tuple[str, str]]],
    hear: Callable[[bytes], bool],
) -> type[BaseHTTPRequestHandler]:
    """Return what answers for documents, each with its type, by name, and takes messages."""

    class Handler(BaseHTTPRequestHandler):
        """Answers GET and POST."""

        protocol_version = "HTTP/1.1"
        timeout = _PATIENCE

        def do_GET(self) -> None:
            if self._is_a_stranger(self.headers.get("Origin", self._own)):
                return
            document = documents.get(self._document)
            if document is None:
                self._answer(HTTPStatus.NOT_FOUND)
            else:
                self._answer(HTTPStatus.OK, *document())

        def do_POST(self) -> None:
            # what is not read must not be taken for the next request
            is_last, self.close_connection = self.close_connection, True
            if self._is_a_stranger(self.headers.get("Origin", "")):
                return
            size = self.headers.get("Content-Length", "")
            if self._document != "hear":
                self._answer(HTTPStatus.NOT_FOUND)
            elif not (size.isascii() and size.isdecimal()):
                self._answer(
                    HTTPStatus.LENGTH_REQUIRED, text="Content-Length is no number of bytes"
                )
            elif len(size) > len(str(_LONGEST)) or int(size) > _LONGEST:
                self._answer(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, text=f"allowed: {_LONGEST} bytes")
            else:
                content = self.rfile.read(int(size))
                self.close_connection = is_last
                self._hear(content)

        def _hear(self, content: bytes) -> None:
            try:
                leads = hear(content)
            except InputError as error:
                self._answer(HTTPStatus.BAD_REQUEST, text=str(error))
                return
            self._answer(HTTPStatus.NO_CONTENT if leads else HTTPStatus.CONFLICT)

        @property
        def _own(self) -> str:
            return f"http://{self.headers.get('Host')}"

        @property
        def _document(self) -> str:
            return self.path.partition("?")[0].removeprefix(f"/{token}/")

        def _is_a_stranger(self, origin: str) -> bool:
            """Refuse who is not this session's page, and return whether it did."""
            given = self.path.partition("?")[0].split("/")[1:2]
            knows = hmac.compare_digest("".join(given).encode("utf-8"), token.encode("utf-8"))
            if knows and origin == self._own and _is_here(self._own):
                return False
            self.close_connection = True
            self._answer(HTTPStatus.FORBIDDEN, text="open the address that the session has printed")
            return True

        def finish(self) -> None:
            with suppress(OSError, ValueError):
                self.wfile.flush()
                self.connection.shutdown(socket.SHUT_WR)
                self.connection.settimeout(_HEARD_OUT)
                self.rfile.read(_MOST_READ)
            super().finish()

        def _answer(
            self, status: HTTPStatus, kind: str = "text/plain; charset=utf-8", text: str = ""
        ) -> None:
            content = text.encode("utf-8")
            self.send_response(status)
            if status is not HTTPStatus.NO_CONTENT:
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(content)))
            for name, value in _HEADERS.items():
                self.send_header(name, value)
            if self.close_connection:
                self.send_header("Connection", "close")
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Leave the terminal to the session."""

    return Handler


def _is_here(origin: str) -> bool:
    """Whether an address names this machine as no other site can."""
    try:
        return urlsplit(origin).hostname in (HOST, "localhost")
    except ValueError:
        return False
