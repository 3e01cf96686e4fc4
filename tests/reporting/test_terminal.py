"""Text on terminals that lack its characters, and errors of one line."""

import io
import os
import subprocess
import sys

import pytest

from reporting.metrics import format_quantity
from reporting.progress import ProgressDisplay
from reporting.provenance import PROJECT_ROOT
from reporting.terminal import one_line, prepare_streams, print_error


@pytest.fixture(name="written")
def fixture_written(monkeypatch):
    """Return a function that gives the bytes of a text printed in an encoding."""

    def write(text, encoding):
        raw = io.BytesIO()
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding=encoding))
        prepare_streams()
        sys.stdout.write(text)
        sys.stdout.flush()
        return raw.getvalue()

    return write


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        (format_quantity(43.2e-6, "m"), b"43.2 um"),
        (format_quantity(1.5, "Nm"), b"1.5 N m"),
        (format_quantity(2.5e-12, "m/s"), b"2.50*10^-6 um/s"),
        (format_quantity(2.5e18, "1"), b"2.50*10^18"),
        (format_quantity(float("nan"), "m"), b"-"),
        ("≤ 1 \u2013 2 … é Ω 日", b"<= 1 - 2 ... e ? ?"),
    ],
)
def test_plain_characters(written, text, plain):
    assert written(text, "ascii") == plain
    assert written(text, "utf-8") == text.encode("utf-8")


def test_names_of_files_keep_their_bytes(written):
    name = os.fsdecode(b"out\xff/x\xe9.h5")
    assert written(name, "utf-8") == b"out\xff/x\xe9.h5"
    assert written(name, "ascii") == b"out\xff/x\xe9.h5"


def test_errors_are_one_line_that_moves_no_cursor(capsys):
    print_error("a\n b\x1b[2J \x07 µ \udcff")
    assert capsys.readouterr().err == "a b\\x1b[2J \\x07 µ \\udcff\n"
    assert one_line(" x \r\n\t y ") == "x y"


@pytest.mark.slow
def test_the_whole_command_line_on_an_ascii_terminal():
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "LC_ALL": "C", "COLUMNS": "60"}
    for arguments, status in ((["list"], 0), (["run", "µ…\udcff"], 2)):
        result = subprocess.run(
            [sys.executable, "-m", "experiments", *arguments],
            cwd=PROJECT_ROOT,
            env=environment,
            capture_output=True,
        )
        assert result.returncode == status, result.stderr
        result.stdout.decode("ascii")
        assert result.stderr.decode("ascii").count("\n") == (status == 2)


def test_progress_on_an_ascii_terminal():
    from rich.console import Console

    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii", errors="strict", write_through=True)
    console = Console(file=stream, force_terminal=True, width=80)
    with ProgressDisplay(console, "my_run", 1.0) as progress:
        progress(0.5, "simulating")
    assert b"simulating" in raw.getvalue()
