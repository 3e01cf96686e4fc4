"""Runs side by side."""

import numpy as np
import pytest

from experiments.cli import main
from experiments.results.metrics import Metrics
from experiments.results.run_log import RunLog


@pytest.fixture(name="make_run")
def fixture_make_run(tmp_path):
    def make(name, deviation, oriented=True, pushed=False):
        folder = tmp_path / name
        folder.mkdir()
        time = np.linspace(0.0, 1.0, 50)
        log = RunLog(time, attributes={"scenario": name, "drake_version": "1.51"})
        log.add("xi", np.column_stack([deviation * time, 0.0 * time]), "m")
        log.add("eta", time, "m")
        log.add("eta_p", time + 0.001, "m")
        if oriented:
            for signal in ("angles_e", "angles_d"):
                log.add(signal, np.outer(time, [0.1, 0.2, 0.3]), "rad")
            log.add("orientation_lead", 0.1 * time, "rad")
        if pushed:
            log.add("wrench_ext", np.outer(time, [3.0, 0.0, 4.0, 0.0, 0.0, 1.0]), "N, Nm")
        log.write(folder / "log.h5")
        metrics = Metrics()
        metrics.add("max_path_deviation", deviation, "m")
        metrics.write(folder / "metrics.json")
        (folder / "scenario.yaml").write_text(f"name: {name}\n", encoding="utf-8")
        return folder

    return make


def test_both_runs_are_on_the_page(make_run, tmp_path, capsys):
    folders = [make_run("slow", 0.0123), make_run("fast", 0.0456)]
    out = tmp_path / "page"
    assert main(["compare", *map(str, folders), "--out", str(out)]) == 0
    assert str(out / "report.html") in capsys.readouterr().out.replace("\n", "")
    page = (out / "report.html").read_text(encoding="utf-8")
    for part in ("slow", "fast", "12.3", "45.6", "name: slow", "name: fast"):
        assert part in page
    assert {path.name for path in (out / "figures").iterdir()} == {
        "deviations.png",
        "orientation_lead.png",
        "orientations.png",
    }


def test_without_orientation_there_is_no_picture_of_it(make_run, tmp_path):
    folders = [make_run("slow", 0.01), make_run("fast", 0.02, oriented=False)]
    assert main(["compare", *map(str, folders), "--out", str(tmp_path / "page")]) == 0
    assert not (tmp_path / "page" / "figures" / "orientations.png").exists()


def test_forces_are_compared_where_both_have_them(make_run, tmp_path):
    out = tmp_path / "page"
    folders = [make_run("a", 0.01, pushed=True), make_run("b", 0.02, pushed=True)]
    assert main(["compare", *map(str, folders), "--out", str(out)]) == 0
    assert (out / "figures" / "forces.png").exists()
    assert "Force" in (out / "report.html").read_text(encoding="utf-8")
    other = tmp_path / "other"
    folders = [make_run("c", 0.01, pushed=True), make_run("d", 0.02)]
    assert main(["compare", *map(str, folders), "--out", str(other)]) == 0
    assert not (other / "figures" / "forces.png").exists()


def test_wrong_folders_are_refused(make_run, tmp_path, capsys):
    run = make_run("slow", 0.01)
    for arguments in ([str(run)], [str(run), str(run)], [str(run), str(tmp_path / "none")]):
        assert main(["compare", *arguments, "--out", str(tmp_path / "page")]) == 2
        assert capsys.readouterr().err.count("\n") == 1
