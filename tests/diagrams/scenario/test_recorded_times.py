"""Recorded inputs act at the same times with any sampling time."""

import numpy as np
import pytest

from diagrams.scenario.recorded_times import sampling_instants, time_column, time_text
from pfsc_drake.errors import InputError


@pytest.mark.parametrize("period", [1e-3, 2e-3, 1.0 / 3000.0, 7e-4])
def test_what_is_written_is_the_same_sampling_instant(period):
    ticks = np.array([0, 1, 3, 415, 1999, 123457])
    times = np.array([float(time_text(int(tick), period)) for tick in ticks])
    np.testing.assert_allclose(times, ticks * period, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(sampling_instants("file", "time", times, period), ticks)


def test_an_input_comes_no_earlier_than_it_was_made():
    times = np.array([0.0, 0.350, 0.351, 0.3521])
    assert sampling_instants("file", "time", times, 2e-3).tolist() == [0, 175, 176, 177]
    assert sampling_instants("file", "time", times, 5e-4).tolist() == [0, 700, 702, 705]


def test_older_files_count_sampling_intervals():
    assert time_column(["tick", "kind"]) == "tick"
    assert time_column(["time", "kind"]) == time_column(["kind"]) == "time"
    assert sampling_instants("file", "tick", np.array([0.0, 7.0]), 2e-3).tolist() == [0, 7]


@pytest.mark.parametrize(
    ("column", "times", "what"),
    [
        ("time", [-0.1, 0.0], "negative"),
        ("time", [0.2, 0.1], "not decrease"),
        ("tick", [0.0, 1.5], "whole numbers"),
    ],
)
def test_times_that_cannot_be_are_refused(column, times, what):
    with pytest.raises(InputError, match=f"^file: column '{column}' must .*{what}"):
        sampling_instants("file", column, np.array(times), 1e-3)
