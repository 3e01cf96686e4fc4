"""The study of what must be known of a workpiece's motion, shrunk."""

import json

import pytest

from experiments.scenario_file import read_scenario
from experiments.studies.two_arms import SOURCES, WORLDS, at_speed, write_two_arms


def test_both_arms_are_the_shipped_ones_at_its_speed():
    shipped, same = read_scenario("pfc_two_arms", []), read_scenario("pfc_two_arms", at_speed(0.3))
    for one in (lambda data: data, lambda data: data["holder"]):
        told, own = one(same.data)["reference"], one(shipped.data)["reference"]
        for key in ("velocity", "acceleration"):
            assert told[key] == pytest.approx(own[key], rel=1e-12)


def test_both_arms_keep_their_geometry_at_another_speed():
    """Twice as fast: velocities are doubled, accelerations are fourfold."""
    slow, fast = (read_scenario("pfc_two_arms", at_speed(speed)) for speed in (0.15, 0.3))
    for one in (lambda data: data, lambda data: data["holder"]):
        before, after = one(slow.data)["reference"], one(fast.data)["reference"]
        assert after["velocity"] == pytest.approx(2.0 * before["velocity"])
        assert after["acceleration"] == pytest.approx(4.0 * before["acceleration"])


@pytest.mark.slow
def test_jets_beat_the_pose_alone(tmp_path):
    world, lines = "exact models and sensors", []
    first, *_, last = SOURCES
    told = {name: SOURCES[name] for name in (first, last)}
    report = write_two_arms(tmp_path, lines.append, {world: WORLDS[world]}, told, [0.3])
    assert report.problem is None and len(lines) == 2
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    off = {name: metrics[f"{world}, {name}, 0.3 m/s"]["value"] for name in told}
    assert off[first] < 1e-6 and off[last] > 5e-4
