"""Units of files."""

import numpy as np
import pytest

from identification.measurement.columns import si_unit, to_si
from pfsc_drake.errors import InputError


@pytest.mark.parametrize(
    ("signal", "joint", "unit", "factor"),
    [
        ("q", "rad", "deg", np.pi / 180),
        ("q", "m", "mm", 1e-3),
        ("v", "rad", "rpm", 2 * np.pi / 60),
        ("a", "rad", "deg/s^2", np.pi / 180),
        ("tau", "rad", "kNm", 1e3),
        ("tau", "m", "N", 1.0),
        ("t", "rad", "ms", 1e-3),
    ],
)
def test_factors(signal, joint, unit, factor):
    assert to_si(signal, joint, unit, None, "here") == pytest.approx(factor, rel=1e-15)


def test_units_of_records():
    assert [si_unit(s, "m") for s in ("t", "q", "v", "a", "tau")] == ["s", "m", "m/s", "m/s^2", "N"]


def test_counts_need_a_scale():
    with pytest.raises(InputError, match=r"unit \[counts\]; allowed: rad.*rad per counts"):
        to_si("q", "rad", "counts", None, "here")
    assert to_si("q", "rad", "counts", 1e-4, "here") == 1e-4


def test_an_angle_is_no_length():
    with pytest.raises(InputError, match=r"unit \[deg\]; allowed: m, mm"):
        to_si("q", "m", "deg", None, "here")


def test_a_scale_contradicts_a_unit_that_says_what_it_is():
    with pytest.raises(InputError, match="scale is allowed only"):
        to_si("q", "rad", "deg", 2.0, "here")


@pytest.mark.parametrize("scale", [0.0, np.nan, np.inf])
def test_scales_are_numbers(scale):
    with pytest.raises(InputError, match="must be finite and not 0"):
        to_si("tau", "rad", "A", scale, "here")
