"""Checks of all limits of a motion."""

import numpy as np
import pytest

from identification.excitation.criterion import information
from identification.excitation.fourier import FourierTrajectory, shipped_excitation
from identification.excitation.verification import verify_excitation
from pfsc_drake.errors import InputError


@pytest.fixture(scope="module")
def best():
    return FourierTrajectory.load(shipped_excitation(name="excitation_optimal"))


def test_shipped_excitation_keeps_all_and_beats_the_printed_one(comau, regressor, base, best):
    assert information(regressor, base, best).log_determinant >= 679.0
    verification = verify_excitation(comau, best)
    assert verification.keeps_all
    assert verification.clearance.guaranteed > 0.0
    assert verification.margins["height of the flange"] >= 0.0


def test_shipped_excitation_between_samples(comau, comau_scene, comau_cell, best):
    t = np.random.default_rng(4).uniform(0.0, best.period, 400)
    q, v, a = best.motion(t)
    assert np.all((q >= comau.position_limits[:, 0]) & (q <= comau.position_limits[:, 1]))
    assert np.all(np.abs(v) <= comau.velocity_limit)
    assert np.all(np.abs(a) <= comau.acceleration_limit)
    assert comau_scene.clearance(q).least >= comau_cell.clearance


def test_printed_excitation_dips_too_low(comau, printed):
    verification = verify_excitation(comau, printed)
    assert not verification.keeps_all
    assert 0.2 + verification.margins["height of the flange"] == pytest.approx(-0.18, abs=0.01)
    assert any("floor" in problem for problem in verification.problems)
    for key in ("position", "velocity", "acceleration", "effort"):
        assert np.all(verification.shares[key] < 1.0)


def test_too_fast(comau, best):
    # the same way in less time
    faster = FourierTrajectory(
        best.q_0, best.a * 1.2, best.b * 1.2, best.period / 1.2, best.harmonics
    )
    problems = verify_excitation(comau, faster).problems
    assert any(problem.startswith("acceleration of joint_1") for problem in problems)
    assert not any("position" in problem or "distance" in problem for problem in problems)


def test_refuses(arm, best):
    with pytest.raises(InputError, match="of 6 joints; comau_racer_1_4_3r has 3"):
        verify_excitation(arm, best)
