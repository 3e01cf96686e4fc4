"""The folder of results: taken by one process, nothing of a user's is ever lost in it."""

import errno
import json
import os
import resource
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from pfsc_drake import InputError
from reporting.exchange import end_exchange
from reporting.folder import check_folder, open_results
from reporting.provenance import MANIFEST, PROJECT_ROOT, RESULTS, read_outcome


@pytest.fixture(name="out")
def fixture_out(tmp_path):
    """A folder with the results of a run."""
    folder = tmp_path / "out"
    with open_results(folder, "run") as results:
        for name in ("scenario.yaml", "log.h5", "metrics.json", "figures/path.png", "report.html"):
            results.write(name, f"first {name}")
    return folder


def content(folder: Path) -> dict[str, bytes]:
    """Content of all files below a folder."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() or path.is_symlink())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def visible(folder: Path) -> dict[str, bytes]:
    """The same without unfinished files."""
    hidden = (".next", ".ready", ".unfinished")
    return {name: text for name, text in content(folder).items() if not name.startswith(hidden)}


def assert_refused(folder, reason, kind="run", inputs=()):
    """Refused with one line by check and by opening, and nothing has changed."""
    before = content(folder)
    for use in (check_folder, lambda *arguments: open_results(*arguments).__enter__()):
        with pytest.raises(InputError) as caught:
            use(folder, kind, inputs)
        assert str(caught.value).startswith(f"--out {folder}: ")
        assert reason in str(caught.value)
        assert "\n" not in str(caught.value)
    assert content(folder) == before


def test_results_of_an_earlier_run_are_replaced_and_all_else_stays(out):
    (out / "notes.txt").write_text("mine")
    (out / "mine").mkdir()
    (out / "mine" / "log.h5").write_text("mine")
    before = content(out)
    with open_results(out, "run") as results:
        assert results.write("log.h5", b"second") == out / "log.h5"
        assert visible(out) == before
        assert results.explain_problems() is None
        assert not (out / "figures").exists()
    assert set(content(out)) == {"notes.txt", "mine/log.h5", MANIFEST, "log.h5"}
    assert (out / "log.h5").read_bytes() == b"second"


@pytest.mark.parametrize("name", [*RESULTS, MANIFEST, ".unfinished", ".next", ".ready", "figures"])
@pytest.mark.parametrize("kind_of_file", ["file", "link", "dead link", "folder"])
def test_foreign_files_are_obstacles(tmp_path, name, kind_of_file):
    folder, target = tmp_path / "out", tmp_path / "target"
    folder.mkdir()
    target.write_text("mine")
    if kind_of_file == "folder":
        (folder / name).mkdir()
        (folder / name / "mine.txt").write_text("mine")
    elif kind_of_file == "file":
        (folder / name).write_text("mine")
    else:
        (folder / name).symlink_to(target if kind_of_file == "link" else "nowhere")
    expected = f"it holds {name}" + ("/mine.txt" if (name, kind_of_file) == DRAWN else "")
    if kind_of_file == "dead link":
        with pytest.raises(InputError, match=f"it holds {name}, which no run has written"):
            check_folder(folder, "run")
        assert (folder / name).is_symlink()
    else:
        assert_refused(folder, f"{expected}, which no run has written")
    assert target.read_text() == "mine"


DRAWN = ("figures", "folder")


def test_a_result_replaced_by_a_link_is_an_obstacle(out, tmp_path):
    (out / "log.h5").rename(tmp_path / "moved.h5")
    (out / "log.h5").symlink_to(tmp_path / "moved.h5")  # the same content
    assert_refused(out, "it holds log.h5, which no run has written")


def test_images_of_the_user_among_the_figures_are_obstacles(out):
    (out / "figures" / "mine.png").write_text("mine")
    assert_refused(out, "it holds figures/mine.png, which no run has written")


def test_inputs_are_obstacles_by_any_name(out, tmp_path):
    (tmp_path / "link.yaml").symlink_to(out / "scenario.yaml")
    for source in (out / "scenario.yaml", out / ".." / "out" / "scenario.yaml", "link.yaml"):
        assert_refused(out, "its scenario.yaml is an input of this run", inputs=[tmp_path / source])
    nowhere = [tmp_path / "none", tmp_path / ("n" * 300), Path("a\0b")]
    check_folder(out, "run", nowhere)


def test_results_of_another_kind_are_obstacles(out):
    assert_refused(out, "it holds the results of a run", kind="comparison")


@pytest.mark.parametrize(
    "text",
    [
        "not JSON",
        "[]",
        '{"program": "other", "results": "run", "files": {"log.h5": ""}}',
        '{"program": "pfsc_drake", "results": "run"}',
        '{"program": "pfsc_drake", "results": "run", "files": 3}',
    ],
)
def test_a_manifest_of_somebody_else_is_none(out, text):
    (out / MANIFEST).write_text(text)
    assert_refused(out, "which no run has written")


def test_a_manifest_cannot_name_what_is_no_result(tmp_path):
    folder, victim = tmp_path / "out", tmp_path / "victim.png"
    folder.mkdir()
    victim.write_text("")
    (folder / "notes.txt").write_text("")
    names = ("../victim.png", "notes.txt", "figures/../../victim.png", str(victim))
    files = ", ".join(f'"{name}"' for name in names)
    (folder / MANIFEST).write_text(
        f'{{"program": "pfsc_drake", "results": "run", "files": [{files}]}}'
    )
    with open_results(folder, "run"):
        pass
    assert victim.exists()
    assert (folder / "notes.txt").exists()


def test_no_folder(tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "dead").symlink_to("nowhere")
    os.mkfifo(tmp_path / "pipe")
    for name in ("file", "dead", "pipe"):
        with pytest.raises(InputError, match="is no folder; allowed: a folder"):
            check_folder(tmp_path / name, "run")
    with pytest.raises(InputError, match="cannot be written: Not a directory"):
        check_folder(tmp_path / "file" / "out", "run")
    with pytest.raises(InputError, match="cannot be written: File name too long"):
        check_folder(tmp_path / ("n" * 300), "run")
    with pytest.raises(InputError, match="cannot be written: no name of a folder"):
        check_folder(tmp_path / "a\0b", "run")
    with pytest.raises(InputError, match="/proc/nothing/out: cannot be written"):
        open_results(Path("/proc/nothing/out"), "run").__enter__()
    assert (tmp_path / "file").read_text() == "mine"


def test_one_process_at_a_time(out):
    first = content(out)
    code = (
        "import sys; from pathlib import Path;"
        "from reporting.folder import open_results\n"
        "with open_results(Path(sys.argv[1]), 'run') as results:\n"
        "    results.write('log.h5', 'of the other process'); print('taken', flush=True)\n"
        "    sys.stdin.read()\n"
    )
    command = [sys.executable, "-c", code, str(out)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, cwd=PROJECT_ROOT, **pipes, text=True) as process:
        assert process.stdout.readline() == "taken\n"
        before = content(out)
        with (
            pytest.raises(InputError, match="another run is writing into it"),
            open_results(out, "run"),
        ):
            pass
        assert content(out) == before
        process.kill()  # a crash leaves no lock, and the earlier results
        process.communicate()
    assert visible(out) == first and (out / ".next" / "log.h5").exists()
    with open_results(out, "run"):
        pass
    assert set(content(out)) == {MANIFEST}


def test_a_process_that_ends_while_it_writes_leaves_no_trap(out):
    (out / ".unfinished").write_text("half a log")
    with open_results(out, "run"):
        pass
    assert set(content(out)) == {MANIFEST}


class Killed(BaseException):
    """The end of a process."""


@pytest.mark.parametrize("step", range(14))
def test_a_process_that_ends_amid_the_exchange_leaves_one_of_both_whole(out, monkeypatch, step):
    """After what the next one does first."""
    (out / "notes.txt").write_text("mine")
    old = content(out) | {MANIFEST: b""}
    new = {name: f"second {name}".encode() for name in ("log.h5", "sweep.csv", "figures/a.png")}
    expected_files = new | {"notes.txt": b"mine", MANIFEST: b""}
    steps = {
        name: getattr(Path, name) for name in ("rename", "replace", "unlink", "rmdir", "mkdir")
    }
    left = [step]

    def counted(name):
        def call(self, *arguments, **options):
            if left[0] == 0:
                raise Killed
            left[0] -= 1
            return steps[name](self, *arguments, **options)

        return call

    with suppress(Killed), open_results(out, "run") as results:
        for name, text in new.items():
            results.write(name, text)
        for name in steps:
            monkeypatch.setattr(Path, name, counted(name))
        results.exchange()
    monkeypatch.undo()
    check_folder(out, "run")
    end_exchange(out)
    found = visible(out) | {MANIFEST: b""}
    assert found in (old, expected_files)
    assert (found == expected_files) == (step >= 2)  # behind the one change of a name that decides
    with open_results(out, "run"):
        pass
    assert set(content(out)) == {MANIFEST, "notes.txt"}


def test_a_failure_before_there_is_a_result_leaves_the_earlier_ones(out):
    before = content(out)
    with pytest.raises(KeyboardInterrupt), open_results(out, "run") as results:
        results.write("scenario.yaml", "second")
        raise KeyboardInterrupt
    assert content(out) == before
    with pytest.raises(KeyboardInterrupt), open_results(out, "run") as results:
        results.write("scenario.yaml", "second")
        results.write("log.h5", "second")
        raise KeyboardInterrupt
    assert set(content(out)) == {MANIFEST, "scenario.yaml", "log.h5"}
    assert (out / "log.h5").read_text() == "second"


def test_what_cannot_be_exchanged_is_saved_elsewhere(out, temporary):
    """A folder is removed, or replaced, after all has been written."""
    with open_results(out, "run") as results:
        results.write("log.h5", b"the log")
        moved = out.rename(out.with_name("moved"))
        out.mkdir()
        reason = results.explain_problems()
    (saved,) = temporary.iterdir()
    assert reason == (
        f"cannot write log.h5 into {out}: another folder has taken its place; saved in {saved}"
    )
    assert (saved / "log.h5").read_text() == "the log"
    assert content(out) == {} and (moved / "log.h5").read_text() == "first log.h5"


def test_results_removed_before_the_exchange_are_reported_as_lost(out, temporary):
    with open_results(out, "run") as results:
        results.write("log.h5", b"the log")
        shutil.rmtree(out)
        reason = results.explain_problems()
    assert reason.endswith(": No such file or directory; lost: log.h5")


def test_a_result_that_the_user_changes_meanwhile_stays(out, temporary):
    with open_results(out, "run") as results:
        results.write("metrics.json", b"second")
        results.write("log.h5", b"second")
        (out / "log.h5").write_text("my own, of another length")
        (out / "report.html").write_text("with my notes")
        assert (
            "another process has created log.h5 meanwhile; saved in" in results.explain_problems()
        )
    assert (out / "log.h5").read_text() == "my own, of another length"
    assert (out / "report.html").read_text() == "with my notes"
    assert set(content(out)) == {MANIFEST, "metrics.json", "log.h5", "report.html"}
    assert json.loads((out / MANIFEST).read_text())["files"] == ["metrics.json"]


@pytest.fixture(name="temporary")
def fixture_temporary(tmp_path, monkeypatch):
    """The folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def test_a_removed_folder(out, temporary):
    with open_results(out, "run") as results:
        results.write("scenario.yaml", "x")
        shutil.rmtree(out)
        saved = results.write("log.h5", b"the log")
        picture = results.write("figures/path.png", b"a picture")
    assert saved.read_bytes() == b"the log"
    assert picture == saved.parent / "figures" / "path.png"
    assert saved.is_relative_to(temporary)
    assert results.explain_problems() == (
        f"cannot write log.h5, figures, scenario.yaml into {out}: No such file or directory; saved "
        f"in {saved.parent}"
    )
    assert (saved.parent / "scenario.yaml").read_text() == "x"
    assert not out.exists()


def test_a_folder_replaced_by_another_process(out, temporary):
    with open_results(out, "run") as results:
        shutil.rmtree(out)
        out.mkdir()
        saved = results.write("log.h5", b"the log")
    assert saved.is_relative_to(temporary)
    assert "another folder has taken its place" in results.explain_problems()
    assert content(out) == {}


def test_a_file_created_by_another_process_meanwhile(out, temporary):
    with open_results(out, "run") as results:
        (out / "log.h5").write_text("mine")
        saved = results.write("log.h5", b"the log")
    assert (out / "log.h5").read_text() == "mine"
    assert saved.is_relative_to(temporary)
    assert "another process has created log.h5 meanwhile" in results.explain_problems()


def test_files_that_grow_too_large_are_whole_or_not_there(out, temporary):
    """As on a full disk; what still fits is written, what fits nowhere is said to be lost."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with open_results(out, "run") as results:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
        try:
            lost = results.write("log.h5", b"x" * 10_001)
            saved = results.write("metrics.json", b"x" * 10_000)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (lost, saved) == (None, out / "metrics.json")
    assert set(content(out)) == {MANIFEST, "metrics.json"}
    assert content(temporary) == {}
    reason = os.strerror(errno.EFBIG)
    assert results.explain_problems() == f"cannot write log.h5 into {out}: {reason}; lost: log.h5"


def test_a_folder_is_gone_on_with(out):
    before = content(out)
    with open_results(out, "run", resume=True) as results:
        assert content(out) == before
        results.write("log.h5", b"second")
        results.write("figures/path.png", b"second")
        assert results.explain_problems() is None
    assert content(out) | {MANIFEST: b""} == before | {
        "log.h5": b"second",
        "figures/path.png": b"second",
        MANIFEST: b"",
    }
    check_folder(out, "run")
    assert_refused(out, "it holds the results of a run", kind="sweep")


def test_a_file_that_is_written_again_is_there_at_every_moment(tmp_path):
    out = tmp_path / "out"
    for session in range(2):
        with open_results(out, "sweep", resume=True) as results:
            for part in range(3):
                results.write("sweep.json", f"{session} {part}")
                assert (out / "sweep.json").read_text() == f"{session} {part}"
                # as if the process ended in the middle of the next one
                (out / ".unfinished").write_text("half of i")
                check_folder(out, "sweep")


def test_the_manifest_contains_the_outcome(out):
    assert read_outcome(out, "run") == {}
    with open_results(out, "run") as results:
        results.tell({"fault": None, "warnings": ["slow"]})
        results.write("report.html", "later")
    assert read_outcome(out, "run") == {"fault": None, "warnings": ["slow"]}
    assert json.loads((out / MANIFEST).read_text())["files"] == ["report.html"]
    with pytest.raises(InputError, match=r"holds the results of a run; allowed: the folder of a"):
        read_outcome(out, "sweep")
    with pytest.raises(InputError, match=r"holds no results"):
        read_outcome(out.parent, "run")


def test_what_the_manifest_could_not_list_is_not_written(out):
    with open_results(out, "run") as results:
        for name in ("notes.txt", "figures/../x.png", MANIFEST):
            with pytest.raises(AssertionError):
                results.write(name, "x")
        assert results.write("excitation.html", "x") == out / "excitation.html"
    assert set(content(out)) == {MANIFEST, "excitation.html"}
