"""Fourier series: derivatives, Tab. C.2, files."""

import numpy as np
import pytest

from identification.excitation.fourier import FourierTrajectory, shipped_excitation
from identification.excitation.limits import chosen_limits
from pfsc_drake.errors import InputError


def test_velocities_and_accelerations_are_derivatives(printed):
    t, h = np.linspace(0.0, 10.0, 37), 1e-5
    before, after, (_, v, a) = printed.motion(t - h), printed.motion(t + h), printed.motion(t)
    np.testing.assert_allclose((after[0] - before[0]) / (2.0 * h), v, atol=1e-8)
    np.testing.assert_allclose((after[1] - before[1]) / (2.0 * h), a, atol=1e-7)


def test_printed_coefficients_fill_the_limits_of_tab_c_1(comau, printed):
    limits = chosen_limits(comau)
    q, v, a = printed.motion(printed.sample_times(1000.0))
    assert np.abs((q - limits.middle) / limits.reach).max() == pytest.approx(0.83, abs=0.005)
    assert np.abs(v / limits.velocity).max() == pytest.approx(0.58, abs=0.005)
    assert np.abs(a / limits.acceleration).max() == pytest.approx(0.74, abs=0.005)


def test_first_printed_harmonics_by_hand(printed):
    # joint 1: 0.0332 - 0.3297 / w - -0.3291 / (3 w) - 0.4256 / (5 w) at t = 0
    w = 2.0 * np.pi / 10.0
    q, v, _ = printed.motion(np.zeros(1))
    by_hand = 0.0332 - 0.3297 / w + 0.3291 / (3 * w) - 0.4256 / (5 * w)
    assert q[0, 0] == pytest.approx(by_hand)
    assert v[0, 0] == pytest.approx(-0.1176 + 1.9736 + 0.2785)


def test_coefficients_and_back(printed):
    again = FourierTrajectory.from_coefficients(
        printed.coefficients, printed.period, printed.harmonics
    )
    np.testing.assert_array_equal(again.a, printed.a)
    np.testing.assert_array_equal(again.b, printed.b)
    assert printed.coefficients.size == 42


def test_file_and_back(printed, tmp_path):
    file = tmp_path / "motion.yaml"
    printed.save(file, "comau", "here", [f"joint_{i}" for i in range(6)], {"log_determinant": 1.0})
    again = FourierTrajectory.load(file)
    np.testing.assert_allclose(again.coefficients, printed.coefficients, atol=1e-9)
    assert (again.period, again.harmonics) == (10.0, (1, 3, 5))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"period": -1.0}, "period = -1.0 s; must be a positive number"),
        ({"harmonics": (1, 1)}, "harmonics"),
        ({"harmonics": (0, 1)}, "harmonics"),
        ({"harmonics": (1,)}, "M = 1 harmonics"),
        ({"q_0": [np.nan]}, "must be finite"),
    ],
)
def test_refuses(change, says):
    data = {"q_0": [0.0], "a": [[1.0, 2.0]], "b": [[0.0, 0.0]], "period": 1.0, "harmonics": (1, 2)}
    with pytest.raises(InputError, match=says):
        FourierTrajectory(**data | change)


def test_refuses_files(tmp_path):
    file = tmp_path / "motion.yaml"
    file.write_text("period: 1.0\nharmonics: [1]\nq_0: [0.0]\na: [[1.0]]\n")
    with pytest.raises(InputError, match=r"motion\.yaml.*b"):
        FourierTrajectory.load(file)
    with pytest.raises(InputError, match="'nothing' of 'comau_racer_1_4': allowed: excitation"):
        shipped_excitation(name="nothing")


def test_refuses_a_period_that_is_no_multiple_of_the_sampling_time(printed):
    with pytest.raises(InputError, match="must be a multiple of the sampling time"):
        printed.sample_times(333.33)
