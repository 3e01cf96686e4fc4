"""Share of a motion that is done, of references that wait and tools that lag."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagrams.scenario import Scenario
from experiments.results.arrival_feature import arrival_metrics
from experiments.results.requirements import leave_unjudged, missed_targets
from experiments.results.run_log import RunLog
from pfsc_drake.geometry import PiecewisePolynomialCurve

# there and back: 1.5 m in 3 s, and the same again; where it ends is where it began
MOTION = PiecewisePolynomialCurve([0.0, 3.0, 6.0], np.array([[[0.2], [0.5]], [[1.7], [-0.5]]]))


def arrival(end, *, lost=0.0, lag=0.0, judged_after=6.0, pace=1.0, **further):
    time = np.linspace(0.0, end, 61)
    own = np.clip(time - lost * time / end, 0.0, 6.0)
    eta_p = MOTION.derivatives(own, 0)[:, 0, 0]
    log = RunLog(time)
    log.add("eta_p", eta_p, "m")
    log.add("eta", eta_p - lag, "m")
    log.add("time_lost", lost * time / end, "s")
    log.add("waiting_pace", np.full(61, pace), "1")
    for name, values in further.items():
        log.add(name, values, "m")
    scenario = Scenario(judged_after=judged_after)
    return arrival_metrics(log, SimpleNamespace(motion=MOTION), scenario)


@pytest.mark.parametrize(
    ("end", "lost", "lag", "share"),
    [
        (6.0, 0.0, 0.0, 1.0),
        (7.0, 0.5, 2e-3, 1.0 - 2e-3 / 3.0),
        (6.0, 1.5, 0.0, 0.75),
        (6.0, 6.0, 0.0, 0.0),
        (6.0, 1.5, 0.3, 0.65),
        (2.0, 0.0, 0.0, 1.0 / 3.0),
    ],
)
def test_the_share_counts_what_the_reference_has_left_and_what_the_tool_lags(end, lost, lag, share):
    found = arrival(end, lost=lost, lag=lag)["arrived"]
    assert found.value == pytest.approx(share, abs=1e-6)
    # a run that was cut short is too short for it
    assert found.passed is (None if end < 6.0 else share > 1.0 - 5e-3 / 3.0)


def test_a_tool_that_waits_to_the_end_breaks_a_promise_and_the_line_says_why():
    found = arrival(6.0, lost=1.5, pace=0.0)
    (broken,) = missed_targets(found)
    assert broken.startswith("arrived = 0.75, target >= 0.998")
    assert broken.endswith("(the tool still waits for an obstacle)")
    leave_unjudged(found, fault=False)
    assert missed_targets(found) == []
    assert found["arrived"].verdict == "not judged"


def test_no_target_where_the_motion_lasts_longer_than_the_scenario():
    assert arrival(4.0, judged_after=4.0)["arrived"].passed is None


def test_compliance_along_the_path_does_not_count_as_a_lag():
    assert arrival(6.0, lag=0.3, eta_d=np.zeros(61))["arrived"].value == pytest.approx(1.0)


def test_streams_and_tools_without_a_reference_have_no_share():
    assert "arrived" not in arrival(6.0, way_left=np.ones(61))
