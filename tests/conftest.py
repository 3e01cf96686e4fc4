"""How properties are tested: without looking at the clock, and longer by ``make fuzz``."""

import pytest
from hypothesis import HealthCheck, Phase, settings

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


@pytest.fixture
def examples(pytestconfig):
    """Return settings with a number of examples: in the suite a few, always the same."""
    if pytestconfig.getoption("--hypothesis-profile") == "fuzz":
        return lambda _: settings()
    return lambda count: settings(max_examples=count, derandomize=True)
