"""Records refuse what is no record."""

from dataclasses import replace

import numpy as np
import pytest

from pfsc_drake.errors import InputError


def changed(array, index, value):
    array = array.copy()
    array[index] = value
    return array


def test_sampling_time_and_duration(record):
    assert record.sampling_time == pytest.approx(0.005, rel=1e-12)
    assert record.duration == pytest.approx(6.0, rel=1e-12)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_named_with_joint_and_time(record, value):
    with pytest.raises(InputError, match=r"tau of lift is (nan|inf) at t = 0.05 s \(1 such"):
        replace(record, tau=changed(record.tau, (10, 1), value))


def test_time_must_increase(record):
    with pytest.raises(InputError, match=r"t does not increase from sample 5 \(0.02 s\)"):
        replace(record, t=changed(record.t, 5, 0.02))


def test_nan_in_time(record):
    with pytest.raises(InputError, match="t is nan in sample 6"):
        replace(record, t=changed(record.t, 5, np.nan))


def test_all_signals_have_one_shape(record):
    with pytest.raises(InputError, match=r"v of shape \(1199, 2\); must be \(1200, 2\)"):
        replace(record, v=record.q[1:])


def test_too_few_samples(record):
    with pytest.raises(InputError, match="at least 10 samples"):
        replace(record, t=record.t[:3], q=record.q[:3], tau=record.tau[:3])


def test_period_must_be_positive(record):
    with pytest.raises(InputError, match="period = 0"):
        replace(record, period=0.0)
