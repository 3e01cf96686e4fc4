"""Legend of a recording."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Rgba

from diagrams.drawing.legend import css_color, recording_legend, with_legend
from diagrams.drawing.recorded import RecordedDistance, RecordedMotion, RecordedPushes
from diagrams.tasks.drawing import PathDrawing, SpaceDrawing, SurfaceDrawing
from diagrams.tasks.drawn_plane import StreamDrawing

MOTION = RecordedMotion(np.zeros(1), np.zeros((1, 6)), np.zeros((1, 12)), np.zeros((1, 9)))
BLUE, RED, GREEN = "#2666d9", "#d91a1a", "#1aa633"


class Curve:
    """A curve without surface."""

    position = None


def test_path_trace_and_axes_have_their_colours():
    legend = recording_legend(PathDrawing(Curve, None), MOTION)
    assert list(legend)[:2] == ["path", "trace of the tool point"]
    assert legend["path"] == BLUE
    assert legend["trace of the tool point"] == "#e6401a"
    first, *normals = [text for text in legend if "axis" in text]
    assert legend[first] == RED
    assert "tangent" in first
    assert legend[normals[0]] == GREEN
    assert "closest point" in first


@pytest.mark.parametrize(
    ("drawing", "texts"),
    [
        (SurfaceDrawing(None, None), ["surface", "first tangent", "normal"]),
        (SpaceDrawing([None], None), ["boundary of a region", "world's x"]),
        (SpaceDrawing([], None, [None]), ["attracting path", "world's z"]),
        (StreamDrawing([], None), ["known beforehand", "tangent"]),
    ],
)
def test_each_manifold_has_its_own_entries(drawing, texts):
    legend = recording_legend(drawing, MOTION)
    for text in texts:
        assert any(text in entry for entry in legend), text


def test_only_what_is_drawn_is_explained():
    plain = recording_legend(SpaceDrawing([], None), MOTION)
    assert not any("region" in text or "arrow" in text or "obstacle" in text for text in plain)
    pushes = RecordedPushes(np.zeros((1, 3)), np.zeros((1, 3)))
    full = recording_legend(
        SurfaceDrawing(None, None),
        replace(
            MOTION,
            pushes=pushes,
            tool_force=np.zeros((1, 3)),
            elbow=np.zeros((1, 3)),
            distance=RecordedDistance(np.zeros(1), 1.0),
        ),
    )
    assert full["trace of the tool point, above the surface"] == "#ff2600"
    assert "trace of the tool point" not in full
    assert full["arrow: force on the tool"] == full["arrow: force of a hand"] == "#f2a60d"
    assert "trace of a point of the arm" in full


def test_colours_are_those_of_a_page():
    assert css_color(Rgba(0.0, 0.5, 1.0, 0.1)) == "#0080ff"


def test_a_recording_has_its_legend_at_its_end():
    page = with_legend("<body>'</body>' <p></p>\n</body>\n</html>", {"path <1>": BLUE})
    before, _, after = page.partition('<ul id="legend">')
    assert before.startswith("<body>'</body>' <p></p>")
    assert (
        after == f'<li><i style="background: {BLUE}"></i>path &lt;1&gt;</li></ul>\n</body>\n</html>'
    )
