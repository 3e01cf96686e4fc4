"""Ctrl-C: noticed, raised, or the end of the process, in their places."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from reporting.processes import noticed_interruption, raised_interruption
from reporting.provenance import PROJECT_ROOT


def press():
    """Ctrl-C, as this process gets it."""
    os.kill(os.getpid(), signal.SIGINT)


def test_the_first_is_noticed_and_the_second_raised():
    before = signal.getsignal(signal.SIGINT)
    with noticed_interruption() as interrupted:
        assert not interrupted()
        press()
        assert interrupted()
        with pytest.raises(KeyboardInterrupt):
            press()
    assert signal.getsignal(signal.SIGINT) is before


def test_one_that_a_library_swallows_is_raised_later():
    with raised_interruption():
        with pytest.raises(KeyboardInterrupt):
            press()
        with pytest.raises(KeyboardInterrupt), noticed_interruption():
            pass
        with pytest.raises(KeyboardInterrupt):
            press()
    with raised_interruption(), noticed_interruption() as interrupted:
        assert not interrupted()


def test_jobs_in_the_background_go_on_ignoring_it():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with raised_interruption(), noticed_interruption() as interrupted:
            press()
            assert not interrupted()
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_have_no_signals():
    seen = []

    def work():
        with raised_interruption(), noticed_interruption() as interrupted:
            seen.append(interrupted())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [False]


@pytest.mark.parametrize("library", ["numpy", "pydrake.all", "experiments.simulated_run"])
def test_imports_end_with_one_line(library):
    """Whatever a library would make of the exception while it is being imported."""
    code = (
        "from reporting.processes import leave_when_interrupted; leave_when_interrupted();"
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
