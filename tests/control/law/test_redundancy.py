"""Redundant joints: they never disturb the outputs, and track their reference.

Closed loops on Drake's own plant, as in the test of the outputs' linear dynamics.
"""

from dataclasses import replace

import numpy as np
import pytest

from pfsc_drake import jets
from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.posture import range_weight
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from tests.control.conftest import POSTURE_POLES
from tests.control.law.closed_loop import ClosedLoop, predicted, simulate, start


def coordinate(q):
    """Return an angle that several joints change, not linearly."""
    return q[3] + jets.sin(q[4]) * 0.4 + q[0] * q[5] * 0.3


def coordinate_derivatives(motion):
    """Return the angle and its derivatives of joint derivatives, one row each."""
    jets_of_joints = [Jet.from_derivatives(derivatives) for derivatives in np.transpose(motion)]
    return np.array(coordinate(jets_of_joints).derivatives())


class Station:
    """One closed loop of a six-axis robot that only has a position to follow."""

    def __init__(self, load_robot, make_law, path, law, **changes):
        model = "comau_racer_1_4" if law in ("rigid", "velocity_servo") else "elastic"
        model = model if model != "elastic" else "comau_racer_1_4_elastic"
        rigid, self.robot = load_robot("comau_racer_1_4"), load_robot(model)
        if law == "visco_elastic":
            self.robot = load_robot(model, tuple(5e-3 * self.robot.chain.K_s))
        self.law = make_law(self.robot.chain, law, False, **changes)
        self.loop = ClosedLoop(self.robot, path, self.law, 0.7)
        x = start(self.robot, path, rigid, 0.7, self.loop.size)
        self.loop.middle = x[:6] + 0.1
        self.times, self.states = simulate(self.loop, x)
        pairs = zip(self.times, self.states, strict=True)
        self.results = np.array([self.loop.evaluate(t, x) for t, x in pairs])

    def output_errors(self):
        """Return how far the outputs are from their prediction, (samples, m)."""
        r, m = self.loop.r, self.loop.m
        Y = self.results[:, self.law.layout.manifold_state].reshape(-1, r, m)
        Y[:, :, 0] -= np.array([self.loop.reference(t)[:r, 0] for t in self.times])
        poles = [[-20.0 - 3.0 * i - 2.0 * k for k in range(r)] for i in range(m)]
        return Y[:, 0] - np.array([predicted(Y[0, :, i], poles[i]) for i in range(m)]).T

    def motion(self, i):
        """Return joint derivatives 0..r-1 at a sample, by the law's own function."""
        state = self.loop.state(self.states[i])
        linearization, r = self.law.linearization, self.loop.r
        point = self.loop.path.evaluator(r).evaluate_at(0.7)
        tau_ext = self.loop.tau_ext(self.times[i]).ravel()
        return np.array(linearization.function(state, tau_ext, point)[6]).T


@pytest.mark.slow
@pytest.mark.parametrize("law", ["velocity_servo", "rigid", "visco_elastic", "elastic"])
def test_one_more_coordinate_obeys_its_own_linear_dynamics(
    law, load_robot, make_law, position_path
):
    station = Station(load_robot, make_law, position_path, law, coordinate=coordinate)
    r = station.loop.r
    errors = []
    for i, t in enumerate(station.times):
        actual = coordinate_derivatives(station.motion(i))
        errors.append(actual - coordinate_derivatives(station.loop.posture(t))[:r])
    errors = np.array(errors)
    assert abs(errors[0, 0]) > 0.05
    assert np.abs(errors[:, 0] - predicted(errors[0], POSTURE_POLES[:r])).max() < 1e-10
    assert np.abs(station.output_errors()).max() < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("weight", ["range", "inertia", "joints"])
def test_a_weight_changes_the_joints_alone(weight, load_robot, make_law, position_path):
    chain = load_robot("comau_racer_1_4_elastic").chain
    weights = {"range": range_weight(chain), "inertia": None, "joints": np.arange(1.0, 7.0)}
    plain = Station(load_robot, make_law, position_path, "elastic", weight=np.ones(6))
    station = Station(load_robot, make_law, position_path, "elastic", weight=weights[weight])
    assert np.abs(station.output_errors()).max() < 1e-10
    assert np.abs(plain.output_errors()).max() < 1e-10
    assert np.abs(station.states[-1][:6] - plain.states[-1][:6]).max() > 1e-3


@pytest.mark.slow
def test_a_posture_comes_back_to_its_reference(load_robot, make_law, position_path):
    """The remaining deviation moves the outputs: its null-space part has decayed."""
    station = Station(load_robot, make_law, position_path, "rigid", weight=np.ones(6))
    deviation = []
    for i in (0, -1):
        result, q = station.results[i], station.states[i][:6]
        state = station.loop.state(station.states[i])
        y_t, _ = station.robot.tool_pose(state)
        point = position_path.evaluator(2)(y_t.tolist(), 0.7)
        A = np.array(station.law.linearization.function(state, np.zeros(6), point)[1])
        error = q - station.loop.posture(station.times[i])[0]
        deviation.append(np.linalg.norm(error - np.linalg.pinv(A) @ (A @ error)))
        assert result[station.law.layout.status][0] == 0
    assert deviation[0] > 0.1
    assert deviation[1] < 0.2 * deviation[0]


def test_square_and_redundant_robots_are_told_apart(load_robot, make_law, oriented_path):
    chain = load_robot("comau_racer_1_4").chain
    redundant = make_law(chain, "rigid", False)
    with pytest.raises(InputError, match="posture: none for 6 joints and 3 outputs"):
        make_law(chain, "rigid", False, posture=None)
    with pytest.raises(InputError, match="posture: given for 6 joints and 6 outputs"):
        make_law(chain, "rigid", True, posture=redundant.posture)


def test_damping_tells_what_it_lets_the_outputs_miss(load_robot, make_law, position_path):
    chain = load_robot("comau_racer_1_4").chain
    damped = make_law(chain, "rigid", False, inverse=DecouplingInverse(1e-6, 0.9))
    exact = make_law(chain, "rigid", False)
    q = np.array([0.2, 1.6, -0.5, 0.1, 1.2, 0.1])
    state = np.concatenate([q, 0.1 * q, q, 0.1 * q])
    y_t, _ = load_robot("comau_racer_1_4").tool_pose(state)
    theta = position_path.nearest(y_t)
    point = position_path.evaluator(2)(y_t.tolist(), theta)
    reference = np.zeros(9)
    posture = np.concatenate([q, np.zeros(12)])
    results = [
        law.evaluate(state, point, reference, np.zeros(3), posture=posture)
        for law in (damped, exact)
    ]
    A, b = (np.array(x) for x in damped.linearization.function(state, np.zeros(6), point)[1:3])
    # a rigid law's drive tells the acceleration that it asks for
    linearization = damped.linearization.function(state, np.zeros(6), point)
    gain, drift, offset = (np.array(x) for x in linearization[3:6])
    for law, result in zip((damped, exact), results, strict=True):
        drive = result[law.layout.drive][:, None]
        acceleration = np.linalg.solve(gain, drive - drift - offset)
        missed = result[law.layout.virtual_input] - (A @ acceleration + b).ravel()
        told = result[law.layout.residual] if law is damped else np.zeros(3)
        assert np.allclose(missed, told, rtol=1e-9, atol=1e-9)
    assert np.abs(results[0][damped.layout.residual]).max() > 1e-3


def test_a_posture_far_away_asks_for_no_more_than_drives_can_do(
    load_robot, make_law, position_path
):
    """Drives at their limits would disturb the outputs; the reduced posture does not."""
    chain = load_robot("comau_racer_1_4").chain
    far = make_law(chain, "rigid", False)
    posture = replace(far.posture, speeds=np.full(6, np.inf))
    q = np.array([0.2, 1.6, -0.5, 0.1, 1.2, 0.1])
    state = np.concatenate([q, 0.1 * q, q, 0.1 * q])
    y_t, _ = load_robot("comau_racer_1_4").tool_pose(state)
    theta = position_path.nearest(y_t)
    point = position_path.evaluator(2)(y_t.tolist(), theta)

    def result_of(law, q_0):
        wanted = np.concatenate([q_0, np.zeros(12)])
        return law.evaluate(state, point, np.zeros(9), np.zeros(3), posture=wanted)

    # next to where it is, a posture asks for rest
    rest, wanted = (result_of(far, q_0)[far.layout.drive] for q_0 in (q, q + 1.5))
    limits = 1.1 * np.abs(rest) + 20.0
    assert np.any(np.abs(wanted) > 2.0 * limits)
    law = make_law(chain, "rigid", False, limits=limits, posture=posture)
    result = result_of(law, q + 1.5)
    drive = result[law.layout.drive]
    assert np.max(np.abs(drive) / limits) == pytest.approx(1.0)
    share = np.dot(drive - rest, wanted - rest) / np.sum((wanted - rest) ** 2)
    assert 0.0 < share < 0.6
    np.testing.assert_allclose(drive, rest + share * (wanted - rest), atol=1e-9)
    linear = law.linearization.function(state, np.zeros(6), point)
    A, b, gain, drift, offset = (np.array(x) for x in linear[1:6])
    acceleration = np.linalg.solve(gain, drive[:, None] - drift - offset)
    reached = (A @ acceleration + b).ravel()
    np.testing.assert_allclose(reached, result[law.layout.virtual_input], rtol=1e-9, atol=1e-9)
    # outputs that ask for too much by themselves get what there is
    weak = make_law(chain, "rigid", False, limits=0.5 * np.abs(rest) + 1e-3, posture=posture)
    held = np.clip(rest, -weak.limits, weak.limits)
    np.testing.assert_allclose(result_of(weak, q + 1.5)[weak.layout.drive], held, atol=1e-9)


def test_ranges_weigh_by_the_square():
    class Robot:
        def gather(self, _):
            return np.array([[-1.0, 1.0], [0.0, 1.0], [-np.inf, np.inf]])

    # the third joint counts as one that turns once
    assert np.allclose(range_weight(Robot()), [np.pi**2, 4.0 * np.pi**2, 1.0])
