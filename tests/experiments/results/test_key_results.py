"""Key results of a run, and their order."""

import numpy as np
import pytest

from experiments.results.key_results import key_facts, key_metrics
from experiments.results.run_log import RunLog
from reporting.metrics import NARROW_SPACE, Metrics


def metrics_of(*rows):
    metrics = Metrics()
    for name, value, target in rows:
        metrics.add(name, value, target=target)
    return metrics


def test_missed_requirements_come_first_and_the_deviation_is_always_there():
    metrics = metrics_of(
        ("max_path_deviation", 1e-5, None),
        ("max_orientation_error", 1e-4, "< 1e-3"),
        ("peak_speed", 2.0, "< 1"),
        ("settling_time", np.nan, "< 1"),
        ("rms_path_deviation", 1e-6, None),
    )
    chosen = ["peak_speed", "settling_time", "max_orientation_error", "max_path_deviation"]
    assert key_metrics(metrics) == chosen
    metrics["max_path_deviation"].target = "< 1e-4"
    assert sorted(key_metrics(metrics)) == sorted(chosen)
    assert key_metrics(metrics_of(("saturated_samples", 0.0, None))) == []


def test_no_missed_requirement_is_left_out():
    rows = [(f"peak_torque_{i}", 1.0, "< 2") for i in range(1, 8)]
    met = metrics_of()
    for name, value, target in rows:
        met.add(name, value, "Nm", target)
    assert len(key_metrics(met)) == 5
    for metric in met.values():
        metric.value = 3.0
    assert len(key_metrics(met)) == 7


def test_without_a_path_the_deviation_is_the_depth_in_a_region():
    assert key_metrics(metrics_of(("deepest_violation", 1e-5, None))) == ["deepest_violation"]


def test_a_run_that_ends_before_it_is_judged_has_its_last_deviation():
    rows = (("max_path_deviation", np.nan, None), ("static_path_deviation", 0.4, None))
    assert key_metrics(metrics_of(*rows)) == ["static_path_deviation"]


@pytest.mark.parametrize(
    ("samples", "share", "value"), [(0.0, 0.0, "none"), (45.0, 0.0451, f"4.5{NARROW_SPACE}%")]
)
def test_duration_and_saturation(samples, share, value):
    metrics = metrics_of(
        ("saturated_samples", samples, None),
        ("saturated_share", share, None),
        ("real_time_factor", 4.219, None),
    )
    log = RunLog(np.array([0.0, 4.03]))
    duration, saturation = key_facts(log, metrics, 4.03, simulated=True)
    assert duration.value == f"4.03{NARROW_SPACE}s"
    assert duration.note == "simulated at 4.2 times real time"
    assert saturation.value == value
    duration, _ = key_facts(log, metrics, 5.0, simulated=False)
    assert duration.note == f"of 5{NARROW_SPACE}s"


def test_a_run_without_samples_or_drives_has_a_duration():
    (duration,) = key_facts(RunLog(np.zeros(0)), Metrics(), 1.0, simulated=True)
    assert duration.value == f"0{NARROW_SPACE}s"
