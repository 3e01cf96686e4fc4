"""The study of all laws on joints of rising stiffness, shrunk."""

import json

import pytest

from experiments.cli import main
from experiments.studies.stiffness import write_study

pytestmark = pytest.mark.slow


def test_stiff_joints_suit_the_simple_laws_and_soft_ones_do_not(tmp_path):
    lines = []
    report = write_study(tmp_path, lines.append, laws=("elastic", "rigid"), stiffnesses=(1e4, 1e6))
    assert len(lines) == 4
    assert report.problem is None
    assert (tmp_path / "figures" / "deviation.png").stat().st_size > 10_000
    assert "Which law when" in report.path.read_text(encoding="utf-8")
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    deviation = {name: entry["value"] for name, entry in metrics.items()}
    soft, stiff = "K_s1 = 1e+04 Nm/rad", "K_s1 = 1e+06 Nm/rad"
    # the rigid law leaves the deflection alone, which falls with the stiffness
    ratio = deviation[f"rigid, {soft}"] / deviation[f"rigid, {stiff}"]
    assert ratio == pytest.approx(100.0, rel=0.4)
    assert deviation[f"elastic, {soft}"] < 1e-5
    assert deviation[f"elastic, {stiff}"] < 5e-5


def test_the_folder_is_refused_before_anything_is_run(tmp_path, capsys):
    (tmp_path / "metrics.json").write_text("mine")
    assert main(["study", "--out", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "holds metrics.json, which no study has written" in captured.err
    assert captured.err.count("\n") == 1
