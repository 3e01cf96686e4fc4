"""How properties are tested, without looking at the clock; what begins, and when is compiled."""

import gc
import signal

import pytest
from hypothesis import HealthCheck, Phase, settings

from pfsc_drake.compiled import bound_function
from pfsc_drake.compiled.native_code import native_code
from tests.deferred_code import DeferredCode

# in the background of a script Ctrl-C is ignored, here and in all processes that are started
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

_CALM = [HealthCheck.too_slow, HealthCheck.function_scoped_fixture, HealthCheck.data_too_large]

settings.register_profile("suite", deadline=None, suppress_health_check=_CALM)
settings.register_profile(
    "fuzz",
    deadline=None,
    max_examples=100,
    # what fails is small already, and to try it again takes seconds each time
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=_CALM,
    print_blob=True,
)
settings.load_profile("suite")

# millions of CasADi expressions are made, nearly all of them without cycles
gc.set_threshold(100_000, 20, 20)

# where machine code is the subject, or speed
_COMPILED_AT_ONCE = {"compiled", "benchmarks", "live"}


# long files, which are not to begin last: workers end together
_FIRST = ("tests/experiments/", "tests/identification/", "tests/diagrams/")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Begin with the folders of long files; keep what stands for slow ones in the quick tests."""
    items.sort(key=lambda item: not item.nodeid.startswith(_FIRST))
    chosen = any("::" in argument for argument in config.args)
    unmet = _keep_quick(items)
    if unmet and not chosen:
        raise pytest.UsageError("; ".join(f"{name} has no case {case}" for name, case in unmet))


def _keep_quick(items):
    """Take the mark from the cases that ``slow(but=..)`` leaves out; return those not found."""
    wanted, met = set(), set()
    for item in items:
        mark = item.get_closest_marker("slow")
        if mark is None or "but" not in mark.kwargs:
            continue
        name, cases = item.nodeid.partition("[")[0], mark.kwargs["but"]
        kept = {(name, case) for case in ([cases] if isinstance(cases, str) else cases)}
        wanted |= kept
        if (name, item.callspec.id) in kept:
            met.add((name, item.callspec.id))
            item.own_markers.remove(mark)
    return sorted(wanted - met)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """Compile what is evaluated often, and in some folders everything."""
    at_once = _COMPILED_AT_ONCE & {*item.nodeid.split("/")}
    bound_function.native_code = native_code if at_once else DeferredCode


@pytest.fixture
def examples(pytestconfig):
    """Return settings with a number of examples: in the suite a few, always the same."""
    if pytestconfig.getoption("--hypothesis-profile") == "fuzz":
        return lambda _: settings()
    return lambda count: settings(max_examples=count, derandomize=True)
