"""The study of what is measured of elastic joints, shrunk."""

import json

import pytest

from experiments.studies.joint_sides import CONDITIONS, SOURCES, SUBJECTS, write_joint_sides


@pytest.mark.slow
def test_what_torques_and_motors_tell(tmp_path):
    (six,) = (subject for subject in SUBJECTS if subject.scenario == "sfc_elastic_6r")
    lines = []
    some = {"as modelled": CONDITIONS["as modelled"]}
    report = write_joint_sides(tmp_path, lines.append, (six,), some)
    assert report.problem is None
    assert len(lines) == len(SOURCES)
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    off = {s: metrics[f"{six.scenario}, as modelled, {s}, largest"]["value"] for s in SOURCES}
    both, torques, motors, rigid = off.values()
    assert both < 1e-5
    assert torques < 1e-5
    assert torques < motors < 1e-4
    assert rigid > 5e-4
    assert (tmp_path / "figures" / "joint_sides.png").stat().st_size > 10_000
