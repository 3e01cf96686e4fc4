"""Who leads and for how long; and the page over HTTP: what it may say, and who may not."""

import http.client
import json
import socket
import time
from contextlib import closing, suppress
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest

from experiments.live.page_server import LEAVE, TAKE, Pages, PageServer
from pfsc_drake.errors import InputError

PULL, KEY = "pull x [N]", "across k"
GOOD = json.dumps({"client": "a", "hand": {PULL: 3.5}}).encode()


@pytest.fixture
def clock():
    return SimpleNamespace(now=50.0)


@pytest.fixture
def pages(clock):
    pages = Pages(lambda: clock.now)
    pages.expect([PULL], [KEY])
    return pages


@pytest.fixture
def server(pages):
    server = PageServer(0, pages, lambda: {"time": 1.5})
    yield server
    with suppress(RuntimeError):  # it has stopped
        server.close()


def ask(server, method, document, body=None, **headers):
    """Return status, headers and text of an answer; a document that begins with / is absolute."""
    place = urlsplit(server.url)
    path = document if document.startswith("/") else place.path + document
    with closing(http.client.HTTPConnection(place.hostname, place.port, timeout=5)) as connection:
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read().decode()


def origin(server):
    return f"http://{urlsplit(server.url).netloc}"


def post(server, body, **headers):
    status, _, text = ask(server, "POST", "hear", body, **{"Origin": origin(server), **headers})
    return status, text


def test_it_serves_the_page_and_what_it_shows_on_this_machine_alone(server):
    assert server.url.startswith("http://127.0.0.1:")
    status, headers, page = ask(server, "GET", "")
    assert status == 200
    assert "https://" not in page  # nothing is fetched from elsewhere
    assert headers["X-Frame-Options"] == "DENY"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert json.loads(ask(server, "GET", "status")[2]) == {"time": 1.5, "lead": None}
    assert ask(server, "GET", "../etc/passwd")[0] == 404
    assert ask(server, "GET", "hear")[0] == 404


def test_every_session_has_a_token_of_its_own(server, pages):
    with closing(PageServer(0, pages, dict)) as other:
        assert len(urlsplit(other.url).path) > 20
        assert urlsplit(other.url).path != urlsplit(server.url).path
        assert ask(server, "GET", urlsplit(other.url).path + "status")[0] == 403


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        *[(path, 403) for path in ("/", "/status", "/hear", "//", "/x/status", "/%FF/")],
        ("/\xe9/", 400),  # not HTTP
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_without_the_token_there_is_nothing(server, pages, method, path, expected):
    with closing(
        socket.create_connection((urlsplit(server.url).hostname, urlsplit(server.url).port), 5)
    ) as connection:
        host = urlsplit(server.url).netloc
        request = f"{method} {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n"
        length = f"Content-Length: {len(GOOD)}\r\n\r\n"
        connection.sendall((request + length).encode("latin-1") + GOOD)
        assert connection.recv(100).split()[1] == str(expected).encode()
    assert pages.leader is None


@pytest.mark.parametrize("host", ["elsewhere.example", "127.0.0.1.elsewhere.example", "[", ""])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_other_names_for_this_machine_are_refused(server, pages, method, host):
    document = "status" if method == "GET" else "hear"
    headers = {"Host": host, "Origin": f"http://{host}"}
    status, _, text = ask(server, method, document, GOOD, **headers)
    assert status == 403
    assert "1.5" not in text
    assert pages.leader is None


@pytest.mark.parametrize("other", ["http://elsewhere.example", "null", "", "http://127.0.0.1:1"])
def test_pages_of_other_origins_may_not_ask(server, pages, other):
    assert post(server, GOOD, Origin=other)[0] == 403
    assert ask(server, "GET", "status", Origin=other)[0] == 403
    assert pages.leader is None


def test_a_post_must_say_where_it_comes_from(server, pages):
    assert ask(server, "POST", "hear", GOOD)[0] == 403
    assert pages.leader is None


def test_who_leads_is_told_so_and_who_does_not_is_told_that(server, pages):
    assert post(server, GOOD)[0] == 204
    assert post(server, b'{"client": "b"}')[0] == 409
    assert pages.collect().hand == {PULL: 3.5}


def test_a_connection_is_good_for_many_messages(server, pages):
    place = urlsplit(server.url)
    with closing(http.client.HTTPConnection(place.hostname, place.port, timeout=5)) as connection:
        for body, expected in [(GOOD, 204), (b"nonsense", 400), (GOOD, 204)]:
            connection.request("POST", place.path + "hear", body, {"Origin": origin(server)})
            used, answer = connection.sock, connection.getresponse()
            answer.read()
            assert answer.status == expected
            assert used is not None
            assert connection.sock is used


def test_a_connection_that_is_to_close_closes(server, pages):
    place = urlsplit(server.url)
    with closing(http.client.HTTPConnection(place.hostname, place.port, timeout=5)) as connection:
        headers = {"Origin": origin(server), "Connection": "close"}
        connection.request("POST", place.path + "hear", GOOD, headers)
        used, answer = connection.sock, connection.getresponse()
        assert answer.status == 204
        assert answer.getheader("Connection") == "close"
        assert used.recv(1) == b""


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"", "not JSON"),
        (b'{"client": "a", "hand": {"pull x [N]": ' + b"9" * 400 + b"}}", "a finite number"),
        (b'{"client": "a", "hand": {"pull x [N]": NaN}}', "a finite number"),
        (b"[" * 8000, "not JSON"),
    ],
)
def test_nonsense_gets_an_answer(server, pages, body, said):
    status, text = post(server, body)
    assert status == 400
    assert said in text
    assert post(server, GOOD)[0] == 204


def test_a_message_that_is_too_long_gets_an_answer(server):
    assert post(server, b" " * 500_000)[0] == 413
    assert post(server, GOOD)[0] == 204


@pytest.mark.parametrize(
    ("length", "expected"),
    [("8193", 413), *((length, 400) for length in ("9" * 400, "9" * 5000, "-1", "x", ""))],
)
def test_sizes_that_are_none_get_an_answer(server, length, expected):
    assert post(server, GOOD, **{"Content-Length": length})[0] == expected
    assert post(server, GOOD)[0] == 204


def test_a_message_of_unknown_size_gets_an_answer(server):
    assert post(server, iter([GOOD]))[0] == 411
    assert post(server, GOOD)[0] == 204


def test_it_stops_while_pages_are_open_and_says_nothing(server, capfd):
    place = urlsplit(server.url)
    address, path = (place.hostname, place.port), place.path
    with (
        closing(socket.create_connection(address, 5)) as idle,
        closing(socket.create_connection(address, 5)) as slow,
    ):
        idle.sendall(f"GET {path}status HTTP/1.1\r\nHost: {place.netloc}\r\n\r\n".encode())
        assert idle.recv(100).split()[1] == b"200"
        head = f"POST {path}hear HTTP/1.1\r\nHost: {place.netloc}\r\nOrigin: {origin(server)}\r\n"
        slow.sendall(f"{head}Content-Length: 100\r\n\r\n".encode())
        slow.sendall(b"[")
        begin = time.monotonic()
        server.close()
        assert time.monotonic() - begin < 3.0
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(address, 5)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("port", [-1, 70000])
def test_a_port_that_is_none_is_refused(port):
    with pytest.raises(InputError, match=f"--port {port}: "):
        PageServer(port, Pages(), dict)


def test_a_port_that_is_taken_is_refused(server):
    port = urlsplit(server.url).port
    with pytest.raises(InputError, match=f"--port {port}: Address already in use"):
        PageServer(port, Pages(), dict)


def say(pages, client, **entries):
    return pages.hear(json.dumps({"client": client, **entries}).encode())


def test_nobody_leads_at_first_and_then_who_is_heard_first(pages):
    assert pages.leader is None
    assert pages.collect().let_go
    assert say(pages, "a", hand={PULL: 3.5}, set={KEY: 2})
    assert not say(pages, "b", hand={PULL: -20}, set={KEY: 7})
    assert pages.leader == "a"
    heard = pages.collect()
    assert heard.hand == {PULL: 3.5}
    assert heard.settings == [(KEY, 2.0)]
    assert pages.collect().settings == []


def test_a_hand_is_what_was_heard_last_and_nothing_after_a_silence(pages, clock):
    say(pages, "a", hand={PULL: 3.5})
    pages.collect()
    clock.now += 0.29
    assert pages.collect().hand == {PULL: 3.5}
    assert not pages.collect().let_go
    clock.now += 0.02
    assert pages.collect().hand == {}
    assert pages.collect().let_go
    say(pages, "a", hand={PULL: 3.5})
    assert pages.collect().hand == {PULL: 3.5}
    say(pages, "a")
    heard = pages.collect()
    assert heard.hand == {}
    assert not heard.let_go


def test_another_leads_when_the_first_is_silent_leaves_or_is_taken_the_lead_from(pages, clock):
    say(pages, "a", hand={PULL: 3.5})
    clock.now += 2.9
    assert not say(pages, "b")
    clock.now += 0.2
    assert pages.leader is None
    assert say(pages, "b")
    assert not say(pages, "a")
    assert say(pages, "a", lead=TAKE, hand={PULL: 1.0})
    assert pages.leader == "a"
    pages.collect()
    assert not say(pages, "a", lead=LEAVE)
    assert pages.leader is None
    assert pages.collect().let_go
    assert say(pages, "b")
    assert not say(pages, "c", lead=LEAVE)
    assert pages.leader == "b"


def test_what_one_hand_asked_for_is_not_done_by_the_next(pages):
    say(pages, "a", hand={PULL: 3.5}, set={KEY: 2})
    say(pages, "b", lead=TAKE, hand={PULL: -1.0})
    heard = pages.collect()
    assert heard.let_go
    assert heard.hand == {PULL: -1.0}
    assert heard.settings == []
    assert not pages.collect().let_go


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"", "not JSON"),
        (b"[[", "not JSON"),
        (b"[" * 5000, "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b'{"client": "a", "set": {"across k": ' + b"9" * 5000 + b"}}", "not JSON"),
        (b'["pull x [N]", 3.5]', "not a JSON object"),
        (b"{}", "client"),
        (b'{"client": 3}', "client"),
        (b'{"client": ""}', "client"),
        (b'{"client": "' + b"a" * 65 + b'"}', "client"),
        (b'{"client": "a", "force": 3}', "'force'"),
        (b'{"client": "a", "lead": "please"}', "'please'"),
        (b'{"client": "a", "lead": []}', "lead"),
        (b'{"client": "a", "hand": [1, 2]}', "hand"),
        (b'{"client": "a", "hand": null}', "hand"),
        (b'{"client": "a", "hand": {"pull x [N]": "3"}}', "'pull x [N]'"),
        (b'{"client": "a", "hand": {"pull x [N]": true}}', "'pull x [N]'"),
        (b'{"client": "a", "hand": {"pull x [N]": NaN}}', "'pull x [N]'"),
        (b'{"client": "a", "hand": {"pull x [N]": 1e999}}', "'pull x [N]'"),
        (b'{"client": "a", "hand": {"pull x [N]": ' + b"9" * 400 + b"}}", "'pull x [N]'"),
        (b'{"client": "a", "hand": {"across k": 1}}', "'across k' is not a control"),
        (b'{"client": "a", "set": {"pull x [N]": 1}}', "'pull x [N]' is not a control"),
        (b'{"client": "a", "set": {"' + b"k" * 900 + b'": 1}}', "kkk...kkk"),
    ],
)
def test_nonsense_is_refused_and_changes_nothing(pages, content, named):
    with pytest.raises(InputError) as error:
        pages.hear(content)
    assert named in str(error.value)
    assert len(str(error.value)) < 150
    assert pages.leader is None
