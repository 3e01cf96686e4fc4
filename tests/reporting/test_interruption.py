"""Ctrl-C: noticed, raised, or the end of the process, in their places."""

import os
import pty
import signal
import subprocess
import sys
import threading

import pytest

from reporting.interruption import raise_on_interruption, watch_interruption
from reporting.provenance import PROJECT_ROOT

_ENDING = (signal.SIGHUP, signal.SIGTERM)


@pytest.fixture(autouse=True)
def obeyed():
    """Signals as in a terminal, also where the suite runs in the background of one."""
    handlers = {number: signal.signal(number, signal.SIG_DFL) for number in _ENDING}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


def press():
    """Ctrl-C, as this process gets it."""
    os.kill(os.getpid(), signal.SIGINT)


def test_the_first_is_noticed_and_the_second_raised():
    before = signal.getsignal(signal.SIGINT)
    with watch_interruption() as interrupted:
        assert not interrupted()
        press()
        assert interrupted()
        with pytest.raises(KeyboardInterrupt):
            press()
    assert signal.getsignal(signal.SIGINT) is before


def test_one_that_a_library_swallows_is_raised_later():
    with raise_on_interruption():
        with pytest.raises(KeyboardInterrupt):
            press()
        with pytest.raises(KeyboardInterrupt), watch_interruption():
            pass
        with pytest.raises(KeyboardInterrupt):
            press()
    with raise_on_interruption(), watch_interruption() as interrupted:
        assert not interrupted()


def test_jobs_in_the_background_go_on_ignoring_it():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with raise_on_interruption(), watch_interruption() as interrupted:
            press()
            assert not interrupted()
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_have_no_signals():
    results = []

    def work():
        with raise_on_interruption(), watch_interruption() as interrupted:
            results.append(interrupted())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert results == [False]


@pytest.mark.parametrize("library", ["numpy", "pydrake.all", "experiments.simulated_run"])
def test_imports_end_with_one_line(library):
    """Whatever a library would make of the exception while it is being imported."""
    code = (
        "from reporting.interruption import leave_when_interrupted; leave_when_interrupted();"
        "import builtins, os, signal; original = builtins.__import__\n"
        "def interrupted(*arguments):\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    return original(*arguments)\n"
        f"builtins.__import__ = interrupted\nimport {library}\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=PROJECT_ROOT, capture_output=True, text=True
    )
    assert (result.returncode, result.stderr) == (130, "interrupted\n")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_requests_to_end_are_noticed_and_handed_on_at_the_end(number):
    received = []
    with raise_on_interruption():
        with watch_interruption() as interrupted:
            signal.raise_signal(number)
            signal.raise_signal(number)  # as `timeout` and terminals do
            assert interrupted()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
    # one that the program handles itself is its own business, and one that it does not ends it
    before = signal.signal(number, lambda *_: received.append(number))
    with watch_interruption() as interrupted:
        signal.raise_signal(number)
        assert interrupted()
    signal.raise_signal(number)
    signal.signal(number, before)
    assert received == [number]


def test_a_script_ends_after_what_it_saves():
    code = (
        "import signal\nfrom reporting.interruption import watch_interruption\n"
        "with watch_interruption() as interrupted:\n"
        "    signal.raise_signal(signal.SIGTERM)\n    print('saved', interrupted(), flush=True)\n"
        "print('next')"
    )
    result = in_a_process(code)
    assert (result.returncode, result.stdout) == (-signal.SIGTERM, "saved True\n")


@pytest.mark.parametrize("ignored", ["SIGHUP", "SIGINT", "SIGTERM"])
def test_what_is_ignored_at_the_beginning_stays_ignored_and_the_others_count(ignored):
    other = "SIGTERM" if ignored != "SIGTERM" else "SIGHUP"
    code = (
        f"import signal\nsignal.signal(signal.{ignored}, signal.SIG_IGN)\n"
        "from reporting.interruption import *\nleave_when_interrupted()\n"
        f"signal.raise_signal(signal.{ignored})\n"
        "with raise_on_interruption(), watch_interruption() as interrupted:\n"
        f"    signal.raise_signal(signal.{ignored})\n    print(interrupted())\n"
        f"    signal.raise_signal(signal.{other})\n    print(interrupted(), flush=True)\n"
        f"signal.raise_signal(signal.{other})\n"
    )
    result = in_a_process(code)
    assert (result.returncode, result.stdout) == (130, "False\nTrue\n")
    assert result.stderr == "interrupted\n"


def test_a_terminal_that_has_closed_is_written_to_no_more(tmp_path):
    code = (
        "import pathlib, sys, time\nfrom reporting.interruption import watch_interruption\n"
        "with watch_interruption() as interrupted:\n    print('ready', flush=True)\n"
        "    while not interrupted():\n        time.sleep(0.01)\n"
        "    print('to nobody', flush=True)\n    pathlib.Path(sys.argv[1]).write_text('saved')\n"
    )
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(PROJECT_ROOT)
        os.execv(sys.executable, [sys.executable, "-c", code, str(tmp_path / "saved")])
    assert b"ready" in os.read(terminal, 100)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGHUP
    assert (tmp_path / "saved").read_text() == "saved"


def in_a_process(code):
    """Return what came of a script."""
    return subprocess.run(
        [sys.executable, "-c", code], cwd=PROJECT_ROOT, capture_output=True, text=True, timeout=60
    )
