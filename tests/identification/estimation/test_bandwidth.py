"""The bandwidth against motions whose highest frequency is known."""

import numpy as np
import pytest

from identification.estimation.least_squares import estimate
from identification.estimation.residuals import choose_bandwidth
from identification.estimation.validation import compare_with_truth
from identification.measurement.periods import average
from identification.measurement.record import Record
from pfsc_drake.errors import InputError

_RATE, _PERIODS = 100.0, 4


@pytest.fixture(scope="module")
def record_of(comau):
    """Return a function that records an excitation with ripple on it and noise."""

    def record(ripple, frequency=3.7, position_noise=0.0, seed=0):
        random = np.random.default_rng(seed)
        q, v, a = comau.motion
        w = 2.0 * np.pi * frequency
        t = np.arange(len(q))[:, None] / _RATE
        wave = w * t + np.arange(6)
        q, v, a = (
            base + ripple * w**k * np.sin(wave + 0.5 * np.pi * k)
            for k, base in enumerate((q, v, a))
        )
        tau = np.tile(comau.regressor.matrix(q, v, a) @ comau.parameters, (_PERIODS, 1))
        return Record(
            np.arange(_PERIODS * len(q)) / _RATE,
            np.tile(q, (_PERIODS, 1)) + position_noise * random.normal(size=tau.shape),
            tau + comau.noise * random.normal(size=tau.shape),
            tuple(comau.subject.joint_names),
            10.0,
        )

    return record


def test_motion_that_follows_its_excitation(comau, record_of):
    """20 harmonics do, as Sec. C.2 has it."""
    choice = choose_bandwidth(comau.regressor, comau.base, record_of(0.0), skip=0)
    assert choice.bandwidth_hz == pytest.approx(2.0)
    assert choice.candidates == pytest.approx((2.0, 4.0, 10.0, 20.0, 40.0))
    assert (choice.excess.p_value > 1e-4).all()


def test_motion_with_ripple(comau, record_of):
    """20 harmonics are not enough, parameters are biased; noise forbids many more."""
    record = record_of(0.003, position_noise=2e-4)
    reports = []
    choice = choose_bandwidth(
        comau.regressor, comau.base, record, skip=0, progress=lambda *args: reports.append(args)
    )
    assert choice.bandwidth_hz == pytest.approx(4.0)
    assert (choice.excess.p_value > 1e-4).all()
    assert not (choice.excesses[0].p_value > 1e-4).all()
    assert reports[0] == (0.0, "choosing the bandwidth")
    chosen, usual = (
        compare_with_truth(estimate(comau.regressor, comau.base, motion), comau.truth)
        for motion in (choice.motion, average(record, skip=0))
    )
    assert chosen.p_value > 1e-3
    assert usual.p_value < 1e-6


def test_record_without_period(comau, record_of):
    record = record_of(0.0)
    short = Record(record.t[:900], record.q[:900], record.tau[:900], record.joint_names, 10.0)
    with pytest.raises(InputError, match="whole periods"):
        choose_bandwidth(comau.regressor, comau.base, short, skip=0)
