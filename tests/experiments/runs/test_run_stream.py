"""A tool follows waypoints that come while it moves, and goes over to a new path."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from experiments.scenario_file import SCENARIO_DIRECTORY, find_scenario
from pfsc_drake.control.streams.messages import StreamStatus
from pfsc_drake.geometry import read_waypoints

FAST = [
    *("path.shape.rate=40", "path.shape.begin=0.05", "path.shape.delay=0.02"),
    *("path.shape.jitter=0.01", "path.shape.noise=0"),
]
DEGREE, DURATION = 6, 1.5


def spline_of(name):
    """Return the spline that a file's waypoints make, and the sites of the first and the last."""
    w = read_waypoints(SCENARIO_DIRECTORY / "paths" / name).positions
    count, reach, s = len(w), 3, (DEGREE + 1) / 24.0
    c = w.copy()
    c[1:-1] -= s * (w[:-2] - 2.0 * w[1:-1] + w[2:])
    before = 2.0 * c[0] - c[reach:0:-1]
    after = 2.0 * c[-1] - c[-2 : -2 - reach : -1]
    whole = np.vstack([before, c, after])
    knots = np.arange(len(whole) + DEGREE + 1.0) - DEGREE
    site = reach - (DEGREE - 1) / 2.0
    return BSpline(knots, whole, DEGREE), site, site + count - 1.0


@pytest.fixture(name="exact", scope="module")
def fixture_exact(tmp_path_factory, run_scenario):
    folder = tmp_path_factory.mktemp("stream")
    # with no more than the arm itself: without friction, errors of encoders and of the model
    text = find_scenario("pfc_stream_6r").read_text(encoding="utf-8")
    plain = text[: text.index("friction: {file")] + text[text.index("path:\n") :]
    mine = folder / "plain.yaml"
    mine.write_text(plain.replace("paths/", f"{SCENARIO_DIRECTORY}/paths/"), encoding="utf-8")
    changes = [x for change in FAST for x in ("--set", change)]
    arguments = [*changes, "--duration", str(DURATION), "--no-recording"]
    return run_scenario(folder / "out", str(mine), *arguments)


@pytest.mark.slow
def test_the_tool_is_on_the_spline_that_its_way_points_make(exact):
    """Which is made here of all of them at once, by another library."""
    spline, begin, end = spline_of("comau_teach_in.csv")
    points = spline(np.linspace(begin, end, 400_000))
    off, _ = cKDTree(points).query(exact["y_t"])
    # the samples are 2.6 um apart
    assert off.max() < 5e-6
    along = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert 0.2 < exact["eta"][-1, 0] < along
    assert np.linalg.norm(exact["xi"], axis=1).max() < 5e-6


@pytest.mark.slow
def test_it_never_passes_what_it_knows(exact):
    known = exact["eta_p"] + exact["way_left"]
    assert (exact["eta"] - known).max() < 1e-6
    assert exact["way_left"].min() >= -1e-12
    running = exact["stream_status"][:, 0] == StreamStatus.RUNNING
    assert running.sum() > 400
    assert exact["eta_dot"].max() == pytest.approx(0.5, rel=0.01)
    assert exact["bend_speed"].max() == pytest.approx(0.5)


@pytest.mark.slow
def test_a_run_tells_what_became_of_way_points(exact):
    assert exact.metrics["way_points_taken"]["value"] > 20
    assert exact.metrics["past_known_way"]["value"] < 1e-6
    assert exact.metrics["past_known_way"]["target"] == "< 0.5e-3"


@pytest.mark.slow
def test_it_goes_over_to_a_new_path_without_stopping(tmp_path, run_scenario):
    changes = [
        *FAST,
        "path.shape.new_paths=[{file: paths/comau_moved.csv, at: 0.6}]",
    ]
    arguments = [x for change in changes for x in ("--set", change)]
    run = run_scenario(tmp_path / "out", "pfc_new_path_6r", *arguments, "--duration", "2.9")
    assert run.status == 0
    moved = read_waypoints(SCENARIO_DIRECTORY / "paths" / "comau_moved.csv").positions
    # the last ones of the new path are passed, the last one of the old path is not
    for point in moved[3:-1]:
        assert np.linalg.norm(run["y_t"] - point, axis=1).min() < 1.5e-3
    assert np.linalg.norm(run["y_t"][-1] - moved[-1]) < 1e-3
    moving = (run["eta"][:, 0] > 0.1) & (run["eta"][:, 0] < 0.9)
    assert run["eta_dot"][moving].min() > 0.25
    assert run.metrics["max_path_deviation"]["value"] < 0.5e-3
