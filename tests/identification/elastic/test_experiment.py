"""Estimates of simulated elastic robots compared to their parameters."""

from dataclasses import replace

import numpy as np
import pytest

from identification.elastic.estimate import estimate_joints
from identification.elastic.experiment import simulate_excited, simulate_locked
from identification.excitation.fourier import FourierTrajectory
from identification.measurement.files import read_record, write_record
from identification.measurement.imperfections import Imperfections
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError

DAMPING = np.array([60.0, 60.0, 40.0, 6.0, 4.0, 2.0])
JUDGED = ("stiffness", "damping", "inertia")


@pytest.fixture(scope="module")
def arm():
    """The Comau with the elastic joints of its parameters, and damping."""
    subject = load_subject("comau_racer_1_4_elastic", tool=True)
    links = zip(subject.chain.links, DAMPING, strict=True)
    damped = tuple(replace(link, damping=float(d)) for link, d in links)
    return replace(subject, chain=replace(subject.chain, links=damped))


@pytest.fixture(scope="module")
def faults():
    """Noise of Tab. C.4, encoders of 65,536 increments per revolution of the motors."""
    increments = 65_536 * np.array([90.0, 90.0, 60.0, 50.0, 50.0, 35.0])
    noise = np.array([12.6, 11.6, 6.22, 0.71, 0.5, 0.28])
    return Imperfections(noise, increments, position_noise=2e-6)


def excitation(arm):
    lower, upper = arm.position_limits.T
    rng = np.random.default_rng(0)
    a, b = rng.uniform(0.2, 0.5, (2, 6, 2)) * np.minimum(arm.velocity_limit, 2.0)[:, None] / 2.0
    return FourierTrajectory(0.5 * (lower + upper), a, b, 3.0, (1, 2))


@pytest.fixture(scope="module")
def moving(arm, faults):
    return simulate_excited(arm, excitation(arm), faults, periods=2, seed=1)


def errors(arm, estimates):
    """Return errors of all joints in standard deviations, and relative to the values."""
    true = {"stiffness": arm.chain.K_s, "damping": DAMPING, "inertia": arm.chain.D_M}
    found = [[e.value(name) - true[name][j] for name in JUDGED] for j, e in enumerate(estimates)]
    deviations = [[e.deviation(name) for name in JUDGED] for e in estimates]
    return np.array(found) / deviations, np.array(found) / np.transpose([true[k] for k in JUDGED])


@pytest.mark.slow
def test_all_joints_from_one_motion(arm, moving):
    sure, relative = errors(arm, estimate_joints(moving, arm))
    assert np.abs(sure).max() < 4.0
    # chi-squared with 18 degrees of freedom, of deviations that are estimates themselves
    assert 4.0 < np.sum(sure**2) < 50.0
    assert np.abs(relative[:, [0, 2]]).max() < 0.06


@pytest.mark.slow
def test_rotors_on_turning_links_count(arm, moving):
    """The motors' inertia and the joints' stiffness are biased without (2.62)."""
    best = errors(arm, estimate_joints(moving, arm))[0]
    plain = errors(arm, estimate_joints(moving, arm, coupling=False))[0]
    assert np.sum(plain**2) > np.sum(best**2)
    residuals = [
        [e.residual for e in estimate_joints(moving, arm, coupling=c)] for c in (True, False)
    ]
    assert residuals[1][5] > 1.05 * residuals[0][5]


@pytest.mark.slow
def test_locked_links(arm, faults):
    record = simulate_locked(arm, faults, duration=5.0, seed=2)
    sure, relative = errors(arm, estimate_joints(record, arm, locked=True, viscous=arm.viscous))
    assert np.abs(sure).max() < 5.0
    assert np.abs(relative[:, [0, 2]]).max() < 0.02


@pytest.mark.slow
def test_through_a_file(arm, moving, tmp_path):
    write_record(tmp_path / "moving.csv", moving, arm)
    again = read_record(tmp_path / "moving.csv", arm)
    for first, second in zip(
        estimate_joints(moving, arm), estimate_joints(again, arm), strict=True
    ):
        np.testing.assert_allclose(first.values, second.values, rtol=1e-3, atol=1e-3)


def test_locked_links_through_a_file(arm, faults, tmp_path):
    """Without any noise of the links, which stand still."""
    record = simulate_locked(arm, faults, duration=2.0)
    record = replace(record, q=np.zeros_like(record.q))
    path = tmp_path / "locked.h5"
    write_record(path, record, arm)
    with pytest.raises(InputError, match="q of all joints is constant"):
        read_record(path, arm)
    again = read_record(path, arm, still=True)
    options = {"locked": True, "viscous": arm.viscous}
    for first, second in zip(
        estimate_joints(record, arm, **options), estimate_joints(again, arm, **options), strict=True
    ):
        np.testing.assert_allclose(first.values, second.values, rtol=1e-12)


def refused(message, function, *arguments, **options):
    with pytest.raises(InputError, match=message):
        function(*arguments, **options)


@pytest.mark.slow
def test_bad_records(arm, moving):
    refused("no q_motor; positions of motors", estimate_joints, replace(moving, q_motor=None), arm)
    other = replace(moving, joint_names=tuple("abcdef"))
    refused("joints a, b, c, d, e, f; must be those of comau", estimate_joints, other, arm)
    gear = replace(moving, q_motor=moving.q_motor * arm.gear_ratio)
    refused("q_motor of motor_1 moves by .* times q; must be 1", estimate_joints, gear, arm)
    late = replace(moving, q=np.roll(moving.q, 3, axis=0))
    refused("viscous = -.*signals at other instants", estimate_joints, late, arm)
    short = {"locked": True, "viscous": np.zeros(2)}
    refused(r"viscous: shape \(2,\); must be \(6,\)", estimate_joints, moving, arm, **short)
    refused(
        "locked joint must stand still",
        estimate_joints,
        moving,
        arm,
        locked=True,
        viscous=arm.viscous,
    )


def test_bad_experiments(arm, faults):
    rigid = load_subject("comau_racer_1_4")
    refused("joints that are not elastic", simulate_locked, rigid, faults)
    refused("friction is not known", simulate_locked, replace(arm, viscous=None), faults)
    refused("rms = .* must be positive", simulate_locked, arm, faults, share=0.0)
    refused(
        "needs .* at motor_.; must stay within the drive's",
        simulate_locked,
        arm,
        faults,
        duration=1.0,
        share=0.6,
    )
    refused("at least 12 are required", simulate_locked, arm, faults, duration=0.1)
    two = FourierTrajectory(np.zeros(2), np.ones((2, 1)), np.ones((2, 1)), 2.0, (1,))
    refused("of 2 joints", simulate_excited, arm, two, faults)
    weak = replace(arm, effort_limit=np.full(6, 20.0))
    brief = {"periods": 1}
    refused("needs .* at motor_.", simulate_excited, weak, excitation(arm), faults, **brief)
