"""A station that is drawn while it runs."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.builder import build_station, draw_station
from diagrams.live_view import LiveFrame, LiveView

SCENARIOS = Path(__file__).parents[3] / "experiments" / "scenarios"


class Scene:
    """Stands in for Meshcat, and remembers the last call by method and path."""

    def __init__(self):
        self.calls = []

    def __getattr__(self, method):
        return lambda *arguments: self.calls.append((method, *arguments))

    def of(self, method, path):
        """Return the arguments of all calls for paths that end so."""
        return [call[1:] for call in self.calls if call[0] == method and call[1].endswith(path)]


@pytest.fixture
def view(load_scenario):
    """A view, its scene, and a function that makes frames."""
    settings = load_scenario("vf_soft_circle")
    station = build_station(settings, SCENARIOS)
    scene = Scene()
    half = station.part.coordinates.num_states // 2
    point = station.task.evaluate(np.array([0.98, 0.0, 0.9]), station.initial_projection)

    def frame(place, force=(0.0, 0.0, 0.0), target=None):
        pose = np.concatenate([place, np.eye(3).ravel()])
        return LiveFrame(station.initial_state[:half], pose, point, np.array(force), target)

    first = frame([0.98, 0.0, 0.9])
    return LiveView(station, draw_station(settings, SCENARIOS, station), first, scene, 45.0), (
        scene,
        frame,
    )


def test_the_way_goes_from_frame_to_frame_but_not_over_a_reset(view):
    view, (scene, frame) = view
    places = [[0.98, 0.01 * i, 0.9] for i in range(1, 4)]
    for place in places:
        view.draw(frame(place))
    view.draw(frame([0.98, 0.0, 0.9]), interrupted=True)
    view.draw(frame([0.98, 0.0, 0.9]))
    view.draw(frame([0.98, 0.05, 0.9]))
    drawn = [call for call in scene.calls if call[0] == "SetLine" and "trail" in call[1]]
    names = [call[1] for call in drawn]
    lines = [call[2].T.tolist() for call in drawn]
    assert lines[:3] == [
        [[0.98, 0.0, 0.9], places[0]],
        [places[0], places[1]],
        [places[1], places[2]],
    ]
    assert lines[-1] == [[0.98, 0.0, 0.9], [0.98, 0.05, 0.9]]
    assert [places[2], [0.98, 0.0, 0.9]] not in lines
    assert len(set(names)) == len(names)


def test_a_force_is_an_arrow_at_the_tool(view):
    view, (scene, frame) = view
    view.draw(frame([0.9, 0.1, 0.8], [0.0, 20.0, 0.0]))
    X = scene.of("SetTransform", "tool_force/1")[-1][1]
    assert X.translation().tolist() == [0.9, 0.1, 0.8]
    assert X.rotation().col(2) == pytest.approx([0.0, 1.0, 0.0])
    view.draw(frame([0.9, 0.1, 0.8]))
    assert scene.of("SetProperty", "tool_force/1")[-1][1:3] == ("visible", False)


def test_where_a_hand_wants_the_tool_is_shown_while_it_holds(view):
    view, (scene, frame) = view
    view.draw(frame([0.98, 0.0, 0.9], target=np.array([0.9, 0.1, 0.8])))
    assert scene.of("SetTransform", "hand_target")[-1][1].translation().tolist() == [0.9, 0.1, 0.8]
    assert scene.of("SetProperty", "hand_target")[-1][1:] == ("visible", True)
    view.draw(frame([0.98, 0.0, 0.9]))
    assert scene.of("SetProperty", "hand_target")[-1][1:] == ("visible", False)
