"""Captions and views of a recording, as its page holds them."""

import json
import re
import time
from contextlib import closing

import numpy as np
import pytest
from pydrake.geometry import Meshcat, MeshcatParams, Rgba, Sphere
from pydrake.math import RigidTransform

from diagrams.drawing.tour import Stage, explained
from tests.experiments.live.browser import NAMES, Browser, find_browser

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


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason=f"none of {', '.join(NAMES)} is installed")
def test_caption_and_camera_follow_the_recording_until_somebody_turns_it(tmp_path):
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    meshcat.SetObject("ball", Sphere(0.1), Rgba(1, 0, 0, 1))
    meshcat.SetCameraPose([3.0, 0.0, 1.0], [0.0, 0.0, 0.0])
    meshcat.StartRecording(frames_per_second=10.0, set_visualizations_while_recording=False)
    for when in (0.0, 10.0):
        meshcat.SetTransform("ball", RigidTransform([0.0, 0.0, 0.1 * when]), when)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    camera, target = np.array([0.5, -0.4, 0.9]), np.array([0.3, 0.2, 0.7])
    stages = [Stage(0.0, "far", "From afar."), Stage(4.0, "near", "Close.", camera, target)]
    file = tmp_path / "recording.html"
    file.write_text(explained(meshcat.StaticHtml(), stages), encoding="utf-8")
    with closing(Browser(find_browser(), tmp_path / "profile")) as browser:
        browser.open(file.as_uri(), 320, 240)

        def wait_for(expression, wanted):
            end = time.monotonic() + 60.0
            while browser.evaluate(expression) != wanted:
                assert time.monotonic() < end, browser.evaluate(expression)
                time.sleep(0.1)

        caption = "document.querySelector('#tour span').textContent"
        wait_for("viewer.animator.duration > 0", True)
        browser.evaluate(
            "viewer.animator.pause(); viewer.animator.seek(9); viewer.animator.time = 9"
        )
        wait_for(caption, "Close.")
        # as the scene's camera is set by Drake, world axes turned
        x, y, z = camera
        place = "viewer.camera.position.toArray().map(v => Math.round(1e3 * v))"
        wait_for(place, [round(1e3 * v) for v in (x, z, -y)])
        aim = "viewer.controls.target.toArray().map(v => Math.round(1e3 * v))"
        wait_for(aim, [round(1e3 * v) for v in (target[0], target[2], -target[1])])
        browser.evaluate("viewer.animator.seek(1); viewer.animator.time = 1")
        wait_for(caption, "From afar.")
        wait_for(place, [3000, 1000, 0])
        # who takes hold of the scene keeps the view, until a stage is chosen
        browser.mouse("mousePressed", (160.0, 60.0))
        browser.mouse("mouseReleased", (160.0, 60.0))
        browser.evaluate("viewer.animator.seek(9); viewer.animator.time = 9")
        wait_for(caption, "Close.")
        assert browser.evaluate(place) == [3000, 1000, 0]
        browser.evaluate(
            "document.querySelectorAll('#tour button')[0].click(); viewer.animator.pause()"
        )
        wait_for(caption, "From afar.")
        assert browser.errors == []
