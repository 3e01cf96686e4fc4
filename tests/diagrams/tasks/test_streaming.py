"""Streamed waypoints of a scenario, and invalid parameters."""

import numpy as np
import pytest

from diagrams.scenario.schema import driven
from diagrams.scenario.streamed import DrawnPlane
from diagrams.scenario_task import make_task
from diagrams.tasks.drawn_plane import border, plane_axes
from diagrams.tasks.streaming import ScenarioStream
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.controller.tasks.streamed_path import StreamedPath
from pfsc_drake.errors import InputError
from tests.scenarios import shipped_scenario


def make(name="pfc_stream_6r", **changes):
    """Return the task of a shipped scenario with other keys of its shape."""
    scenario = shipped_scenario(name)
    for key, value in changes.items():
        setattr(scenario.path.shape, key, value)
    task = make_task(scenario, SCENARIO_DIRECTORY)
    assert isinstance(task, ScenarioStream)
    return task


def test_way_points_come_one_behind_the_other_late_and_noisy():
    task, plain = make(), make(noise=0.0, jitter=0.0)
    shape = shipped_scenario("pfc_stream_6r").path.shape
    assert len(task.arrivals.ticks) == 25
    assert np.all(np.diff(task.arrivals.ticks) >= 0)
    sent = shape.begin + np.arange(25) / shape.rate
    late = 1e-3 * task.arrivals.ticks - sent
    assert late.min() >= shape.delay
    assert late.max() <= shape.delay + shape.jitter + 1e-3
    np.testing.assert_allclose(1e-3 * plain.arrivals.ticks, sent + shape.delay, atol=1e-3)
    off = (task.arrivals.rows - plain.arrivals.rows)[:, :3]
    assert off.std() == pytest.approx(shape.noise, rel=0.3)


def test_a_new_path_takes_the_place_of_what_has_not_come():
    task = make("pfc_new_path_6r", jitter=0.0)
    new = task.arrivals.rows[:, -1]
    assert new.sum() == 1.0
    first = int(new.argmax())
    assert first < 20
    assert 1e-3 * task.arrivals.ticks[first] == pytest.approx(1.95 + 0.1, abs=1e-3)


def test_a_path_of_positions_alone():
    scenario = shipped_scenario("pfc_stream_6r")
    scenario.path.orientation.task = "none"
    task = make_task(scenario, SCENARIO_DIRECTORY)
    assert task.path.start.shape == (3,)
    assert task.arrivals.rows.shape[1] == 4
    assert not task.projected_manifold.is_oriented


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"file": ""}, r"path.shape.file = none given; allowed: a file, or a plane"),
        ({"plane": DrawnPlane()}, r"path.shape.file = paths/comau_teach_in.csv"),
        ({"inputs": "a.csv"}, r"path.shape.inputs = a.csv"),
        ({"file": "paths/nowhere.csv"}, r"nowhere.csv"),
    ],
)
def test_what_does_not_go_together_is_refused(changes, said):
    with pytest.raises((InputError, OSError), match=said):
        make(**changes)


def test_trajectory_tracking_of_a_stream_is_refused():
    scenario = shipped_scenario("pfc_stream_6r")
    scenario.controller.manifold = "trajectory"
    with pytest.raises(InputError, match=r"controller.manifold = trajectory"):
        make_task(scenario, SCENARIO_DIRECTORY)


def test_a_robot_that_stands_elsewhere_needs_a_path_that_is_known():
    with pytest.raises(InputError, match=r"path.shape = !Streamed"):
        driven(shipped_scenario("pfc_draw_6r"))


@pytest.mark.parametrize(
    ("key", "value"),
    [("spacing", 0.0), ("velocity", -1.0), ("lower", [0.0, 1.0]), ("patience", np.nan)],
)
def test_parameters_out_of_range_name_their_key(key, value):
    with pytest.raises(InputError, match=key):
        StreamParameters(**{key: value})


@pytest.mark.parametrize("start", [[0.0, 1.0], [np.nan, 0.0, 0.0], [0.9, 0, 0, 0, 0, 0, 0]])
def test_a_start_that_is_no_place_is_refused(start):
    with pytest.raises(InputError, match="start"):
        StreamedPath(start, StreamParameters(), 4)


def test_a_plane_has_two_directions():
    plane = DrawnPlane(right=[0, -2, 0], up=[0, 1, 3], width=0.6, height=0.4)
    np.testing.assert_allclose(plane_axes(plane), [[0, -1, 0], [0, 0, 1]], atol=1e-12)
    corners = border(plane)[::20]
    assert np.ptp(corners, axis=0) == pytest.approx([0.0, 0.6, 0.4])
    with pytest.raises(InputError, match=r"plane.up"):
        plane_axes(DrawnPlane(right=[0, 1, 0], up=[0, 2, 0]))
