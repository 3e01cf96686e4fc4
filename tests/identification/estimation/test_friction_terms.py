"""Terms of friction against the formulas they stand for."""

import numpy as np
import pytest

from identification.estimation.friction_terms import FrictionTerm, FrictionTerms
from identification.estimation.least_squares import estimate
from pfsc_drake.errors import InputError

TERMS = {
    "stribeck": (0.3, lambda v: np.sign(v) * np.exp(-((v / 0.3) ** 2)), "Nm"),
    "offset": (None, np.ones_like, "Nm"),
    "slant": (None, np.abs, "Nm s/rad"),
    "saturation": (0.5, lambda v: np.tanh(v / 0.5), "Nm"),
    "quadratic": (None, lambda v: np.sign(v) * v**2, "Nm s^2/rad^2"),
}


@pytest.mark.parametrize("kind", TERMS)
def test_columns(kind):
    width, expected, unit = TERMS[kind]
    term = FrictionTerm(1, kind, width)
    v = np.random.default_rng(0).normal(size=(30, 3))
    columns = FrictionTerms((term,)).columns(v)
    assert columns.shape == (30, 3, 1)
    np.testing.assert_allclose(columns[:, 1, 0], expected(v[:, 1]))
    assert not columns[:, [0, 2]].any()
    assert term.unit("rad") == unit
    assert term.unit("m") == unit.replace("Nm", "N").replace("rad", "m")


def test_factors_are_estimated(comau, measure):
    """Different Coulomb friction up and down, in one joint, with its name and unit."""
    v = comau.motion[1][:, 2]
    extra = np.zeros_like(comau.motion[1])
    extra[:, 2] = np.where(v > 0.0, 4.0, 1.0) * np.sign(v)
    terms = FrictionTerms((FrictionTerm(2, "offset"),))
    result = estimate(comau.regressor, comau.base, measure(extra=extra, noise=1e-4), terms)
    found = dict(zip(result.short_names, result.base_parameters, strict=True))
    f_c = comau.parameters[comau.regressor.names.index("joint_3.f_c")]
    assert found["joint_3.f_o"] == pytest.approx(1.5, abs=1e-2)
    assert found["joint_3.f_c"] == pytest.approx(f_c + 2.5, abs=1e-2)
    assert result.units[-1] == "Nm"
    assert result.base.projection.shape == (53, 79)
    assert result.base.full_names[-1] == "joint_3.f_o"


def test_bad_terms(comau, measure):
    with pytest.raises(InputError, match="friction term 'static': must be one of stribeck, offset"):
        FrictionTerm(0, "static")
    with pytest.raises(InputError, match="stribeck: width = None; one is required"):
        FrictionTerm(0, "stribeck")
    with pytest.raises(InputError, match=r"offset: width = 1\.0; one is not allowed"):
        FrictionTerm(0, "offset", 1.0)
    with pytest.raises(InputError, match=r"width = 0\.0; must be positive"):
        FrictionTerm(0, "stribeck", 0.0)
    with pytest.raises(InputError, match=r"joint_1\.f_o appears 2 times"):
        FrictionTerms((FrictionTerm(0, "offset"), FrictionTerm(0, "offset")))
    with pytest.raises(InputError, match=r"joint_9\.f_o; the robot has the joints 1 to 6"):
        terms = FrictionTerms((FrictionTerm(8, "offset"),))
        estimate(comau.regressor, comau.base, measure(), terms)
