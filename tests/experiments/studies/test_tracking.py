"""The study of path following against trajectory tracking, shrunk."""

import json

import pytest

from experiments.studies.tracking import FORCES, ROBOTS, write_tracking


@pytest.mark.slow
def test_what_a_plain_force_does(tmp_path):
    (plain,) = (name for name in FORCES if name.startswith("a plain force"))
    (exact,) = (name for name in ROBOTS if name == "as modelled")
    lines = []
    report = write_tracking(tmp_path, lines.append, {plain: FORCES[plain]}, {exact: ROBOTS[exact]})
    assert report.problem is None
    assert len(lines) == 3
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    deviation = {
        law: metrics[f"{law}, {plain}, {exact}: max_path_deviation"]["value"]
        for law in ("path following", "tracking, the same gains", "tracking, xi like eta")
    }
    # the reference of path following waits; both feel what the force does across
    assert 1e-3 < deviation["path following"] < deviation["tracking, the same gains"]
    assert deviation["tracking, the same gains"] < deviation["tracking, xi like eta"]
