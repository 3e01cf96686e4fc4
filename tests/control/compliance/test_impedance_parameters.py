"""Damping over a path (5.4), and the impedance that has it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pfsc_drake.control.compliance.impedance import DAMPING
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
    SlowEnds,
)
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.errors import InputError
from tests.control.compliance.impedance_on_numbers import ImpedanceOnNumbers

LENGTH, LEAST, MOST = 1.1, 90.0, 3000.0  # m, N s/m; Tab. 5.5
MASS, STIFFNESS, PERIOD = 3.0, 1.0, 1e-3


def damping(length=LENGTH, **changes):
    return SlowEnds(LEAST, MOST, length=length, **changes).interpolant()


@given(eta=st.floats(-0.1, LENGTH + 0.1))
def test_it_is_5_4_as_printed(eta):
    """Hyperbolic tangents as ``1 - 2 / (exp(2 x) + 1)``, as numpy's exponential has it."""
    start, end = (1.0 - 2.0 / (np.exp(2.0 * x) + 1.0) for x in (40.0 * eta, 80.0 * (eta - LENGTH)))
    expected = LEAST + (MOST - LEAST) * (3.0 - 2.0 * start + end)
    assert damping()(eta) == pytest.approx(expected, rel=1e-9)


def test_it_starts_with_more_than_the_largest_value():
    assert damping()(0.0) == pytest.approx(2.0 * MOST - LEAST, rel=1e-12)
    assert damping()(LENGTH / 2.0) == pytest.approx(LEAST, rel=1e-12)
    assert damping()(LENGTH) == pytest.approx(MOST, rel=1e-12)


@given(eta=st.floats(-10.0, 10.0), length=st.floats(1e-3, 5.0))
def test_it_is_positive_wherever_the_tool_is(eta, length):
    assert damping(length)(eta) >= LEAST * (1.0 - 1e-12)


def law(length=LENGTH):
    tangential = CoordinateImpedance(Profile(MASS), SlowEnds(LEAST, MOST), Profile(STIFFNESS))
    along = Coordinate("eta", Kind.TANGENTIAL, "tau_par")
    parameters = ImpedanceParameters(tangential=tangential).on_path(length)
    return ImpedanceOnNumbers(parameters, [along], 1, PERIOD)


def test_the_length_is_that_of_the_path():
    assert law().impedance(np.array([LENGTH]))[DAMPING, 0] == pytest.approx(MOST)
    assert law(2.0).impedance(np.array([2.0]))[DAMPING, 0] == pytest.approx(MOST)
    explicit_length = ImpedanceParameters(
        tangential=CoordinateImpedance(Profile(MASS), SlowEnds(length=0.5), Profile(STIFFNESS))
    )
    assert explicit_length.on_path(LENGTH).tangential.damping.length == 0.5


def test_an_impedance_with_it_never_gives_energy_back():
    """Along the whole path and beyond its ends, pushed at random."""
    filtered, random = law(), np.random.default_rng(0)
    state, desired = filtered.start(np.array([[0.0], [0.0]])), np.zeros((3, 1))
    work, energies, visited = [0.0], [0.0], []
    force = np.zeros(1)
    for k in range(20_000):
        if k % 200 == 0:
            force = random.uniform(-20.0, 60.0, 1) * (1.0 if k < 15_000 else -1.0)
        before = state[0, 0]
        state, _ = filtered.update(state, desired, force, filtered.impedance(state[0]))
        work.append(work[-1] + float(force[0]) * (state[0, 0] - before))
        energies.append(0.5 * MASS * state[1, 0] ** 2 + 0.5 * STIFFNESS * state[0, 0] ** 2)
        visited.append(state[0, 0])
    lost = np.array(work) - np.array(energies)
    # force and damping are held over an interval, and the energy is that at its end
    assert np.diff(lost).min() > -1e-9
    assert min(visited) < 0.1
    assert max(visited) > LENGTH


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"least": -1.0}, "least = -1"),
        ({"most": 80.0}, "most = 80.0; allowed: 90 or more"),
        ({"most": math.inf}, "most = inf"),
        ({"start_rate": 0.0}, "start_rate = 0"),
        ({"end_rate": -1.0}, "end_rate = -1"),
        ({"length": math.nan}, "length = nan"),
    ],
)
def test_wrong_numbers_are_refused(changes, part):
    with pytest.raises(InputError, match=part):
        SlowEnds(**changes)


def test_it_needs_a_path_with_ends():
    with pytest.raises(InputError, match="closed"):
        SlowEnds(length=1.0).interpolant(revolution=1.0)
    with pytest.raises(InputError, match="length = 0"):
        SlowEnds().interpolant()
