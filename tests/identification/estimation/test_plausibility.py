"""Estimates that no robot has, or that do not explain the torques, are refused in one line."""

import numpy as np
import pytest

from identification.estimation.friction import FrictionTerm, FrictionTerms
from identification.estimation.least_squares import estimate
from identification.estimation.plausibility import refuse_implausible
from pfsc_drake.errors import InputError


def found(comau, measured, friction=None, white=True):
    return estimate(comau.regressor, comau.base, measured, friction, white=white)


@pytest.mark.parametrize("seed", range(4))
def test_a_sound_estimate_passes(comau, measure, seed):
    refuse_implausible(found(comau, measure(seed)))
    refuse_implausible(found(comau, measure(seed, noise=10.0, colour=0.9), white=False))


@pytest.mark.parametrize(("name", "joint"), [("f_c", 6), ("f_v", 4), ("I_M", 5)])
def test_what_cannot_be_negative_is_refused(comau, measure, name, joint):
    index = comau.regressor.names.index(f"joint_{joint}.{name}")
    column = comau.regressor.matrix(*comau.motion)[..., index]
    extra = -3.0 * comau.parameters[index] * column
    with pytest.raises(InputError, match=rf"joint_{joint}\.{name} = -.* cannot be negative"):
        refuse_implausible(found(comau, measure(extra=extra)))


def test_a_little_below_zero_is_chance(comau, measure):
    """No friction at all, and noise: half of the estimates are below zero."""
    index = comau.regressor.names.index("joint_6.f_v")
    column = comau.regressor.matrix(*comau.motion)[..., index]
    below = 0
    for seed in range(6):
        estimated = found(comau, measure(seed, extra=-comau.parameters[index] * column))
        refuse_implausible(estimated)
        names = estimated.robot_base.short_names
        below += estimated.base_parameters[names.index("joint_6.f_v")] < 0.0
    assert 0 < below < 6


def test_friction_of_another_form_may_have_a_negative_part(comau, measure):
    """Friction that grows with the square of the velocity: Coulomb's alone is below zero."""
    v = comau.motion[1][:, 5]
    names = comau.regressor.names
    own = [names.index(f"joint_6.{name}") for name in ("f_c", "f_v")]
    extra = np.zeros((len(v), 6))
    extra[:, 5] = 3.0 * v * np.abs(v)
    extra -= comau.regressor.matrix(*comau.motion)[..., own] @ comau.parameters[own]
    measured = measure(extra=extra)
    with pytest.raises(InputError, match=r"joint_6\.f_c = -.*--validation"):
        refuse_implausible(found(comau, measured))
    term = FrictionTerms((FrictionTerm(5, "quadratic"),))
    refuse_implausible(found(comau, measured, term))
    driving = measure(extra=-2.0 * extra)
    with pytest.raises(InputError, match=r"friction of joint_6 against .* cannot be negative"):
        refuse_implausible(found(comau, driving, term))


def test_torques_that_the_model_does_not_explain(comau, measure):
    extra = np.zeros_like(comau.motion[0])
    extra[:, 1] = 300.0 * np.sin(7.0 * comau.motion[0][:, 1])
    with pytest.raises(InputError, match=r"tau of joint_2 is [\d.]+ times the noise .* gravity"):
        refuse_implausible(found(comau, measure(extra=extra)))
