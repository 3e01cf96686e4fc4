"""Folders are refused before the work; a full disk loses nothing and is another status."""

from pathlib import Path

import pytest
import typer

from identification.cli import main
from identification.measurement.files import read_record, write_record
from identification.output import check_folder, write_text
from pfsc_drake.errors import InputError, WriteError
from reporting.terminal import run_app

ROBOT = "festo_expt_45"


def test_folders(tmp_path):
    (tmp_path / "file").write_text("")
    check_folder(tmp_path)
    check_folder(tmp_path / "new" / "deep")
    assert not (tmp_path / "new").exists()
    for folder in (tmp_path / "file", tmp_path / "file" / "deep"):
        with pytest.raises(InputError, match="file is no folder; allowed: a folder"):
            check_folder(folder)


@pytest.mark.parametrize(
    "command",
    [["excite", ROBOT], ["simulate", ROBOT], ["estimate", ROBOT, "a.csv"]],
    ids=lambda command: command[0],
)
def test_a_file_instead_of_the_folder_is_refused_before_the_work(
    tmp_path, monkeypatch, capsys, command
):
    for step in ("excitation.search.search", "steps.simulate_runs", "pages.identify"):
        monkeypatch.setattr(f"identification.{step}", None)
    out = tmp_path / "file"
    out.write_text("mine")
    assert main([*command, "--out", str(out)]) == 2
    assert "is no folder" in capsys.readouterr().err
    assert out.read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--periods", "1000000000"], "--periods 1000000000 of 10 s: 1e+10 s; allowed: a run of"),
        (["--period", "nan"], "nan s; allowed: a run of up to 3600 s"),
        (["--starts", "999999999"], "'--starts': Input should be less than or equal to 1000"),
    ],
)
def test_a_search_without_end_is_refused(capsys, options, reason):
    assert main(["excite", ROBOT, *options]) == 2
    assert reason in capsys.readouterr().err


def test_a_full_disk_loses_nothing(tmp_path, record, robot):
    file = tmp_path / "run.h5"
    file.symlink_to("/dev/full")
    with pytest.raises(WriteError, match="No space left on device; saved in /") as caught:
        write_record(file, record, robot)
    saved = Path(str(caught.value).rpartition("saved in ")[2])
    assert (read_record(saved, robot).tau == record.tau).all()
    saved.unlink()
    saved.parent.rmdir()
    # nothing half-written is left in its place
    assert not file.is_symlink()
    with pytest.raises(InputError, match="cannot be written: No such file") as caught:
        write_text(tmp_path / "none" / "a.txt", "")
    assert not isinstance(caught.value, WriteError)


@pytest.mark.parametrize(("error", "status"), [(WriteError, 4), (InputError, 2)])
def test_status(error, status, capsys):
    app = typer.Typer()

    @app.command()
    def do() -> None:
        raise error("run.h5: cannot be written")

    assert run_app(app, "test", []) == status
    assert capsys.readouterr().err == "error: run.h5: cannot be written\n"
