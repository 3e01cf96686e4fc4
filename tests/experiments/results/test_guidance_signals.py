"""What a log tells of guidance."""

import numpy as np

from experiments.results.guidance_signals import region_times
from experiments.results.run_log import RunLog


def test_the_tool_meets_regions_as_they_were_a_lag_ago():
    """Of a clock that runs, waits and runs on; before the start it had not begun."""
    lag, time = 7e-3, 1e-3 * np.arange(200)
    clock = lag + np.clip(time, 0.0, 0.05) + np.clip(time - 0.1, 0.0, None)
    log = RunLog(time)
    log.add("region_clock", clock, "s")
    met = region_times(log, lag)
    np.testing.assert_allclose(met[:7], 0.0, atol=1e-12)
    np.testing.assert_allclose(met[7:], clock[:-7], atol=1e-12)
