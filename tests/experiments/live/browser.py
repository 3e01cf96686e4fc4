"""A browser without a window, over a pipe: no port, no library."""

import fcntl
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_OPTIONS = (
    "--headless",
    "--no-sandbox",  # as root
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-pipe",
    "--window-size=900,700",
)


def find_browser() -> str | None:
    """Return a browser of this machine, if it has one."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """Chromium, told what to do by its DevTools protocol."""

    def __init__(self, program: str, folder: Path) -> None:
        (orders, self._out), (self._in, replies) = os.pipe(), os.pipe()

        def attach() -> None:
            """Make the pipes the files 3 and 4, whatever these are."""
            pair = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (orders, replies)]
            for number, end in zip((3, 4), pair, strict=True):
                os.dup2(end, number)

        self._process = subprocess.Popen(
            [program, *_OPTIONS, f"--user-data-dir={folder}", "about:blank"],
            preexec_fn=attach,
            close_fds=False,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(orders)
        os.close(replies)
        self._number, self._session, self._left = 0, None, b""
        self.errors: list[str] = []

    def call(self, method: str, **parameters: object) -> dict:
        """Call a method, and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + 20.0
        while True:
            reply = self._receive(end - time.monotonic())
            if reply.get("method") == "Runtime.exceptionThrown":
                self.errors.append(json.dumps(reply["params"]))
            if reply.get("id") == self._number:
                assert "error" not in reply, reply
                return reply["result"]

    def _receive(self, timeout: float) -> dict:
        while b"\0" not in self._left:
            assert select.select([self._in], [], [], max(timeout, 0.0))[0], "no answer"
            received = os.read(self._in, 1 << 16)
            assert received, "the browser has gone"
            self._left += received
        message, _, self._left = self._left.partition(b"\0")
        return json.loads(message)

    def open(self, url: str, width: int = 900, height: int = 700) -> str:
        """Open a page in a window of its own, which is spoken to from now on; return its name."""
        self._session = None
        size = {"newWindow": True, "width": width, "height": height}
        target = self.call("Target.createTarget", url=url, **size)["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        self.call("Runtime.enable")
        return self._session

    def speak_to(self, window: str) -> None:
        """Speak to a window that is open."""
        self._session = window

    def evaluate(self, expression: str) -> object:
        """Return what an expression of the page is, or is promised to be."""
        result = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        return result["result"].get("value")

    def mouse(self, kind: str, place: tuple[float, float]) -> None:
        """Press (``mousePressed``), move or release the left button at a place."""
        x, y = place
        self.call(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1
        )

    def middle(self, selector: str) -> tuple[float, float]:
        """Return where the middle of an element is."""
        box = f"document.querySelector({json.dumps(selector)}).getBoundingClientRect()"
        return tuple(
            self.evaluate(f"{box}.{low} + {box}.{size} / 2")
            for low, size in (("x", "width"), ("y", "height"))
        )

    def close(self) -> None:
        """End it."""
        os.close(self._out)  # which it takes for an order to leave
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._in)
