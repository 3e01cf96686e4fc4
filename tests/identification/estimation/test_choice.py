"""The choice finds the friction that is there, and none where there is none."""

import numpy as np
import pytest

from identification.estimation.choice import choose_friction
from identification.estimation.least_squares import estimate
from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError


def stribeck(v):
    torque = np.zeros_like(v)
    torque[:, 1] = 30.0 * np.sign(v[:, 1]) * np.exp(-((v[:, 1] / 0.3) ** 2))
    return torque


def two_directions(v):
    torque = np.zeros_like(v)
    torque[:, 2] = 4.0
    torque[:, 3] = np.where(v[:, 3] > 0.0, 0.4, -0.4) * v[:, 3]
    return torque


def saturated(v):
    torque = np.zeros_like(v)
    torque[:, 0] = 60.0 * np.tanh(v[:, 0] / 0.8)
    return torque


@pytest.fixture(scope="module")
def data(comau, measure, other_trajectory):
    other = other_trajectory.motion(other_trajectory.sample_times(100.0))

    def of_friction(extra, seed=0, **options):
        return (
            measure(seed, extra=extra(comau.motion[1]), **options),
            measure(seed + 1000, motion=other, extra=extra(other[1]), **options),
        )

    return of_friction


@pytest.mark.slow
def test_plain_friction_stays_plain(comau, data):
    """In all of ten experiments."""
    for seed in range(10):
        choice = choose_friction(comau.regressor, comau.base, *data(np.zeros_like, seed))
        assert choice.model.terms == ()
        assert len(choice.judgements) == 5 * 6
        assert max(judged.significance for judged in choice.judgements) < choice.threshold


@pytest.mark.slow
def test_coloured_noise_is_no_friction(comau, data):
    for seed in range(6):
        motions = data(np.zeros_like, seed, colour=0.9)
        assert choose_friction(comau.regressor, comau.base, *motions).model.terms == ()


@pytest.mark.slow
def test_stribeck_is_found(comau, data):
    motion, other = data(stribeck)
    choice = choose_friction(comau.regressor, comau.base, motion, other)
    (term,) = choice.model.terms
    assert (term.joint, term.kind) == (1, "stribeck")
    assert term.width == pytest.approx(0.3, rel=0.2)
    result = estimate(comau.regressor, comau.base, motion, choice.model)
    size, deviation = result.base_parameters[-1], result.standard_deviation[-1]
    assert abs(size - 30.0) < 4.0 * deviation
    assert deviation < 4.0
    plain = estimate(comau.regressor, comau.base, motion)
    assert plain.variance_factor > result.variance_factor


@pytest.mark.slow
def test_friction_of_another_day(comau, measure, other_trajectory):
    """10 % more in all joints is no other form, and hides none."""
    other = other_trajectory.motion(other_trajectory.sample_times(100.0))
    more = 0.1 * comau.subject.coulomb * np.sign(other[1])
    for extra, kinds in ((np.zeros_like, []), (stribeck, ["stribeck"])):
        motion = measure(1, extra=extra(comau.motion[1]))
        judged_on = measure(2, motion=other, extra=extra(other[1]) + more)
        choice = choose_friction(comau.regressor, comau.base, motion, judged_on)
        assert [term.kind for term in choice.model.terms] == kinds


@pytest.mark.slow
def test_asymmetry_is_found(comau, data):
    choice = choose_friction(comau.regressor, comau.base, *data(two_directions))
    assert {(term.joint, term.kind) for term in choice.model.terms} == {(2, "offset"), (3, "slant")}
    chosen = [judged for judged in choice.judgements if judged.chosen]
    assert {judged.term for judged in chosen} == set(choice.model.terms)
    assert all(judged.improvement > 0.0 for judged in chosen)


def test_saturation_is_found(comau, data):
    choice = choose_friction(comau.regressor, comau.base, *data(saturated))
    assert [(term.joint, term.kind) for term in choice.model.terms] == [(0, "saturation")]


def test_only_requested_kinds(comau, data):
    choice = choose_friction(comau.regressor, comau.base, *data(stribeck), kinds=["offset"])
    assert choice.model.terms == ()


def test_bad_input(comau, data, measure):
    motion, other = data(np.zeros_like)
    with pytest.raises(InputError, match="friction term 'bumpy'"):
        choose_friction(comau.regressor, comau.base, motion, other, kinds=["bumpy"])
    with pytest.raises(InputError, match="no kind to choose from; allowed: stribeck"):
        choose_friction(comau.regressor, comau.base, motion, other, kinds=[])
    same = tuple(values[:, [1, 1, 1, 1, 1, 1]] for values in comau.motion)
    with pytest.raises(InputError, match="cannot be distinguished"):
        choose_friction(comau.regressor, comau.base, measure(motion=same), other)
    with pytest.raises(InputError, match="regressor without friction"):
        without_friction = Regressor(comau.subject, friction=False)
        choose_friction(without_friction, comau.base, motion, other)
    q, v, a = (values.copy() for values in comau.motion)
    q[:, 4], v[:, 4], a[:, 4] = 0.1, 0.0, 0.0
    with pytest.raises(InputError, match="joint_5 stands still in the other motion"):
        choose_friction(comau.regressor, comau.base, motion, measure(motion=(q, v, a)))
