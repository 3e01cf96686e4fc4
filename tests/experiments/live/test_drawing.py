"""A person draws in a browser, and the arm follows."""

from contextlib import closing

import numpy as np
import pytest

from tests.experiments.live.browser import NAMES, Browser, find_browser
from tests.experiments.live.test_live import Session, until


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason=f"none of {', '.join(NAMES)} is installed")
def test_the_arm_follows_while_one_draws_in_a_browser(tmp_path):
    session = Session(tmp_path, "pfc_draw_6r")
    with closing(session), closing(Browser(find_browser(), tmp_path / "profile")) as browser:
        browser.open(session.url)
        session.until(lambda status: status["time"] > 0.3)
        until(lambda: browser.evaluate("leads && !at('draws').hidden"))
        box = browser.evaluate(
            "(b => [b.left, b.top, b.width, b.height])(at('plane').getBoundingClientRect())"
        )
        left, top, width, height = box
        assert browser.evaluate("at('pulls').hidden")
        # an arc to the right and upwards from the middle, in pixels of the page
        angles = np.linspace(0.0, 1.5, 30)
        places = [
            (left + width * (0.5 + 0.3 * np.sin(a)), top + height * (0.5 - 0.4 * (1.0 - np.cos(a))))
            for a in angles
        ]
        browser.mouse("mousePressed", places[0])
        for k, place in enumerate(places):
            browser.mouse("mouseMoved", place)
            if k == 15:
                # it is on its way before the line is done
                session.until(lambda status: abs(status["plane"]["tool"][0]) > 0.01)
        browser.mouse("mouseReleased", places[-1])
        wanted = np.array([0.6 * 0.3 * np.sin(1.5), 0.4 * 0.4 * (1.0 - np.cos(1.5))])

        def has_arrived(status):
            return np.linalg.norm(status["plane"]["tool"] - wanted) < 5e-3

        arrived = session.until(has_arrived)
        assert arrived["phase"] == "running"
        assert max(map(abs, arrived["deviation"].values())) < 1e-3
        told = browser.evaluate("document.getElementById('stream').textContent")
        assert "waypoints accepted" in told
        assert browser.errors == []
        browser.evaluate("press('end (Q)')")
        assert session.end() == (0, "")
    assert (session.out / "take_1" / "drawing.csv").read_text().count("\n") > 20
