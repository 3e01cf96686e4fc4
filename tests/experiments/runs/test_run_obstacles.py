"""A person who crosses the path: kept, and broken, promises of a run on the truth."""

import h5py
import numpy as np
import pytest

from experiments.scenario_file import read_scenario
from experiments.simulated_run import RunOptions, run_scenario
from pfsc_drake.errors import InputError
from reporting.progress import NoProgress

_YIELDING = "{mass: {value: 10}, damping: {value: 400}, stiffness: {value: 2000}}"


def _run(folder, *overrides, duration=2.0):
    return run_scenario(
        read_scenario("pfc_crossing_6r", list(overrides), ()),
        out=folder,
        options=RunOptions(duration, figures=False, recording=False),
        progress=NoProgress(),
    )


@pytest.mark.slow
def test_the_tool_waits_and_its_promise_is_kept(tmp_path):
    outcome = _run(tmp_path, duration=3.0)
    metrics = outcome.metrics
    assert outcome.fault is None
    assert outcome.broken == []
    assert metrics["least_distance_while_moving"].passed
    assert metrics["waited_time"].value > 0.5
    assert metrics["max_path_deviation"].value < 0.5e-3
    assert not [warning for warning in outcome.warnings if "obstacles" in warning]


# a person who stands beside the start until 0.8 s, and then leaves
_STANDS = "{kind: column, radius: 0.25, way: [{time: 0.6, position: [%g, %g, 0.0]}, \
{time: 0.8, position: [%g, %g, 0.0]}, {time: 2.0, position: [3.0, -1.0, 0.0]}, \
{time: 2.2, position: [3.0, -1.0, 0.0]}]}"


@pytest.mark.slow
def test_the_approach_to_the_path_waits_too(tmp_path):
    """The tool starts 50 mm beside its path, and goes there once the person has left."""
    where = (1.4, -0.7) * 2
    outcome = _run(
        tmp_path,
        f"obstacles.moving=[{_STANDS % where}]",
        "start.offset=[0.05, 0.0]",
        duration=2.8,
    )
    metrics = outcome.metrics
    assert metrics["least_distance"].value < 0.15
    assert metrics["least_distance_while_moving"].value > 0.15
    assert metrics["waited_time"].value > 0.8
    with h5py.File(tmp_path / "log.h5") as log:
        t, y_t, speed = (log[name][:] for name in ("t", "y_t", "arm_speed"))
        xi = np.linalg.norm(log["xi"][:], axis=1)
    waits = (t > 0.05) & (t < 0.8)
    assert np.linalg.norm(y_t[waits] - y_t[0], axis=1).max() < 1e-3
    assert speed[waits].max() < 0.025
    assert xi[waits] == pytest.approx(0.05, abs=2e-3) and xi[-1] < 1e-3


@pytest.mark.slow
def test_a_start_beside_the_path_needs_a_transition(tmp_path):
    with pytest.raises(InputError, match=r"start.transition = 0.0.*beside its path \(by 0.05"):
        _run(tmp_path, "start.offset=[0.05, 0.0]", "start.transition=0")


@pytest.mark.slow
def test_who_is_faster_than_was_said_breaks_the_promise_and_the_run_says_so(tmp_path):
    outcome = _run(
        tmp_path,
        "obstacles.watch.largest_speed=0.01",
        "obstacles.watch.horizon=0.1",
        "obstacles.watch.margin=0.6",
        "obstacles.watch.side=0.0",
        "obstacles.watch.uncertainty=0.0",
        "obstacles.watch.arm_radius=0.1",
        duration=1.6,
    )
    assert any("largest_speed = 0.01 m/s" in warning for warning in outcome.warnings)
    assert outcome.fault is None
    assert len(outcome.broken) == 1
    assert outcome.broken[0].startswith("least_distance_while_moving = ")


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("obstacles.moving=[]", "moving"),
        ("obstacles.sensor.delay=0.0003", "obstacles.sensor.delay"),
        ("obstacles.elbow.room=0.3", "obstacles.elbow"),
        ("controller.manifold=trajectory", "obstacles = given"),
        (f"compliance.transversal={_YIELDING}", "compliance = given"),
    ],
)
def test_what_does_not_suit_is_refused_by_its_key(tmp_path, override, message):
    with pytest.raises(InputError, match=message):
        _run(tmp_path, override)


@pytest.mark.slow
def test_a_motion_that_does_not_arrive_is_no_success(tmp_path):
    """The person stays on the path until the run, which is not cut short, is over."""
    stays = "{kind: column, radius: 0.25, way: [{time: 0.0, position: [0.8, 0.3, 0.0]}, \
{time: 1.0, position: [0.8, 0.3, 0.0]}]}"
    outcome = _run(
        tmp_path,
        f"obstacles.moving=[{stays}]",
        "obstacles.watch.retreat=0",
        "reference.points=[0.0, 1.0]",
        "reference.velocity=1.2",
        "reference.acceleration=4.0",
        "judged_after=2.1",
        duration=2.2,
    )
    assert outcome.fault is None
    (broken,) = [phrase for phrase in outcome.broken if phrase.startswith("arrived")]
    assert "target >= 0.99" in broken and "the tool still waits for an obstacle" in broken
    assert 0.0 <= outcome.metrics["arrived"].value < 0.7
