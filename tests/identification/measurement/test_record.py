"""Records of a moving robot, and checks of their validity."""

from dataclasses import replace

import numpy as np
import pytest

from identification.measurement.record import check_record
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


def refused(record, robot, message):
    with pytest.raises(InputError, match=message):
        check_record(record, robot)


def without(record, rows):
    keep = np.delete(np.arange(record.t.size), rows)
    return replace(record, t=record.t[keep], q=record.q[keep], tau=record.tau[keep])


def test_a_sound_record(record, robot):
    check_record(record, robot)
    check_record(replace(record, v=np.gradient(record.q, 0.005, axis=0)), robot)


def test_noise_is_no_fault(record, robot):
    noise = np.random.default_rng(1).normal(size=record.q.shape)
    check_record(replace(record, q=record.q + 1e-4 * noise, tau=record.tau + noise), robot)


def test_a_gap(record, robot):
    message = r"gap of 0.05 s in t after 1.245 s, about 9 samples \(1 gaps in all\)"
    refused(without(record, slice(250, 259)), robot, message)


def test_jitter(record, robot):
    t = record.t.copy()
    t[77] += 0.0017
    refused(replace(record, t=t), robot, "that at 0.3867 s is 0.0017 s off an even grid")


def test_times_rounded_by_a_file(record, robot):
    check_record(replace(record, t=np.round(record.t, 4)), robot)


def test_degrees(record, robot):
    q = record.q * [180.0 / np.pi, 1.0]
    refused(replace(record, q=q), robot, r"q of swing reaches 9\d.\d+ rad, 3\d.\d times.*\[deg\]")


def test_millimetres(record, robot):
    refused(replace(record, q=record.q * [1.0, 1e3]), robot, r"q of lift.* look like \[mm\]")


def test_other_zero(record, robot):
    refused(replace(record, q=record.q + np.array([3.0, 0.0])), robot, "sign, zero, unit or order")


def test_time_in_other_units(record, robot):
    refused(replace(record, t=record.t / 60.0), robot, "q changes by .*unit of q or t")


def test_velocities_beyond(record, robot, series):
    v = series.motion(record.t)[1] * 180.0 / np.pi
    refused(replace(record, v=v), robot, r"v is .* rad/s in swing, .* times its limit of 8")


def test_a_robot_that_stands_still(record, robot):
    refused(replace(record, q=0.0 * record.q + 1.0), robot, "q of all joints is constant")


def test_a_torque_that_was_not_measured(record, robot):
    refused(replace(record, tau=record.tau * [1.0, 0.0]), robot, "tau of lift is 0 N throughout")


def test_clipped_torques(record, robot):
    tau = np.clip(record.tau, [-40.0, -500.0], [35.0, 500.0])
    refused(replace(record, tau=tau), robot, "tau of swing is clipped at 35 Nm: constant for")


def test_torques_rounded_to_steps_are_not_clipped(record, robot):
    for resolution in (0.1, 1.0, 7.0, 20.0):
        check_record(replace(record, tau=np.round(record.tau / resolution) * resolution), robot)


def test_torques_at_the_limit_of_the_drive(record, robot):
    noise = 0.05 * np.random.default_rng(2).normal(size=record.tau.shape)
    tau = np.clip(record.tau, [-200.0, -10.0], [200.0, 10.0]) + noise
    weak = replace(robot, effort_limit=np.array([200.0, 10.0]))
    refused(replace(record, tau=tau), weak, "tau of lift is at the drive's limit of 10 N in")


def test_torques_in_other_units(record, robot):
    refused(replace(record, tau=record.tau * 1e3), robot, "times its limit; .*another unit")


def test_another_robot(record, robot):
    other = replace(robot, joint_names=("lift", "swing"))
    refused(record, other, "joints swing, lift; must be those of crane: lift, swing")


def test_noise_that_is_clipped_with_the_torque(record, robot):
    noise = 2.0 * np.random.default_rng(4).normal(size=record.tau.shape)
    lowest = [record.tau[:, 0].min(), -500.0]
    clipped = np.clip(record.tau + noise, lowest, [200.0, 500.0])
    message = r"tau of swing is clipped at -.* Nm: there in \d+ samples, .*hardly ever just below"
    refused(replace(record, tau=clipped), robot, message)
    # rounded to steps that are finer or coarser than the noise it is not
    for resolution in (0.01, 0.5, 5.0):
        sound = np.round((record.tau + noise) / resolution) * resolution
        check_record(replace(record, tau=sound), robot)
