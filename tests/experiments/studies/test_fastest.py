"""The study of fastest motions, of one short path on a grid that is little finer."""

import json

import pytest

from experiments.studies import fastest

pytestmark = pytest.mark.slow


def test_the_page_is_written(tmp_path, monkeypatch):
    path = {"short": ("pfc_elastic_3r", ("reference.points=[0.0, 0.1]",))}
    for name, value in {
        "PATHS": path,
        "_SEEDS": (),
        "_REQUESTED": ((1.0, 10.0),),
        "_FINER": 2,
    }.items():
        monkeypatch.setattr(fastest, name, value)
    said: list[str] = []
    fastest.write_fastest(tmp_path / "out", said.append)
    found = json.loads((tmp_path / "out" / "metrics.json").read_text())
    metrics = {name: metric["value"] for name, metric in found.items()}
    assert metrics["short: time"] < 0.9 * metrics["short: time, slowed down"]
    assert metrics["short: time, finer grid"] == pytest.approx(metrics["short: time"], rel=0.02)
    assert metrics["short, nominal model: deviation"] < 5e-5
    assert metrics["short, nominal model: torque relative to plan"] == pytest.approx(1.0, abs=0.01)
    heavier = metrics["short, nominal masses 5 % too low: deviation"]
    assert 5e-5 < heavier < 5e-3
    assert len(said) == 6
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000
