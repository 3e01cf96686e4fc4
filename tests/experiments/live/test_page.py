"""The page of a session in a browser, without any robot: what is seen of its controls."""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise

import pytest

from experiments.live.page_server import Pages, PageServer
from experiments.live.panel import Panel
from experiments.live.status import LiveStatus
from experiments.live.watch import WatchPanel
from tests.experiments.live.browser import NAMES, Browser, find_browser
from tests.experiments.live.test_live import until
from tests.experiments.live.test_panel import TUNED

pytestmark = pytest.mark.skipif(find_browser() is None, reason=f"none of {', '.join(NAMES)} here")

SIZE = (900, 700)
# an element's box, as numbers
NONE = "\u2013"
BOX = "(e => { const b = e.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; })"


@pytest.fixture
def show(tmp_path):
    """Return a function that shows a status on the page, in a window of some size."""
    opened = []

    def shown(status, pages, size=SIZE):
        server = PageServer(0, pages, status.content)
        browser = Browser(find_browser(), tmp_path / "profile")
        opened.extend([browser, server])
        browser.open("about:blank")
        width, height = size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.call("Emulation.setDeviceMetricsOverride", **metrics)
        browser.call("Page.navigate", url=server.url)
        until(lambda: browser.evaluate("document.querySelectorAll('[data-name]').length > 0"))
        assert browser.errors == []
        return browser

    yield shown
    for each in opened:
        each.close()


def guided(count, **options):
    """Return the status of a session with regions at its fullest, and its pages."""
    pages, status = Pages(), LiveStatus("a_scenario_with_a_long_name")
    panel = Panel(pages, 45.0, TUNED, [f"plane_{i + 1}" for i in range(count)], **options)
    status.phase, status.time, status.factor = "running", 1234.5, 0.97
    status.mode, status.limit, status.recording = "moves freely", "axis 3 near its end", 1200.0
    status.progress = {"x": 0.1, "y": 0.2, "z": 0.3}
    status.deviation, status.force = {"nearest region": 0.012}, [1.0, 2.0, 3.0]
    status.controls = panel.content()
    return status, pages


def boxes(browser, selector):
    return browser.evaluate(f"Array.from(document.querySelectorAll({selector!r}), {BOX})")


@pytest.mark.slow
@pytest.mark.parametrize("count", [5, 50])
def test_all_switches_and_handles_are_seen_at_once(show, count):
    browser = show(*guided(count))
    buttons = boxes(browser, "aside button:not(#take), #pad, #lift")
    assert len(buttons) == count + 2 + 4 + 2
    assert max(bottom for *_, bottom in buttons) <= SIZE[1]
    texts = browser.evaluate(
        "Array.from(document.querySelectorAll('#regions button'), e => e.textContent)"
    )
    assert texts[4] == ("5" if count == 50 else "5 plane")
    title = browser.evaluate("document.querySelector('#regions button').title")
    assert title == "region plane_1: on"


@pytest.mark.slow
def test_nothing_lies_upon_another(show):
    """Whatever there is to say, and however little room."""
    browser = show(*guided(50))
    badges = [box for box in boxes(browser, "aside > .badges .badge") if box[2] > box[0]]
    assert len(badges) == 4
    rows = boxes(browser, "aside > .badges, aside > .charts, aside > #pulls, aside > .row, #walls")
    for (_, _, _, bottom), (_, top, _, _) in pairwise(rows):
        assert bottom <= top
    assert max(bottom for *_, bottom in badges) <= rows[0][3]
    sides = boxes(browser, "aside")[0]
    assert all(right <= sides[2] for _, _, right, _ in badges)
    # what comes and goes is on the scene
    for name in ("limit", "recording"):
        assert boxes(browser, f"#{name}")[0][0] >= sides[2]


@pytest.mark.slow
def test_a_leader_is_dragged_by_the_way_of_the_mouse(show):
    """From wherever in the pad it is taken hold of; half of the pad is 0.15 m."""
    status, pages = guided(5, drags=True)
    browser = show(status, pages)
    assert browser.evaluate("at('pulls-title').textContent") == "Drag the leader"
    (left, top, right, bottom), (x, y) = boxes(browser, "#pad")[0], browser.middle("#pad")
    until(lambda: browser.evaluate("leads"))
    begin = (x + 20.0, y + 10.0)
    browser.mouse("mousePressed", begin)
    until(lambda: pages.collect().hand == {"drag x [m]": 0.0, "drag y [m]": 0.0})
    browser.mouse("mouseMoved", (x - 25.0, y - 20.0))
    until(lambda: pages.collect().hand.get("drag x [m]", 0.0) > 0.0)
    hand = pages.collect().hand
    assert hand["drag x [m]"] == pytest.approx(0.15 * 2 * 30.0 / (bottom - top), rel=1e-3)
    assert hand["drag y [m]"] == pytest.approx(0.15 * 2 * 45.0 / (right - left), rel=1e-3)
    browser.mouse("mouseReleased", (x - 25.0, y - 20.0))
    until(lambda: pages.collect().hand == {})
    assert browser.errors == []


@pytest.mark.slow
def test_dragging_selects_no_label(show):
    browser = show(*guided(5))
    browser.mouse("mousePressed", browser.middle("#pulls h2"))
    browser.mouse("mouseMoved", browser.middle("#walls h2"))
    browser.mouse("mouseReleased", browser.middle("#walls h2"))
    assert browser.evaluate("String(getSelection())") == ""


@pytest.mark.slow
@pytest.mark.parametrize("size", [SIZE, (400, 800)])
def test_of_a_robot_that_is_watched_only_what_is_known_is_shown(show, size):
    pages, status = Pages(), LiveStatus("pfc_panda_7r")
    status.override, status.phase = 0.8, "driving"
    status.progress, status.deviation = {"eta": 0.1}, {"xi_1": 1e-3, "xi_2": 0.0}
    status.controls = WatchPanel(pages).content(0.8)
    browser = show(status, pages, size)
    row = "Array.from(document.querySelectorAll('#coordinates tr'), e => e.textContent)"
    assert browser.evaluate(row) == ["position", "eta100.0 mm", "xi_11.0 mm", "xi_20.0 mm"]
    hidden = ("forces", "pulls", "tunes", "hand-keys", "walls", "switches")
    assert browser.evaluate(f"{list(hidden)}.map(id => at(id).offsetHeight)") == [0] * len(hidden)
    (chart,), (charts,) = boxes(browser, "#deviation-chart"), boxes(browser, ".charts")
    assert chart[2] - chart[0] == charts[2] - charts[0]
    assert browser.evaluate("document.documentElement.scrollWidth") <= size[0]


@pytest.fixture
def scene_url():
    """Return the address of an empty page in place of a scene."""

    class Empty(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()

        def log_message(self, *arguments):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Empty)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


@pytest.mark.slow
def test_it_says_loading_until_the_scene_is_there_and_then_what_to_do(show, scene_url):
    status, pages = guided(1)
    browser = show(status, pages)
    text = "document.querySelector('main').innerText.trim().split(/\\n+/)"
    hint = "Drag the ball in the panel to push the tool."
    assert browser.evaluate(text) == ["Loading the scene …", hint]
    status.scene = scene_url
    until(lambda: browser.evaluate(text) == [hint])
    until(lambda: browser.evaluate("leads"))
    browser.mouse("mousePressed", browser.middle("#pad"))
    until(lambda: browser.evaluate(text) == [""])
    assert browser.errors == []


@pytest.mark.slow
def test_small_forces_and_slow_motion_are_not_zero(show):
    status, pages = guided(0)
    status.force, status.tool_point = [0.0, 0.0, 0.036], [0.8, 0.0, 0.9]
    browser = show(status, pages)
    reading = "['force', 'motion'].map(id => at(id).textContent)"
    until(lambda: browser.evaluate(reading) == ["36 mN", "at rest"])
    status.time, status.tool_point = status.time + 1.0, [0.8004, 0.0, 0.9]
    until(lambda: browser.evaluate(reading) == ["36 mN", "0.4 mm/s"])
    status.force, status.measured = [0.0] * 3, {"x": 0.03, "y": 0.0, "z": -0.04}
    # the force of the last second counts, too
    status.time, status.tool_point = status.time + 5.0, [0.8024, 0.0, 0.9]
    until(lambda: browser.evaluate("at('time').textContent") == "1240.5 s")
    status.time, status.tool_point = status.time + 1.0, [0.8028, 0.0, 0.9]
    text = "No force on the tool, but the sensor measures 50 mN: it moves at 0.4 mm/s."
    until(lambda: browser.evaluate("at('hint').textContent").endswith(text))
    assert browser.evaluate("[-1e-17, 0.26].map(x => fixed(x, 1))") == ["0.0", "0.3"]
    amounts = "[0, 2e-5, -0.004, 0.5, 3, -45].map(x => amount(x, 'N'))"
    expected = ["0 N", "0 N", "-4 mN", "0.50 N", "3.00 N", "-45.0 N"]
    assert browser.evaluate(amounts) == expected


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1300, 900), (400, 800)])
def test_coordinates_have_words(show, size):
    status, pages = guided(0)
    status.progress = {"eta": 1.234}
    status.labels = {"eta": "along (eta)", "phi_z": "rotation about z (phi_z)"}
    status.angles, status.measured = {"phi_z": -0.9876}, {"eta": -44.4, "phi_z": -0.0123}
    status.stiffness, status.damping = {"eta": 12000.0, "phi_z": 34.4}, {"eta": 1230.0}
    browser = show(status, pages, size)
    rows = "Array.from(document.querySelectorAll('#coordinates tr'), e => e.innerText.split('\\t'))"
    head, first, *_, last = browser.evaluate(rows)
    assert head[1:] == ["position", "force", "stiffness k", "damping d"]
    assert first == ["along (eta)", "1234.0 mm", "-44.4 N", "12000", "1230"]
    assert last == ["rotation about z (phi_z)", "-987.6 mrad", "-12 mNm", "34.4", NONE]
    assert browser.evaluate("document.documentElement.scrollWidth") <= size[0]
    sides, table = boxes(browser, "aside")[0], boxes(browser, "#coordinates")[0]
    assert table[2] <= sides[2]
    assert browser.evaluate("document.querySelector('aside').scrollWidth") <= sides[2] - sides[0]
