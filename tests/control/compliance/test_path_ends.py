"""An operator who guides a tool to the ends of an open path, and pushes against them."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.impedance import ImpedanceLaw
from pfsc_drake.control.compliance.impedance_filter import ImpedanceFilter
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.compliance.path_ends import PathEnds
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.manifolds.path import PathManifold

PERIOD, MASS, DAMPING, SETTLING = 1e-3, 3.0, 20.0, 0.04
ENDS = (0.1, 0.5)
STRONG = 45.0  # N


class CompliantReference:
    """The reference along a path from 0.1 to 0.5 m; ``ended`` is whether the path is open."""

    def __init__(self, eta, stiffness=0.0, *, ended=True):
        along = CoordinateImpedance(Profile(MASS), Profile(DAMPING), Profile(stiffness))
        coordinates = PathManifold(1, oriented=False).coordinates
        law = ImpedanceLaw(ImpedanceParameters(along), coordinates, 1, PERIOD, desired_order=4)
        ends = PathEnds(law, 0, ENDS, SETTLING) if ended else None
        self._stepper = Stepper(ImpedanceFilter(law, ends=ends))
        self._desired = np.zeros(15)
        self._desired[0] = eta

    def step(self, force, desired=None):
        """Return ``y_p`` and ``y_p'`` along the path, and take a force for a period."""
        if desired is not None:
            self._desired[::3] = desired
        inputs = {"desired_reference": self._desired, "manifold_state": np.zeros(3)}
        reference = self._stepper.step(manifold_force=[force, 0.0, 0.0], **inputs)["reference"]
        return reference[0], reference[3]


def simulate(forces, eta, **options):
    """Return ``[y_p, y_p']`` at each tick, shape (ticks + 1, 2)."""
    tool = CompliantReference(eta, **options)
    return np.array([tool.step(force) for force in [*forces, 0.0]])


@pytest.mark.parametrize(("end", "sign"), [(ENDS[0], -1.0), (ENDS[1], 1.0)])
def test_a_hand_leans_on_an_end(end, sign):
    """It brakes with the time constant, comes to rest at the end, and is let go of inwards."""
    forces = np.full(1500, sign * STRONG)
    motion = simulate(np.append(forces, np.full(200, -sign * STRONG)), 0.3)
    h = sign * (end - motion[:, 0])
    assert h.min() >= 0.0
    assert h[1500] < 1e-6
    fastest = np.max(sign * motion[:1501, 1])
    assert 0.3 < fastest < STRONG / DAMPING
    near = (h[:1500] < 0.2 * SETTLING) & (h[:1500] > 1e-4)
    rate = sign * motion[1:1501, 1][near] / h[:1500][near]
    np.testing.assert_allclose(rate, 1.0 / SETTLING, rtol=1e-9)
    # as free as at first on the way back
    back = simulate(np.full(200, -sign * STRONG), end)
    np.testing.assert_allclose(motion[1500:, 0], back[:, 0], rtol=0.0, atol=2e-6)
    assert sign * (end - motion[-1, 0]) > 0.1


def test_what_has_no_ends_goes_on():
    motion = simulate(np.full(1500, STRONG), 0.3, ended=False)
    assert motion[-1, 0] > ENDS[1] + 0.5


def test_between_the_ends_nothing_changes():
    """To the last bit."""
    forces = np.random.default_rng(2).normal(0.0, 10.0, 1000)
    motions = [simulate(forces, 0.3, ended=ended) for ended in (True, False)]
    assert np.ptp(motions[0][:, 0]) > 1e-3
    np.testing.assert_array_equal(*motions)


@pytest.mark.parametrize("end", ENDS)
def test_a_motion_to_an_end_arrives_as_planned(end):
    """A path may be followed to its very end, compliant or not; and a push is stopped there."""
    curve = rest_to_rest([0.3, end], velocity=0.5, acceleration=8.0)
    times = np.arange(0.0, curve.domain[1] + 0.05, PERIOD)
    desired = curve.derivatives(np.minimum(times, curve.domain[1]), 4)[:, :, 0]

    def along(ended, force):
        tool = CompliantReference(0.3, 3000.0, ended=ended)
        return np.array([tool.step(force, row)[0] for row in desired])

    np.testing.assert_allclose(along(True, 0.0), along(False, 0.0), rtol=0.0, atol=1e-7)
    sign = np.sign(end - 0.3)
    pushed = sign * (end - along(True, sign * STRONG))
    assert -1e-6 < pushed.min() < 1e-4
    free = sign * (end - along(False, sign * STRONG))
    assert -0.02 < free.min() < -0.014


@pytest.mark.parametrize("seed", range(5))
def test_an_end_gives_a_hand_no_energy(seed):
    """Pushes and pulls of all lengths; the work of the hand covers what the mass moves with."""
    random = np.random.default_rng(seed)
    changes = random.uniform(-STRONG, STRONG, 400) + 20.0
    forces = np.repeat(changes, random.integers(1, 25, 400))
    motion = simulate(forces, ENDS[1] - 1e-5)
    # beyond by what a force moves the mass while it turns it within a period
    assert motion[:, 0].max() < ENDS[1] + PERIOD**2 * 2 * STRONG / (4.0 * MASS)
    assert np.sum(motion[:, 0] > ENDS[1] - 1e-4) > 100
    work = np.cumsum(forces * np.diff(motion[:, 0]))
    kinetic = MASS / 2.0 * (motion[1:, 1] ** 2 - motion[0, 1] ** 2)
    # and what the damper takes, at least that of the mean speed
    damped = np.cumsum(DAMPING * np.diff(motion[:, 0]) ** 2 / PERIOD)
    assert np.min(work - kinetic - damped) > -1e-12
    assert work[-1] > 0.01


def test_beyond_an_end_nothing_pushes_back():
    """A tool that starts there returns only by the force of the operator."""
    outside = ENDS[1] + 0.01
    resting = simulate(np.full(100, STRONG), outside)
    np.testing.assert_allclose(resting, [[outside, 0.0]] * 101, rtol=0.0, atol=1e-12)
    inwards = simulate(np.full(100, -STRONG), outside)
    free = simulate(np.full(100, -STRONG), outside, ended=False)
    np.testing.assert_array_equal(inwards, free)
