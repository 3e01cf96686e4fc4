"""The page over HTTP: what it is told, what it may ask for, and who may not."""

import json
import urllib.error
import urllib.request
from contextlib import closing

import pytest

from experiments.live.server import PageServer
from pfsc_drake.errors import InputError


@pytest.fixture
def asked():
    return []


@pytest.fixture
def server(asked):
    with closing(PageServer(0, "http://scene", lambda: {"time": 1.5}, asked.append)) as server:
        yield server


def get(url):
    with urllib.request.urlopen(url, timeout=5) as answer:
        return answer.read().decode()


def post(server, body, **headers):
    request = urllib.request.Request(
        server.url + "set", body, {"Origin": server.url[:-1], **headers}, method="POST"
    )
    try:
        with urllib.request.urlopen(request, timeout=5) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def test_it_serves_the_page_and_what_it_shows_on_this_machine_alone(server):
    assert server.url.startswith("http://127.0.0.1:")
    page = get(server.url)
    assert 'src="http://scene"' in page
    assert "https://" not in page  # nothing is fetched from elsewhere
    assert json.loads(get(server.url + "status")) == {"time": 1.5}
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(server.url + "../etc/passwd")


def test_the_page_asks(server, asked):
    assert post(server, b'["pull x [N]", 3.5]') == 204
    assert asked == [("pull x [N]", 3.5)]


@pytest.mark.parametrize(
    "body", [b"", b"[1, 2, 3]", b'["a", "b"]', b'["a", NaN]', b"[[", b"[" * 100_000, b'["a", null]']
)
def test_nonsense_is_refused(server, asked, body):
    assert post(server, body) == 400
    assert asked == []


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://example.org"},
        {"Origin": "null"},
        {"Origin": "http://example.org", "Host": "example.org"},
    ],
)
def test_other_pages_may_not_ask(server, asked, headers):
    assert post(server, b'["pull x [N]", 3.5]', **headers) == 403
    assert asked == []


@pytest.mark.parametrize("port", [-1, 70000])
def test_a_port_that_is_none_is_refused(port):
    with pytest.raises(InputError, match=f"--port {port}: "):
        PageServer(port, "", dict, print)


def test_a_port_that_is_taken_is_refused(server):
    port = int(server.url.rsplit(":", 1)[1][:-1])
    with pytest.raises(InputError, match=f"--port {port}: Address already in use"):
        PageServer(port, "", dict, print)
