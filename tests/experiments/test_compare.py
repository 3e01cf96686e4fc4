"""Runs side by side."""

import os

import numpy as np
import pytest

from experiments.cli import main
from experiments.compare import motion_differences
from experiments.results.run_log import RunLog
from reporting.metrics import Metrics


@pytest.fixture(name="make_run")
def fixture_make_run(tmp_path):
    def make(name, deviation, oriented=True, pushed=False, told="angles"):
        folder = tmp_path / name
        folder.mkdir()
        time = np.linspace(0.0, 1.0, 50)
        log = RunLog(time, attributes={"scenario": name, "drake_version": "1.51"})
        log.add("xi", np.column_stack([deviation * time, 0.0 * time]), "m")
        log.add("eta", time, "m")
        log.add("eta_p", time + 0.001, "m")
        if oriented:
            for suffix in ("e", "d"):
                values = np.outer(time, [0.1, 0.2, 0.3])
                log.add(f"{told}_{suffix}", values, "rad", ["a", "b", "c"])
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_the_page_says_whether_the_motions_are_the_same(make_run, tmp_path):
    folders = [make_run("slow", 0.01), make_run("fast", 0.02)]
    arguments = ["compare", *map(str, folders), "--out", str(tmp_path / "page")]
    page = tmp_path / "page" / "report.html"
    assert main(arguments) == 0
    assert "The same motion, side by side." in page.read_text(encoding="utf-8")
    for folder, velocity in zip(folders, (0.2, 1.0), strict=True):
        text = f"name: x\nreference: {{velocity: {velocity}}}\n"
        (folder / "scenario.yaml").write_text(text, encoding="utf-8")
    assert main(arguments) == 0
    said = page.read_text(encoding="utf-8")
    assert "Different motions, side by side." in said
    assert "reference.velocity is 0.2 in slow, 1 in fast." in said


def test_without_orientation_there_is_no_picture_of_it(make_run, tmp_path):
    folders = [make_run("slow", 0.01), make_run("fast", 0.02, oriented=False)]
    assert main(["compare", *map(str, folders), "--out", str(tmp_path / "page")]) == 0
    assert not (tmp_path / "page" / "figures" / "orientations.png").exists()


@pytest.mark.slow
def test_axes_are_compared_with_axes(make_run, tmp_path):
    folders = [make_run("a", 0.01, told="axis"), make_run("b", 0.02, told="axis")]
    assert main(["compare", *map(str, folders), "--out", str(tmp_path / "page")]) == 0
    assert (tmp_path / "page" / "figures" / "orientations.png").exists()
    folders = [make_run("c", 0.01, told="axis"), make_run("d", 0.02)]
    assert main(["compare", *map(str, folders), "--out", str(tmp_path / "other")]) == 0
    assert not (tmp_path / "other" / "figures" / "orientations.png").exists()


@pytest.mark.slow
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


@pytest.fixture(name="refused")
def fixture_refused(tmp_path, capsys):
    """Return a function that compares folders in vain and returns the line on stderr."""

    def compare(*folders, out=tmp_path / "page"):
        before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        assert main(["compare", *map(str, folders), "--out", str(out)]) == 2
        line = capsys.readouterr().err
        assert line.startswith("error: ")
        assert line.count("\n") == 1
        after = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        assert before == after
        return line

    return compare


def test_wrong_folders_are_refused(make_run, tmp_path, refused):
    run = make_run("slow", 0.01)
    assert "two or more" in refused(run)
    assert "names must differ" in refused(run, run)
    assert f"{tmp_path / 'none' / 'log.h5'}: no such file" in refused(run, tmp_path / "none")


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("scenario.yaml", None, "scenario.yaml: cannot be read: No such file"),
        ("scenario.yaml", b"\xff", "scenario.yaml: cannot be read: not UTF-8"),
        ("metrics.json", None, "metrics.json: cannot be read: No such file"),
        ("metrics.json", b"[1]", "metrics.json: not a readable metrics file"),
        ("metrics.json", b"[" * 100_000, "metrics.json: not a readable metrics file"),
        ("log.h5", b"x", "log.h5: not a readable run log"),
    ],
)
def test_unreadable_files_of_a_run_are_refused(make_run, refused, name, content, reason):
    folders = [make_run("slow", 0.01), make_run("fast", 0.02)]
    (folders[1] / name).unlink()
    if content is not None:
        (folders[1] / name).write_bytes(content)
    assert reason in refused(*folders)


def test_pipes_are_not_waited_for(make_run, refused):
    folders = [make_run("slow", 0.01), make_run("fast", 0.02)]
    (folders[1] / "log.h5").unlink()
    os.mkfifo(folders[1] / "log.h5")
    assert main(["compare", *map(str, folders)]) == 2


@pytest.mark.parametrize("signal", ["xi", "eta", "eta_p"])
def test_logs_that_cannot_be_compared(make_run, refused, signal):
    folders = [make_run("slow", 0.01), make_run("fast", 0.02)]
    log = RunLog.read(folders[1] / "log.h5")
    del log.signals[signal]
    log.write(folders[1] / "log.h5")
    assert f"log.h5: has no signal '{signal}'" in refused(*folders)


def test_no_page_is_written_into_a_run_or_a_users_folder(make_run, tmp_path, refused):
    folders = [make_run("slow", 0.01), make_run("fast", 0.02)]
    line = refused(*folders, out=folders[0])
    assert f"--out {folders[0]}: its log.h5 is an input of this comparison" in line
    other = tmp_path / "other"
    other.mkdir()
    (other / "report.html").write_text("mine")
    assert "holds report.html, which no comparison has written" in refused(*folders, out=other)
    assert "is no folder" in refused(*folders, out=other / "report.html")


@pytest.mark.slow
def test_a_page_is_written_anew(make_run, tmp_path):
    folders = [make_run("slow", 0.01), make_run("fast", 0.02, oriented=False)]
    out = tmp_path / "page"
    (tmp_path / "page").mkdir()
    (out / "notes.txt").write_text("mine")
    for _ in range(2):
        assert main(["compare", *map(str, folders), "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {
        "notes.txt",
        "manifest.json",
        "figures",
        "report.html",
    }


BASE = """
name: a
robot: {model: r}
path: {shape: !Circle {radius: 0.1}, orientation: {task: full}}
surface: null
reference: {points: [0.0, 0.5], velocity: 0.2}
controller: {law: rigid}
duration: 5.0
"""


def against(old, new):
    assert old in BASE
    return motion_differences({"a": BASE, "b": BASE.replace(old, new)})


@pytest.mark.parametrize(
    ("old", "new"),
    [("", ""), ("law: rigid", "law: elastic"), ("model: r", "model: s"), ("name: a", "name: b")],
)
def test_what_is_compared_is_no_other_motion(old, new):
    assert against(old, new) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("velocity: 0.2", "velocity: 1.0", "reference.velocity is 0.2 in a, 1 in b"),
        ("[0.0, 0.5]", "[0.0, 0.7]", "reference.points is [0.0, 0.5] in a, [0.0, 0.7] in b"),
        ("radius: 0.1", "radius: 0.2", "path.shape.radius is 0.1 in a, 0.2 in b"),
        ("!Circle {radius: 0.1}", "!Line {}", "path.shape is !Circle in a, !Line in b"),
        ("surface: null", "surface: {kind: x}", "surface is not given in a, another one in b"),
        ("duration: 5.0", "duration: 9.0", "duration is 5 in a, 9 in b"),
        (
            "!Circle {radius: 0.1}",
            "{file: /somewhere/way.csv}",
            "path.shape is !Circle in a, way.csv in b",
        ),
        ("[0.0, 0.5]", "[{at: 0.0}]", "reference.points is [0.0, 0.5] in a, 1 entry in b"),
    ],
)
def test_another_motion_is_told_with_its_key(old, new, told):
    assert against(old, new) == [told]


def test_runs_of_one_value_are_told_together():
    texts = dict.fromkeys(("a", "c"), BASE) | {"b": BASE.replace("0.2", "1.0")}
    assert motion_differences(texts) == ["reference.velocity is 0.2 in a and c, 1 in b"]


def test_of_many_differences_a_few_are_named():
    keys = "".join(f", k{i}: {{}}" for i in range(9))
    (text,) = [BASE.replace("velocity: 0.2", f"velocity: 0.2{keys.format(*range(9))}")]
    found = motion_differences({"a": BASE, "b": text})
    assert len(found) == 5
    assert found[-1] == "5 more keys"


def test_files_are_compared_by_what_they_hold(tmp_path):
    def text(folder, content):
        (tmp_path / folder).mkdir()
        file = tmp_path / folder / "way.csv"
        file.write_text(content)
        return f"path: {{shape: {{file: {file}}}}}"

    a, b, c = text("a", "1, 2"), text("b", "1, 2"), text("c", "3, 4")
    assert motion_differences({"a": a, "b": b}) == []
    assert motion_differences({"a": a, "c": c}) == [
        "path.shape.file is way.csv, but not the same content"
    ]
    # gone: by their names
    (tmp_path / "a" / "way.csv").unlink()
    assert motion_differences({"a": a, "c": c}) == []


def test_what_cannot_be_read_tells_nothing():
    assert motion_differences({"a": BASE, "b": "{", "c": "- 1"}) == []
    assert motion_differences({}) == []
