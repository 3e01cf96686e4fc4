"""The compliant posture against its differential equation, integrated independently."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pfsc_drake.control.compliance.posture_impedance import (
    NullSpaceImpedance,
    NullSpaceImpedanceParameters,
)
from pfsc_drake.errors import InputError

PARAMETERS = NullSpaceImpedanceParameters(1.5, 12.0, 40.0, 70.0)
PERIOD = 1e-3


class Motion:
    """The derivatives of a posture by rows, advanced with numbers."""

    def __init__(self, impedance, q_start):
        self._impedance, self._motion = impedance, impedance.start(ca.DM(q_start))

    def advance(self, torque, goal):
        self._motion = self._impedance.update(self._motion, ca.DM(torque), ca.DM(goal))
        return self.rows

    @property
    def rows(self):
        return self._motion.full().reshape(self._impedance.relative_degree + 1, -1)


def pulse(t):
    return np.array([8.0, -3.0]) * (0.1 <= t < 0.3)


@pytest.mark.slow(but=["4", "1"])
@pytest.mark.parametrize("relative_degree", [1, 2, 3, 4])
def test_it_obeys_mass_damper_spring_behind_a_filter(relative_degree):
    impedance = NullSpaceImpedance(PARAMETERS, relative_degree, PERIOD)
    goal, q_start = np.array([0.3, -0.2]), np.array([0.1, 0.2])
    motion = Motion(impedance, q_start)
    for k in range(500):
        state = motion.advance(pulse(k * PERIOD + 1e-9), goal)

    def rates(t, x):
        # first-order lags one after the other, then the mass; lags start at the spring's rest
        x = x.reshape(-1, 2)
        lags, (q, v) = x[:-2], x[-2:]
        signal, slopes = pulse(t) + 40.0 * goal, []
        for lag in lags:
            slopes.append(70.0 * (signal - lag))
            signal = lag
        acceleration = (signal - 12.0 * v - 40.0 * q) / 1.5
        return np.concatenate([*slopes, v, acceleration])

    x = np.concatenate([np.tile(40.0 * q_start, relative_degree - 1), q_start, np.zeros(2)])
    for leg in ((0.0, 0.1), (0.1, 0.3 - 1e-12), (0.3, 0.5)):
        x = solve_ivp(rates, leg, x, rtol=1e-11, atol=1e-13).y[:, -1]
    assert np.allclose(state[0], x[-4:-2], rtol=0, atol=1e-9)
    assert np.allclose(state[1], x[-2:], rtol=0, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("relative_degree", [1, 2, 3, 4])
def test_every_row_is_the_rate_of_the_row_above(relative_degree):
    fine = 1e-5
    impedance = NullSpaceImpedance(PARAMETERS, relative_degree, fine)
    motion = Motion(impedance, [0.0, 0.0])
    states = [motion.advance([8.0, -3.0], [0.0, 0.0]) for _ in range(3000)]
    before, now, after = states[-3:]
    for k in range(relative_degree):
        rate = (after[k] - before[k]) / (2.0 * fine)
        assert np.allclose(rate, now[k + 1], rtol=1e-5)


@pytest.mark.slow
def test_a_constant_torque_bends_it_by_the_spring():
    impedance = NullSpaceImpedance(PARAMETERS, 4, PERIOD)
    motion = Motion(impedance, [0.5])
    for _ in range(6000):
        state = motion.advance([2.0], [0.5])
    assert state[0] == pytest.approx(0.5 + 2.0 / 40.0, abs=1e-9)
    assert np.abs(state[1:]).max() < 1e-6


@pytest.mark.slow
def test_without_a_spring_it_stays_where_it_is_left():
    impedance = NullSpaceImpedance(NullSpaceImpedanceParameters(1.0, 20.0, 0.0, 70.0), 4, PERIOD)
    motion = Motion(impedance, [0.5])
    for k in range(4000):
        state = motion.advance([5.0 * (k < 1000)], [0.0])
    # momentum 5 Nm s over the damping
    assert state[0] == pytest.approx(0.5 + 5.0 / 20.0, rel=1e-3)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_torques_that_are_not_finite_are_none(bad):
    impedance, goal = NullSpaceImpedance(PARAMETERS, 2, PERIOD), [0.0, 0.0]
    spoiled = Motion(impedance, [0.5, 0.1]).advance([bad, 1.0], goal)
    assert np.array_equal(spoiled, Motion(impedance, [0.5, 0.1]).advance([0.0, 0.0], goal))


@pytest.mark.parametrize(
    ("key", "value"),
    [("inertia", 0.0), ("damping", -1.0), ("stiffness", -1.0), ("filter_rate", np.inf)],
)
def test_parameters_out_of_range_are_refused(key, value):
    with pytest.raises(InputError, match=key):
        NullSpaceImpedanceParameters(**{key: value})
