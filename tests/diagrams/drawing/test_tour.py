"""Captions and views of a recording, as its page holds them."""

import json
import re

import numpy as np

from diagrams.drawing.tour import Stage, explained

PAGE = "<html><body><p>the end is </body> in here, too</p></body></html>"


def told(page):
    """Return the stages that a page tells."""
    return json.loads(re.search(r"stages = (\[.*?\]), MOVE", page)[1])


def test_a_page_without_stages_stays_as_it_is():
    assert explained(PAGE, []) == PAGE


def test_stages_are_told_before_the_end_of_the_page():
    camera, target = np.array([1.0, 2.0, 1.0 / 3.0]), np.array([0.0, -1.0, 0.5])
    page = explained(PAGE, [Stage(0.0, "lead", "From afar."), Stage(2.5, "x", "y", camera, target)])
    before, after = PAGE[: -len("</body></html>")], "</body></html>"
    assert page.startswith(before)
    assert page.endswith(after)
    first, second = told(page)
    assert first == {
        "time": 0.0,
        "name": "lead",
        "text": "From afar.",
        "camera": None,
        "target": None,
    }
    assert second["time"] == 2.5
    np.testing.assert_allclose(second["camera"], camera, atol=1e-6)
    np.testing.assert_allclose(second["target"], target, atol=1e-6)


def test_no_text_ends_the_script():
    page = explained(PAGE, [Stage(0.0, "a", "</script><b>&'\" STAGES")])
    assert page.count("</script>") == 1
    assert told(page)[0]["text"] == "</script><b>&'\" STAGES"
