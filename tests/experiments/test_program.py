"""The program ``pfsc``: the same commands from anywhere, and one line where there are none."""

import contextlib
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from experiments.cli import main
from pfsc_drake import program
from reporting.provenance import PROJECT_ROOT

CODE = "import sys; sys.argv[0] = 'pfsc'; from pfsc_drake.program import main; sys.exit(main())"


def pfsc(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess:
    environment = {**os.environ, "PYTHONPATH": str(PROJECT_ROOT), **variables}
    return subprocess.run(
        [sys.executable, "-c", CODE, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )


@pytest.fixture
def completed(monkeypatch, capsys):
    """Return a function that tells what the shell is offered for the last word of a line."""

    def offers(folder: Path, line: str) -> list[str]:
        monkeypatch.chdir(folder)
        monkeypatch.setenv("_PFSC_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
        monkeypatch.setattr(sys, "argv", ["pfsc"])
        with contextlib.suppress(SystemExit):
            program.main()
        return capsys.readouterr().out.split()

    return offers


def test_it_is_what_is_installed():
    project = tomllib.loads((PROJECT_ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["scripts"] == {"pfsc": "pfsc_drake.program:main"}


@pytest.mark.slow
def test_from_any_folder(tmp_path):
    result = pfsc(tmp_path, "run", "no_such_scenario")
    assert result.returncode == 2
    assert result.stderr.startswith("error: unknown scenario 'no_such_scenario'")
    assert result.stderr.count("\n") == 1
    assert "see pfsc --help" in pfsc(tmp_path, "frob").stderr


def test_a_folder_that_is_called_so_is_not_taken(tmp_path):
    (tmp_path / "experiments").mkdir()
    (tmp_path / "experiments" / "__init__.py").write_text("raise SystemExit('the wrong one')\n")
    assert pfsc(tmp_path, "--version", PYTHONSAFEPATH="1").returncode == 0


def test_the_library_alone(tmp_path, capsys):
    assert program.main(tmp_path) == 2
    line = capsys.readouterr().err
    assert line.startswith("error: pfsc: the commands run from a clone")
    assert line.count("\n") == 1


def test_packages_that_are_missing(monkeypatch, capsys):
    def missing(name):
        raise ModuleNotFoundError(f"No module named 'typer' for {name}", name="typer")

    monkeypatch.setattr(program.importlib, "import_module", missing)
    assert program.main() == 2
    line = capsys.readouterr().err
    assert line == "error: pfsc: the package typer is missing; install with make setup\n"


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("pfsc ru", ["run"]),
        ("pfsc run pfc_elastic_", ["pfc_elastic_3r", "pfc_elastic_6r", "pfc_elastic_7r"]),
        ("pfsc run my", ["my.yaml", "mystery/"]),
        ("pfsc run mystery/", ["mystery/other.yml"]),
        ("pfsc run nowhere/", []),
        ("pfsc study fa", ["fastest"]),
        ("pfsc drive --qu", ["--quiet"]),
    ],
)
def test_completion(completed, tmp_path, line, offered):
    (tmp_path / "my.yaml").touch()
    (tmp_path / "my.csv").touch()
    (tmp_path / "mystery").mkdir()
    (tmp_path / "mystery" / "other.yml").touch()
    assert completed(tmp_path, line) == offered


def test_a_shell_is_offered_words(tmp_path):
    words = {"_PFSC_COMPLETE": "complete_bash", "COMP_WORDS": "pfsc ru", "COMP_CWORD": "1"}
    assert pfsc(tmp_path, **words).stdout.split() == ["run"]


def test_version(capsys):
    assert main(["--version"]) == 0
    line = capsys.readouterr().out
    assert re.fullmatch(
        r"pfsc_drake 0\.\S+, Drake \S+, CasADi \S+, git ([0-9a-f]{40}(\+dirty)?|unknown)\n", line
    )


def test_only_a_program_of_one_word_is_completed(capsys):
    assert main(["--help"], program="pfsc") == 0
    assert "--install-completion" in capsys.readouterr().out
    assert main(["--help"]) == 0
    assert "--install-completion" not in capsys.readouterr().out
