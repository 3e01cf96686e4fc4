"""A side with six axes: rotations as coordinates, moments, and one energy tank."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.teleoperation.coupling_parameters import (
    CouplingParameters,
    PortLimits,
    PortTankParameters,
    RotationParameters,
)
from pfsc_drake.control.teleoperation.message import FIELDS, MESSAGE
from pfsc_drake.control.teleoperation.port import RECORD, TURNING_RECORD, TeleoperationPort
from pfsc_drake.errors import InputError

T, B, B_R = 1e-3, 50.0, 2.0
P_0 = np.array([0.4, -0.2, 0.9])
R_0 = Rotation.from_rotvec([2.0, 1.0, -0.5])
CAPACITY, INITIAL = PortTankParameters().capacity, PortTankParameters().initial
ROWS = RECORD | TURNING_RECORD


def make(side="leader", late=0, force=1e3, moment=1e2, connected=(), **coupling):
    plain = {"smoothing": 0.0, "velocity_smoothing": 0.0, "impedance": B}
    rotation = RotationParameters(impedance=B_R, stiffness=30.0, damping=1.5)
    parameters = CouplingParameters(**(plain | coupling), rotation=rotation)
    limits = PortLimits(force, 1.0, late, T, moment, 4.0)
    return Stepper(TeleoperationPort(side, parameters, limits), connected)


def message(count=0.0, signal=(0.0,) * 6, felt=(0.0,) * 6, energy=0.0):
    row = np.zeros(MESSAGE)
    for name, value in zip(FIELDS, (count, signal, felt, energy, 0.0), strict=True):
        row[FIELDS[name]] = value
    return row


def step(port, p, R, newest, **more):
    return port.step(position=p, orientation=R.as_matrix().ravel(), message=newest, **more)


def test_each_axis_has_its_own_waves():
    """Rotation about a fixed axis, with waves along and across it."""
    port = make(passive=False)
    a = np.array([0.3, -0.2, 0.1, 0.2, -0.1, 0.3])
    v, w = np.array([0.05, 0.02, -0.1]), np.array([0.0, 0.0, 0.7])
    root = np.array([math.sqrt(2 * B)] * 3 + [math.sqrt(2 * B_R)] * 3)
    before = None
    for k in range(4):
        turn = Rotation.from_rotvec(k * T * w)
        row = step(port, P_0 + k * T * v, turn * R_0, message(k, (k + 1) * T * a))
        if k > 1:
            expected = root * a - np.array([B] * 3 + [B_R] * 3) * [*v, *w]
            # the angles are small: moments differ from forces on the vector by half of them
            np.testing.assert_allclose(row["force"][:3], expected[:3], atol=1e-9)
            np.testing.assert_allclose(row["force"][3:], expected[3:], atol=2e-3)
            assert row["force"][5] == pytest.approx(expected[5], abs=1e-9)
            sent = (row["message"][FIELDS["signal"]] - before) / T
            np.testing.assert_allclose(sent, root * [*v, *w] - a, atol=1e-9)
        before = row["message"][FIELDS["signal"]]


def random_port(seed, ticks=300, arriving=2e-3, **options):
    """Poses and steps of a port that moves and rotates at random, below its limits."""
    random, p, R = np.random.default_rng(seed), P_0.copy(), R_0
    port = make(force=30.0, moment=3.0, connected=("felt",), **options)
    twist, signal, energy, rows = np.zeros(6), np.zeros(6), 0.0, []
    for k in range(ticks):
        newest = message(k, signal, random.normal(0, [20] * 3 + [4] * 3), energy)
        rows.append((p, R, step(port, p, R, newest, felt=random.normal(0, 2, 6))))
        twist = 0.95 * twist + random.normal(0, [0.1] * 3 + [0.4] * 3)
        for part, most in ((twist[:3], 0.99), (twist[3:], 3.9)):
            part *= min(1.0, most / max(np.linalg.norm(part), 1e-9))
        p, R = p + T * twist[:3], Rotation.from_rotvec(T * twist[3:]) * R
        if random.uniform() < 0.5:  # else nothing arrives
            signal = signal + random.normal(0, 0.02, 6)
            energy += random.exponential(arriving)
    return rows


COUNTS = [2, pytest.param(50, marks=pytest.mark.slow)]


@pytest.mark.slow(but="position_force-1-2")
@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("coupling", ["waves", "position_force", "four_channel"])
def test_one_tank_pays_for_forces_and_moments(coupling, late, count):
    """Work from the outputs and the poses alone."""
    share = 1.0
    for seed in range(count):
        rows = random_port(seed, coupling=coupling, late=late, side="follower")
        p, R = np.array([row[0] for row in rows]), Rotation.concatenate([row[1] for row in rows])
        record = np.array([row[2]["record"] for row in rows])
        tank, sent, received = (
            record[:, ROWS[name]][:, 0] for name in ("tank", "sent", "received")
        )
        acting = np.hstack([record[:, ROWS["force"]], record[:, ROWS["moment"]]])
        commanded = np.array([row[2]["force"] for row in rows])
        np.testing.assert_array_equal(acting[late:], commanded[: len(commanded) - late])
        turned = (R[1:] * R[:-1].inv()).as_rotvec()
        work = np.sum(acting[:-1] * np.hstack([np.diff(p, axis=0), turned]), axis=1)
        before = tank[:-1] - work + np.diff(received)
        expected = np.minimum(before, CAPACITY) - np.diff(sent)
        np.testing.assert_allclose(tank[1:], expected, atol=1e-12)
        assert tank.min() >= 0.0
        output = np.cumsum(work) + sent[1:] - received[1:]
        assert output.max() <= INITIAL + 1e-12
        assert np.linalg.norm(acting[:, :3], axis=1).max() <= 30.0 + 1e-12
        assert np.linalg.norm(acting[:, 3:], axis=1).max() <= 3.0 + 1e-12
        share = min(share, record[:, ROWS["share"]].min())
    assert share < 0.9  # it was short of energy, or at its limits


def test_moment_is_limited_by_the_energy_in_the_tank():
    """With a low tank, force and moment suffice for the largest speeds, in their proportion."""
    port = make(coupling="position_force", force=200.0, moment=20.0)
    port.start(position=P_0, orientation=R_0.as_matrix().ravel(), message=np.zeros(MESSAGE))
    port.set_state("tank", 0.02)
    row = step(port, P_0, R_0, message(1, felt=(0.0, -60.0, 0.0, 10.0, 0.0, 0.0)))
    np.testing.assert_allclose(row["force"], [0.0, 12.0, 0.0, -2.0, 0.0, 0.0], rtol=1e-12)


def test_other_couplings_draw_turns_together():
    port = make(coupling="four_channel", passive=False, force_share=0.5, moment=1e3)
    step(port, P_0, R_0, message())
    signals = (0, 0, 0, 0.1, 0, 0), (0, 0, 0, 0, 2.0, 0)
    row = step(port, P_0, R_0, message(1, *signals))
    drawn = 30.0 * 0.1 + 1.5 * 0.1 / T
    np.testing.assert_allclose(row["force"], [0, 0, 0, drawn, 1.0, 0], atol=1e-9)
    row = step(port, P_0, R_0, message(2, *signals))
    np.testing.assert_allclose(row["force"], [0, 0, 0, 30.0 * 0.1, 1.0, 0], atol=1e-9)


def test_a_moment_does_the_work_of_the_force_on_the_vector():
    """Far from the start, springs on phi: at any w, its rate by differences of the rotation."""
    port, turn = make(coupling="four_channel", passive=False, moment=1e3), [0.9, -0.4, 0.6]
    step(port, P_0, R_0, message())
    R = Rotation.from_rotvec(turn)
    newest = message(1, (0, 0, 0, 1.0, 0.3, -0.2))
    for _ in range(3):
        row = step(port, P_0, R * R_0, newest)
    spring = 30.0 * (np.array([1.0, 0.3, -0.2]) - turn)
    for w in np.eye(3):
        ends = [(Rotation.from_rotvec(h * w) * R).as_rotvec() for h in (-1e-5, 1e-5)]
        work = spring @ (ends[1] - ends[0]) / 2e-5
        assert row["force"][3:] @ w == pytest.approx(work, abs=1e-6)


def test_a_reserve_is_for_forces_and_moments():
    assert PortLimits(30.0, 2.0, 1, T, 3.0, 4.0).reserve == pytest.approx(2.0 * T * (60.0 + 12.0))


def test_rotations_are_damped_in_the_ratio_of_impedances():
    port = make(coupling="position_force", tank=PortTankParameters(initial=0.4, refill=30.0))
    port.start(position=P_0, orientation=R_0.as_matrix().ravel(), message=np.zeros(MESSAGE))
    port.set_state("tank", 0.1)
    turn = Rotation.from_rotvec([0.0, 1e-3, 0.0])
    row = step(port, P_0, turn * R_0, message())
    moment = -0.75 * 30.0 * B_R / B * 1.0
    np.testing.assert_allclose(row["force"], [0, 0, 0, 0, moment, 0], atol=1e-9)


def test_rotations_continue_beyond_pi():
    port, axis = make(passive=False), np.array([0.0, 0.6, 0.8])
    for angle in np.linspace(0.0, 4.5, 60):
        row = step(port, P_0, Rotation.from_rotvec(angle * axis) * R_0, message())
        np.testing.assert_allclose(row["record"][ROWS["turn"]], angle * axis, atol=1e-9)


def test_nan_is_ignored():
    port = make()
    step(port, P_0, R_0, message())
    row = port.step(position=P_0, orientation=[np.nan] * 9, message=message())
    assert np.isfinite(row["message"]).all()
    np.testing.assert_array_equal(row["force"], 0.0)


def test_moments_are_scaled_so_that_work_is():
    rotation = RotationParameters(scale=3.0)
    coupling = CouplingParameters(motion_scale=2.0, force_scale=0.5, rotation=rotation)
    of_forces, of_moments = 2.0 / 0.5, 3.0 / coupling.moment_scale
    assert of_forces == pytest.approx(of_moments)


@pytest.mark.parametrize("wrong", [{"impedance": 0.0}, {"scale": -1.0}, {"damping": np.inf}])
def test_wrong_rotations_are_rejected(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        RotationParameters(**wrong)
