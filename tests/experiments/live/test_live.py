"""Live sessions from the command line: by HTTP and by a browser, and how they end."""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from contextlib import closing, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

import h5py
import pytest

from experiments.cli import main
from reporting.provenance import PROJECT_ROOT
from tests.experiments.live.browser import NAMES, Browser, find_browser

PATIENCE = 240.0  # s, on a machine that does much else
SMALL = (320, 240)  # pixels, which take long without a graphics card


def until(condition):
    """Wait until a condition is met."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.1)


class Session:
    """``python -m experiments live`` in a process of its own."""

    def __init__(self, folder, *arguments):
        self.out = folder / "out"
        self.process = subprocess.Popen(
            [
                *(sys.executable, "-m", "experiments", "live", *arguments),
                *("--out", str(self.out), "--no-figures", "--no-recording"),
            ],
            cwd=PROJECT_ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.lines = []
        for line in self.process.stdout:
            self.lines.append(line)
            if "open http" in line:
                self.url = line.split()[-1]
                return
        raise AssertionError("".join(self.lines) + self.process.stderr.read())

    def status(self):
        with urllib.request.urlopen(self.url + "status", timeout=5) as answer:
            return json.loads(answer.read())

    def say(self, body):
        """Post to the session as its page does, and return the status of the answer."""
        headers = {"Origin": f"http://{urlsplit(self.url).netloc}"}
        request = urllib.request.Request(self.url + "hear", body, headers, method="POST")
        try:
            with urllib.request.urlopen(request, timeout=5) as answer:
                return answer.status
        except urllib.error.HTTPError as error:
            return error.code

    def set(self, name, value):
        assert self.say(json.dumps({"client": "test", "set": {name: value}}).encode()) == 204

    @contextmanager
    def hand(self, **pull):
        """Pull along axes with forces in N, for as long as the context lasts."""
        hand = {f"pull {axis} [N]": force for axis, force in pull.items()}
        message, over = json.dumps({"client": "test", "hand": hand}).encode(), threading.Event()

        def beat():
            while not over.wait(0.05):
                self.say(message)

        thread = threading.Thread(target=beat)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def until(self, condition):
        """Wait until a condition on the status is met, and return the status."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            status = self.status()
            if condition(status):
                return status
            time.sleep(0.05)
        raise AssertionError(status)

    def end(self):
        """Return the exit status and what was said on stderr."""
        _, errors = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, errors

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()


@pytest.fixture
def start(tmp_path):
    sessions = []

    def start(*arguments):
        sessions.append(Session(tmp_path, *arguments))
        return sessions[-1]

    yield start
    for session in sessions:
        session.close()


@pytest.fixture
def foreign_page():
    """The address of a page that is not the session's."""

    class Page(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *arguments):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.serve_forever, args=[0.05], daemon=True).start()
        yield f"http://localhost:{server.server_address[1]}/"
        server.shutdown()


@pytest.mark.slow
def test_a_person_pushes_the_tool_along_and_ctrl_c_keeps_what_was_done(start):
    session = start("vf_hard_spline")
    session.until(lambda status: status["phase"] == "running" and status["time"] > 0.5)
    with session.hand(y=20.0, z=-20.0):
        moved = session.until(lambda status: abs(status["progress"]["eta"] - 0.05) > 0.05)
    assert abs(moved["deviation"]["xi_1"]) < 0.4e-3  # Sec. 5.2.2
    assert moved["factor"] <= 1.2
    # nobody is heard any more: the hand lets go, which takes its muscles some tenths of a second
    since = moved["time"]
    session.until(lambda status: max(map(abs, status["force"])) < 0.1)
    assert session.status()["time"] < since + 15.0
    assert session.say(b'{"client": "test", "hand": {"pull y [N]": ' + b"9" * 400 + b"}}") == 400
    session.process.send_signal(signal.SIGINT)
    status, errors = session.end()
    assert status == 130
    assert errors.startswith("interrupted at t = ")
    assert errors.count("\n") == 1
    with h5py.File(session.out / "take_1" / "log.h5") as log:
        assert "interrupted" in log.attrs
        assert abs(log["eta"][-1, 0] - 0.05) > 0.05
    names = {file.name for file in (session.out / "take_1").iterdir()}
    assert {"scenario.yaml", "operator.csv", "log.h5", "report.html"} <= names


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason=f"none of {', '.join(NAMES)} is installed")
def test_a_person_guides_the_tool_in_a_browser(start, tmp_path):
    session = start("vf_soft_circle")
    with closing(Browser(find_browser(), tmp_path / "profile")) as browser:
        browser.open(session.url)
        session.until(lambda status: status["time"] > 0.5 and status["ready"])
        until(
            lambda: (
                browser.evaluate("leads && document.querySelectorAll('#tune input').length") == 7
            )
        )
        assert browser.evaluate("document.getElementById('phase').textContent") == "running"
        # the handle, drawn to the left, pulls along y, which is along the circle here
        x, y = browser.middle("#pad")
        browser.mouse("mousePressed", (x, y))
        browser.mouse("mouseMoved", (x - 50.0, y))
        pulled = session.until(lambda status: status["force"][1] > 15.0)
        assert abs(pulled["force"][0]) < 2.0
        moved = session.until(lambda status: status["progress"]["eta"] > 0.05)
        browser.mouse("mouseReleased", (x - 50.0, y))
        assert max(map(abs, moved["deviation"].values())) < 45.0 / 5000.0
        session.until(lambda status: abs(status["force"][1]) < 0.1)
        # a key, as long as it is held
        key = {"code": "KeyF", "key": "f"}
        browser.call("Input.dispatchKeyEvent", type="keyDown", **key)
        pushed = session.until(lambda status: status["force"][2] < -15.0)
        browser.call("Input.dispatchKeyEvent", type="keyUp", **key)
        assert pushed["force"][1] == pytest.approx(0.0, abs=0.1)
        shown = browser.evaluate("document.getElementById('coordinates').textContent")
        assert "xi_2" in shown
        scene = browser.evaluate("document.getElementById('scene').src")
        assert scene == session.status()["scene"] + "/"
        # after a click into the scene keys count as before
        browser.mouse("mousePressed", (700.0, 300.0))
        browser.mouse("mouseReleased", (700.0, 300.0))
        until(lambda: browser.evaluate("document.activeElement.tagName") == "BODY")
        assert browser.errors == []
        # what is said moves no handle under a hand
        browser.evaluate("document.getElementById('message').textContent = 'slower '.repeat(90)")
        assert browser.middle("#pad") == (x, y)
        # a page that cannot be seen lets go
        browser.mouse("mousePressed", (x, y))
        browser.mouse("mouseMoved", (x + 50.0, y))
        session.until(lambda status: status["force"][1] < -15.0)
        browser.evaluate(
            "Object.defineProperty(document, 'hidden', {value: true});"
            "document.dispatchEvent(new Event('visibilitychange'))"
        )
        session.until(lambda status: status["lead"] is None)
        session.until(lambda status: abs(status["force"][1]) < 0.1)
    # it is closed, and the robot does not mind
    time_then = session.status()["time"]
    session.until(lambda status: status["time"] > time_then + 0.2)
    session.set("end (Q)", 1.0)
    assert session.end() == (0, "")
    assert (session.out / "take_1" / "log.h5").exists()


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason=f"none of {', '.join(NAMES)} is installed")
def test_strangers_pull_nothing_and_of_two_pages_one_leads(start, tmp_path, foreign_page):
    session = start("vf_soft_circle")
    with closing(Browser(find_browser(), tmp_path / "profile")) as browser:
        first = browser.open(session.url, *SMALL)
        until(lambda: browser.evaluate("leads"))
        second = browser.open(session.url, *SMALL)
        until(lambda: browser.evaluate("!at('lead').hidden"))
        assert browser.evaluate("at('commands').inert && !leads")
        browser.evaluate("at('take').click()")
        until(lambda: browser.evaluate("leads && at('lead').hidden"))
        browser.speak_to(first)
        until(lambda: browser.evaluate("!leads && !at('lead').hidden"))
        browser.speak_to(second)
        browser.call("Page.close")
        browser.speak_to(first)
        until(lambda: browser.evaluate("leads"))

        # a page of another origin, which has even learnt the token and where the scene is
        browser.open(foreign_page)
        url, scene = session.url, session.status()["scene"]
        message = json.dumps({"client": "evil", "hand": {"pull x [N]": 30.0}, "lead": "take"})
        post = f"fetch({url + 'hear'!r}, {{method: 'POST', mode: 'no-cors', body: {message!r}}})"
        assert browser.evaluate(f"{post}.then(() => 'read', () => 'refused')") == "refused"
        read = f"fetch({url + 'status'!r}).then(() => 'read', () => 'refused')"
        assert browser.evaluate(read) == "refused"
        for payload in ("'nonsense'", "new Uint8Array(0)"):
            browser.evaluate(
                f"new Promise(done => {{ const s = new WebSocket({'ws' + scene[4:]!r});"
                f"s.onopen = () => {{ s.send({payload}); setTimeout(done, 300); }}; }})"
            )
        # only the scene is gone, and comes back elsewhere
        renewed = session.until(lambda status: status["scene"] != scene)
        assert renewed["phase"] == "running"
        assert renewed["lead"] != "evil"
        assert max(map(abs, renewed["force"])) < 0.1
        browser.speak_to(first)
        until(lambda: browser.evaluate("scene.src") == renewed["scene"] + "/")
    session.process.send_signal(signal.SIGTERM)
    assert session.end()[0] == 130
    assert (session.out / "take_1" / "log.h5").exists()


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["pfc_elastic_3r"], ["pfc_elastic_3r.yaml", "compliance = not given", "vf_soft_circle"]),
        (["no_such_scenario"], ["no_such_scenario"]),
        (["vf_soft_circle", "--port", "70000"], ["--port 70000", "allowed: "]),
        (["vf_soft_circle", "--duration", "-1"], ["--duration -1", "positive"]),
        (["vf_soft_circle", "--set", "compliance.tangential=3"], ["compliance.tangential"]),
        pytest.param(
            ["vf_soft_circle", "--duration", "1e6"],
            ["duration = 1e+06 s", "allowed"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_wrong_input_gets_one_line(tmp_path, capfd, arguments, parts):
    assert main(["live", *arguments, "--out", str(tmp_path / "out")]) == 2
    errors = capfd.readouterr().err
    assert errors.startswith("error: ")
    assert errors.count("\n") == 1
    for part in parts:
        assert part in errors
    assert not (tmp_path / "out").exists()


def test_a_port_that_is_taken_is_said_before_anything_is_built(tmp_path, capfd):
    with closing(socket.create_server(("127.0.0.1", 0))) as other:
        port = other.getsockname()[1]
        arguments = ["vf_soft_circle", "--port", str(port), "--out", str(tmp_path / "out")]
        assert main(["live", *arguments]) == 2
    assert f"--port {port}: Address already in use" in capfd.readouterr().err


def test_a_file_is_no_folder_for_takes(tmp_path, capfd):
    (tmp_path / "out").write_text("mine")
    assert main(["live", "vf_soft_circle", "--out", str(tmp_path / "out")]) == 2
    assert "is no folder" in capfd.readouterr().err


def test_what_nobody_recorded_cannot_be_run(tmp_path, capfd):
    change = ["--set", "operator={}", "--out", str(tmp_path / "out")]
    assert main(["run", "vf_soft_circle", *change]) == 2
    assert "operator.inputs = ''; allowed: a file" in capfd.readouterr().err
