"""Pictures of recordings, of a run that is cut short."""

import numpy as np
import pytest
from PIL import Image

from docs.pictures import SIZE, View, opened_browser, record_run, write_picture
from tests.experiments.live.browser import NAMES, find_browser

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason=f"none of {', '.join(NAMES)} is installed"
)


@pytest.mark.slow
def test_a_recording_at_two_of_its_times(tmp_path):
    recording = record_run("pfc_elastic_3r", tmp_path / "run", 0.5)
    with opened_browser() as browser:
        view = View(browser, recording)
        assert view.duration == pytest.approx(0.5, abs=0.05)
        wide = np.asarray(view.picture(0.0, SIZE)).astype(int)
        size = write_picture(view, view.duration, tmp_path / "deep" / "picture.webp")
        first, last = (np.asarray(view.picture(t, SIZE)).astype(int) for t in (0.0, 0.5))
    picture = np.asarray(Image.open(tmp_path / "deep" / "picture.webp")).astype(int)
    assert picture.shape == (*SIZE[::-1], 3)
    assert 2_000 < size < 60_000
    assert abs(first - last).max() > 50  # the robot has moved

    def filled(image: np.ndarray) -> float:
        return float((abs(image - image[0, 0]).max(axis=2) > 6).mean())

    assert filled(picture) > 1.5 * filled(wide) > 0.0  # and is seen from close by
