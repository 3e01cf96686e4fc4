"""Checks of all limits of a motion."""

import numpy as np
import pytest

from identification.excitation.fourier import FourierTrajectory, shipped_excitation
from identification.excitation.limits import chosen_limits
from identification.excitation.problem import believed_parameters
from identification.excitation.verification import verify


@pytest.fixture(scope="module")
def check(comau, regressor, comau_cell, comau_scene):
    def check(motion):
        believed, limits = believed_parameters(comau), chosen_limits(comau)
        return verify(regressor, believed, limits, motion, comau_cell, comau_scene)

    return check


def test_printed_excitation_dips_too_low(check, printed):
    verification = check(printed)
    assert not verification.keeps_all
    assert 0.2 + verification.margins["height of the flange"] == pytest.approx(-0.18, abs=0.01)
    assert any("floor" in problem for problem in verification.problems)
    for key in ("position", "velocity", "acceleration", "effort"):
        assert np.all(verification.shares[key] < 1.0)


def test_too_fast(check):
    best = FourierTrajectory.load(shipped_excitation(name="excitation_optimal"))
    faster = FourierTrajectory(
        best.q_0, best.a * 1.2, best.b * 1.2, best.period / 1.2, best.harmonics
    )  # the same way in less time
    verification = check(faster)
    assert verification.clearance.least > 0.0
    assert any(problem.startswith("acceleration of joint_1") for problem in verification.problems)
    assert not any("position" in problem for problem in verification.problems)


def test_shipped_excitation_keeps_all_and_beats_the_printed_one(check, regressor, base):
    from identification.excitation.criterion import information

    best = FourierTrajectory.load(shipped_excitation(name="excitation_optimal"))
    assert information(regressor, base, best).log_determinant >= 675.0
    verification = check(best)
    assert verification.problems == []
    assert verification.clearance.guaranteed > 0.0
    assert verification.margins["height of the flange"] >= 0.0
