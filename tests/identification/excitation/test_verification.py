"""Checks of all limits of a motion."""

import numpy as np
import pytest

from identification.excitation.criterion import information
from identification.excitation.fourier import FourierTrajectory, shipped_excitation
from identification.model.subject import load_subject


@pytest.fixture(scope="module")
def best():
    return FourierTrajectory.load(shipped_excitation(name="excitation_optimal"))


@pytest.mark.slow
def test_shipped_excitation_keeps_all_and_beats_the_printed_one(
    comau, regressor, base, best, verified
):
    # that of Tab. C.2 is 599.3
    assert information(regressor, base, best).log_determinant >= 680.0
    verification = verified(comau, best)
    assert verification.keeps_all
    assert verification.clearance.guaranteed > 0.0
    assert verification.margins["height of the flange"] >= 0.0


@pytest.mark.slow(but="festo_expt_45-limits0")
@pytest.mark.parametrize(
    ("name", "limits"), [("festo_expt_45", {"acceleration": 30.0}), ("franka_emika_panda", None)]
)
def test_other_shipped_excitations(name, limits, verified):
    subject = load_subject(name)
    motion = FourierTrajectory.load(shipped_excitation(name, "excitation_optimal"))
    assert verified(subject, motion, limits).problems == []


@pytest.mark.slow
def test_shipped_excitation_between_samples(comau, comau_scene, comau_cell, best):
    t = np.random.default_rng(4).uniform(0.0, best.period, 400)
    q, v, a = best.motion(t)
    assert np.all((q >= comau.position_limits[:, 0]) & (q <= comau.position_limits[:, 1]))
    assert np.all(np.abs(v) <= comau.velocity_limit)
    assert np.all(np.abs(a) <= comau.acceleration_limit)
    assert comau_scene.distances(q).min() >= comau_cell.clearance


@pytest.mark.slow
def test_printed_excitation_dips_too_low(comau, printed, verified):
    verification = verified(comau, printed)
    assert not verification.keeps_all
    assert 0.2 + verification.margins["height of the flange"] == pytest.approx(-0.18, abs=0.01)
    assert any("floor" in problem for problem in verification.problems)
    for key in ("position", "velocity", "acceleration", "effort"):
        assert np.all(verification.shares[key] < 1.0)


@pytest.mark.slow
def test_too_fast(comau, best, verified):
    # the same way in less time
    faster = FourierTrajectory(
        best.q_0, best.a * 1.2, best.b * 1.2, best.period / 1.2, best.harmonics
    )
    problems = verified(comau, faster).problems
    assert any(problem.startswith("acceleration of joint_1") for problem in problems)
    assert not any("position" in problem or "distance" in problem for problem in problems)
