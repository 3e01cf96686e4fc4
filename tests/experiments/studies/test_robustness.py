"""The study of robots that are not their models, shrunk."""

import json

import pytest

from experiments.cli import main
from experiments.studies.robustness import SUBJECTS, write_robustness


@pytest.mark.slow
def test_what_a_wrong_model_does(tmp_path):
    three = tuple(s for s in SUBJECTS if s.scenario == "pfc_elastic_3r")
    some = {"as modelled": (), "masses 10 % too low": ("model_error.mass=0.9",)}
    lines = []
    report = write_robustness(tmp_path, lines.append, three, some)
    assert report.problem is None
    assert len(lines) == 4
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    value = {name: entry["value"] for name, entry in metrics.items()}
    for when in ("before", "after"):
        assert value[f"pfc_elastic_3r, as modelled, {when}"] < 1e-4
        light = value[f"pfc_elastic_3r, masses 10 % too low, {when}"]
        assert 1e-4 < light < 2e-2
    assert (tmp_path / "figures" / "robustness.png").stat().st_size > 10_000


def test_a_study_that_there_is_not(capsys, tmp_path):
    assert main(["study", "nothing", "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "study nothing: allowed: robustness, fastest, crossings" in error


def test_the_folder_is_refused_before_anything_is_run(tmp_path, capsys):
    (tmp_path / "metrics.json").write_text("mine")
    assert main(["study", "robustness", "--out", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "holds metrics.json, which no study has written" in captured.err
    assert captured.err.count("\n") == 1
