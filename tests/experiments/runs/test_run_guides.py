"""Paths that attract, through the command line, shortened."""

import h5py
import numpy as np
import pytest

from tests.experiments.runs.test_run_fixtures import run, way

# from the circle to the line, and beside it the hand lets go
WAY = [(0.6, [0.9, -0.02, 0.9]), (1.7, [0.9, 0.1, 0.95])]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """An arm with friction, noise and a wrong model."""
    folder = tmp_path_factory.mktemp("guides")
    changes = ("start.position=[0.9, -0.02, 0.9]", "hand.release=1.8", way(WAY))
    return folder, *run(folder, "vf_nearest_path", 2.6, *changes)


@pytest.mark.slow
def test_the_tool_goes_from_one_path_to_the_next(results):
    _, log, metrics = results
    assert log["guide"][0, 0] == 1
    assert log["guide"][-1, 0] in (2, 3)
    assert metrics["guide_rest_distance"] < 1e-3
    assert metrics["step_at_guide_change"] < 0.02
    assert metrics["guide_changes"] >= 1


@pytest.mark.slow
def test_nothing_is_given_and_the_audit_says_so(results):
    _, _, metrics = results
    for name in ("stationarity", "allowance", "energy", "tank"):
        assert metrics[f"audit_{name}"] < 1e-9
    assert metrics["audit_bound"] > 0.0


@pytest.mark.slow
def test_distances_in_the_log_are_the_tools_own(results):
    """From the circle by its formula, of where the tool truly is."""
    _, log, _ = results
    y = log["y_t"] - [0.9, -0.12, 0.9]
    expected = np.hypot(np.hypot(y[:, 0], y[:, 1]) - 0.1, y[:, 2])
    np.testing.assert_allclose(log["guide_distance"][:, 0], expected, atol=1e-9)


@pytest.mark.slow
def test_the_names_are_in_the_log(results):
    folder, _, _ = results
    with h5py.File(folder / "log.h5") as file:
        labels = list(file["guide"].attrs["labels"])
        assert labels == ["none", "circle_1", "line_2", "waypoints_3"]
        assert list(file["guide_eta"].attrs["labels"]) == labels[1:]
