"""A scene that is ended from outside."""

import base64
import os
import socket
import time
from contextlib import closing
from urllib.parse import urlsplit

import pytest

from experiments.live.scene import Scene, hidden_meshcat


class View:
    """Draws nothing but a property."""

    def __init__(self, first, meshcat):
        self.drawn, self._meshcat = [first], meshcat

    def draw(self, frame, *, interrupted):
        self.drawn.append(frame)
        self._meshcat.SetProperty("thing", "visible", True)


def send(url, payload):
    """Send a binary message of less than 126 bytes to a WebSocket, as a page of any origin can."""
    place = urlsplit(url)
    with closing(socket.create_connection((place.hostname, place.port), timeout=5)) as stranger:
        key = base64.b64encode(os.urandom(16)).decode()
        stranger.sendall(
            f"GET / HTTP/1.1\r\nHost: {place.netloc}\r\nOrigin: http://elsewhere.example\r\n"
            f"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        assert b"101" in stranger.recv(4096)
        stranger.sendall(bytes([0x82, 0x80 | len(payload), 0, 0, 0, 0]) + payload)
        time.sleep(0.1)


def draw_until(scene, condition):
    """Draw frames, until a condition holds."""
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end
        scene.draw("frame", 1.0)
        time.sleep(0.01)


@pytest.mark.parametrize("payload", [b"", b"\xdd\xff\xff\xff\xff\0\0"], ids=["empty", "huge"])
def test_who_ends_it_ends_nothing_but_the_scene(payload):
    views, said = [], []

    def view(first, meshcat):
        views.append(View(first, meshcat))
        return views[-1]

    scene = Scene(view, "first", said.append)
    first = scene.url
    scene.draw("frame", 1.0)
    send(first, payload)
    draw_until(scene, lambda: scene.url != first)
    assert len(said) == 1
    assert views[1].drawn[0] == "frame"
    scene.draw("next", 1.0)
    assert views[1].drawn[-1] == "next"


def test_after_many_ends_it_draws_no_more_and_says_so():
    class Broken(View):
        def draw(self, frame, *, interrupted):
            raise RuntimeError

    said = []
    scene = Scene(Broken, "first", said.append)
    for _ in range(20):
        scene.draw("frame", 1.0)
    assert len(said) == 11
    assert "no more" in said[-1]


def test_two_scenes_are_at_addresses_that_nobody_guesses():
    hosts = {urlsplit(hidden_meshcat().web_url()).hostname for _ in range(3)}
    assert all(host.startswith("127.") for host in hosts)
    if hosts != {"127.0.0.1"}:  # a system with one address for itself
        assert len(hosts) == 3
