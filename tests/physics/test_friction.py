"""The law of friction by itself."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pfsc_drake.errors import InputError
from pfsc_drake.physics.friction import BristleFriction, FrictionDrift, bristles_for_step

LAW = BristleFriction([4.0], [0.5], [2e-5], [2e-3])
deflections = st.floats(-1.0, 1.0)
velocities = st.floats(-10.0, 10.0)


@given(s=deflections, v=velocities)
def test_passive(s, v):
    """``tau_f v`` is never less than what the bristles store."""
    s, v = np.array([s]), np.array([v])
    stored = LAW.coulomb * LAW.presliding * s * LAW.rate(s, v)
    assert LAW.torque(s, v) * v - stored >= -1e-12


@given(s=deflections, v=velocities)
def test_coulombs_law_on_the_slip_velocity(s, v):
    """The set-valued law, and the bristles as spring and damper of the same force."""
    s, v = np.array([s]), np.array([v])
    dry = LAW.torque(s, v) - LAW.viscous * v
    rate = LAW.rate(s, v)
    slip = (v - LAW.presliding * rate)[0]
    assert abs(dry[0]) <= 4.0 + 1e-12
    if abs(slip) > 1e-9:
        assert np.isclose(dry[0], 4.0 * np.sign(slip), rtol=0, atol=1e-9)
    bristle = LAW.coulomb * (s + LAW.relaxation * rate)
    assert np.allclose(bristle, dry, rtol=0, atol=1e-9)


@given(s=st.sampled_from([-1.0, 1.0]), v=velocities)
def test_deflection_stays_within_its_range(s, v):
    assert s * LAW.rate(np.array([s]), np.array([v]))[0] <= 0.0


@given(v=st.floats(1e-9, 10.0))
def test_sliding_is_the_static_model(v):
    """(2.34) at every velocity once the bristles are bent, and a fixed point."""
    s, v = np.ones(1), np.array([v])
    assert np.array_equal(LAW.torque(s, v), 4.0 + 0.5 * v)
    assert np.array_equal(LAW.rate(s, v), [0.0])
    assert np.array_equal(LAW.torque(-s, -v), -4.0 - 0.5 * v)


def test_stuck_bristles_follow_the_joint():
    s, v = np.array([0.3]), np.array([1e-3])
    assert np.allclose(LAW.rate(s, v), v / LAW.presliding, rtol=1e-12)
    assert np.allclose(LAW.stiffness, 4.0 / 2e-5)


def test_joint_without_dry_friction():
    law = bristles_for_step([0.0], [0.7], [0.06], 1e-3)
    assert np.array_equal(law.torque(np.ones(1), np.array([2.0])), [1.4])
    assert np.array_equal(law.deflection([3.0]), [0.0])
    assert law.presliding[0] == 1e-6


def test_deflection_holds_a_load():
    s = LAW.deflection([3.0])
    assert np.allclose(LAW.torque(s, np.zeros(1)), 3.0, rtol=1e-15)
    assert np.array_equal(LAW.deflection([-9.0]), [-1.0])


def test_bristles_for_a_step():
    """Eigenvalues of the stuck inertia: frequency omega h = 1, critically damped."""
    J, h = 0.06, 1e-3
    law = bristles_for_step([3.746], [0.0], [J], h)
    A = np.array([[0.0, 1.0], [-law.stiffness[0] / J, -law.stiffness[0] * law.relaxation[0] / J]])
    assert np.allclose(np.linalg.eigvals(A), -1.0 / h, rtol=1e-6)
    assert np.isclose(law.presliding[0], 3.746e-6 / J, rtol=1e-12)
    slow = bristles_for_step([3.746], [0.0], [J], h, frequency=0.5)
    assert np.isclose(slow.presliding[0], 4.0 * law.presliding[0], rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"coulomb": [-1.0]}, r"coulomb = \[-1.0\]; must be finite and not negative"),
        ({"viscous": [np.nan]}, "viscous"),
        ({"viscous": [1.0, 2.0]}, r"viscous of shape \(2,\); must be \(1,\)"),
        ({"presliding": [0.0]}, "presliding = .* must be positive"),
        ({"relaxation": [np.inf]}, "relaxation"),
        ({"coulomb": []}, "coulomb of shape"),
    ],
)
def test_wrong_parameters(change, named):
    good = {"coulomb": [1.0], "viscous": [1.0], "presliding": [1e-5], "relaxation": [1e-3]}
    with pytest.raises(InputError, match=named) as error:
        BristleFriction(**{**good, **change})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"step": 0.0}, "step = 0.0; must be positive"),
        ({"inertia": [0.0]}, r"inertia = \[0.0\]"),
        ({"frequency": 2.0}, "frequency = 2.0; must be at most 1.5"),
        ({"damping": np.nan}, "damping"),
        ({"smallest": -1.0}, "smallest"),
    ],
)
def test_wrong_step(change, named):
    good = {"coulomb": [1.0], "viscous": [1.0], "inertia": [1.0], "step": 1e-3}
    with pytest.raises(InputError, match=named):
        bristles_for_step(**{**good, **change})


def test_drift_goes_evenly_from_one_to_the_factor():
    drift = FrictionDrift(1.3, 2.0, 6.0)
    scale = drift.scale(np.array([0.0, 2.0, 3.0, 6.0, 9.0]))
    np.testing.assert_allclose(scale, [1.0, 1.0, 1.075, 1.3, 1.3], rtol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ((0.0, 0.0, 1.0), "factor = 0"),
        ((np.nan, 0.0, 1.0), "factor = nan"),
        ((1.3, 2.0, 2.0), "begin = 2.0 s, end = 2.0 s"),
        ((1.3, -1.0, 2.0), "begin = -1.0; allowed: zero or a pos"),
    ],
)
def test_wrong_drifts_are_refused(arguments, part):
    with pytest.raises(InputError, match=part):
        FrictionDrift(*arguments)
