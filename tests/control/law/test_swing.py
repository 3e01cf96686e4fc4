"""References that swing, against finite differences and a closed form."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.swing import OscillatingManifold, OscillatingReference, Swing
from pfsc_drake.errors import InputError

SWING = Swing(coordinate=2, amplitude=0.02, frequency=0.5, begin=0.4, ramp=0.8)
# outputs: eta, xi_1, xi_2, and three angles
ROWS = {"first": 1, "transversal": 2, "outputs": 6, "order": 4}


def at(reference, time):
    return reference.at(time).full()


def test_derivatives_are_those_of_the_value():
    reference, h = OscillatingReference([SWING], **ROWS), 1e-5
    for time in (0.5, 0.9, 1.19, 1.3, 2.7):
        values = at(reference, time)
        differences = (at(reference, time + h) - at(reference, time - h))[:-1] / (2.0 * h)
        np.testing.assert_allclose(differences, values[1:], rtol=1e-6, atol=2e-6)
        assert not np.delete(values, 2, axis=1).any()


def test_it_is_a_sine_from_the_ramp_on():
    reference = OscillatingReference([SWING], **ROWS)
    omega, t = np.pi, 3.0
    angle = omega * (t - 0.4)
    expected = [0.02 * omega**k * np.sin(angle + k * np.pi / 2.0) for k in range(5)]
    np.testing.assert_allclose(at(reference, t)[:, 2], expected, rtol=1e-10)


def test_it_rests_before_and_begins_without_a_jump():
    reference = OscillatingReference([SWING], **ROWS)
    assert not at(reference, 0.4).any()
    assert np.abs(at(reference, 0.4 + 1e-7)).max() < 1e-6
    before, after = at(reference, 1.2 - 1e-7), at(reference, 1.2 + 1e-7)
    np.testing.assert_allclose(before, after, rtol=1e-3, atol=1e-6)


def test_swings_of_one_coordinate_add_up():
    one, both = OscillatingReference([SWING], **ROWS), OscillatingReference([SWING, SWING], **ROWS)
    np.testing.assert_allclose(at(both, 2.0), 2.0 * at(one, 2.0))


def test_a_reference_swings():
    """The oscillation is added at each sample, in the rows beside the plan."""
    swings, planned = OscillatingReference([SWING], **ROWS), np.arange(30.0)
    stepper = Stepper(OscillatingManifold(swings, 30, 1e-3))
    stepper.tick = 1700
    swung = stepper.step(desired_reference=planned)["reference"]
    np.testing.assert_allclose(swung - planned, at(swings, 1.7).ravel(), atol=1e-14)


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"coordinate": 3}, "coordinate = 3"),
        ({"amplitude": 0.0}, "amplitude = 0.0"),
        ({"frequency": -1.0}, "frequency"),
        ({"ramp": 0.0}, "ramp"),
        ({"begin": float("nan")}, "begin"),
    ],
)
def test_wrong_swings_are_refused(change, part):
    with pytest.raises(InputError, match=part):
        Swing(**change)


def test_a_coordinate_that_is_not_there_is_refused():
    with pytest.raises(InputError, match=r"swings\[0\]: coordinate = 2; there is 1"):
        OscillatingReference([SWING], first=2, transversal=1, outputs=6, order=2)
