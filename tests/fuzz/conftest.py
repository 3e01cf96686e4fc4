"""A watchdog: what hangs is told with its stack, after a time that no honest answer needs."""

import contextlib
import faulthandler
import signal
import warnings

import pytest

_SECONDS = 60


@pytest.fixture
def guarded():
    """Return a context in which warnings are errors and the time is bounded."""

    def late(*_):
        raise AssertionError(f"no answer after {_SECONDS} s")

    @contextlib.contextmanager
    def guard():
        before = signal.signal(signal.SIGALRM, late)
        signal.alarm(_SECONDS)
        # the alarm is heard in Python only
        faulthandler.dump_traceback_later(2 * _SECONDS, exit=True)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            signal.alarm(0)
            signal.signal(signal.SIGALRM, before)

    return guard
