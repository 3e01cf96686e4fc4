"""One side of a teleoperation: waves, other couplings, and passivity."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.teleoperation.coupling_parameters import (
    CouplingParameters,
    PortLimits,
    PortTankParameters,
)
from pfsc_drake.control.teleoperation.message import FIELDS, MESSAGE
from pfsc_drake.control.teleoperation.port import RECORD, TeleoperationPort
from pfsc_drake.errors import InputError

T, B = 1e-3, 50.0
CAPACITY = PortTankParameters().capacity
START = np.array([0.4, -0.2, 0.9])


def make(side="leader", late=0, connected=(), force=1e3, speed=1.0, **coupling):
    plain = {"smoothing": 0.0, "velocity_smoothing": 0.0, "impedance": B}
    parameters = CouplingParameters(**(plain | coupling))
    port = TeleoperationPort(side, parameters, PortLimits(force, speed, late, T))
    return Stepper(port, connected)


def message(count=0.0, signal=(), felt=(), energy=0.0):
    row = np.zeros(MESSAGE)
    row[FIELDS["count"]], row[FIELDS["energy"]] = count, energy
    for name, values in (("signal", signal), ("felt", felt)):
        row[FIELDS[name]][: len(values)] = values
    return row


def linear(row, name):
    """Return the first three of a message's field."""
    return row[FIELDS[name]][:3]


def record_of(step, name):
    return step["record"][RECORD[name]]


def random_port(seed, ticks=400, arriving=1e-3, **options):
    """Steps of a port that moves at random below its speed limit, with random messages."""
    random, x = np.random.default_rng(seed), START.copy()
    port = make(**({"force": 30.0, "connected": ("felt",)} | options))
    rows, velocity, signal, energy = [], np.zeros(3), np.zeros(3), 0.0
    for k in range(ticks):
        row = port.step(
            position=x, message=message(k, signal, random.normal(0, 20, 3), energy),
            felt=random.normal(0, 5, 3),
        )  # fmt: skip
        rows.append((x - START, row))
        velocity = 0.95 * velocity + random.normal(0, 0.1, 3)
        size = np.linalg.norm(velocity)
        velocity *= min(1.0, 0.99 / max(size, 1e-9))
        x = x + T * velocity
        if random.uniform() < 0.5:  # else nothing arrives
            signal = signal + random.normal(0, 0.02, 3)
            energy += random.exponential(arriving)
    return rows


def test_a_wave_becomes_a_force_and_a_reflected_wave():
    """With a the received wave and v the velocity: F = sqrt(2b) a - b v, o = sqrt(2b) v - a."""
    port = make(passive=False)
    a, v = np.array([0.3, -0.2, 0.1]), np.array([0.05, 0.02, -0.1])
    before = None
    for k in range(5):
        row = port.step(position=START + k * T * v, message=message(k, (k + 1) * T * a))
        if k > 1:
            np.testing.assert_allclose(row["force"], math.sqrt(2 * B) * a - B * v, atol=1e-9)
            sent = (linear(row["message"], "signal") - before) / T
            np.testing.assert_allclose(sent, math.sqrt(2 * B) * v - a, atol=1e-9)
        before = linear(row["message"], "signal")


@pytest.mark.parametrize("late", [0, 1])
def test_steady_waves_do_not_change_the_tank(late):
    """The received energy equals the reflected energy plus work: a^2/2 - F v = o^2/2."""
    tank = PortTankParameters(refill=0.0)
    port = make(late=late, tank=tank, force=30.0)
    a, v = np.array([0.3, -0.2, 0.1]), np.array([0.05, 0.02, -0.1])
    tanks, energy = [], 0.0
    for k in range(30):
        energy += T / 2.0 * a @ a
        row = port.step(
            position=START + k * T * v, message=message(k, (k + 1) * T * a, (0,) * 3, energy)
        )
        tanks.append(record_of(row, "tank")[0])
    np.testing.assert_allclose(np.diff(tanks[4:]), 0.0, atol=1e-13)


@pytest.mark.slow(but=["waves-0", "position_force-1", "four_channel-0"])
@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("coupling", ["waves", "position_force", "four_channel"])
def test_energy_balance_of_the_tank_and_no_negative_content(coupling, late):
    """Work from the outputs alone: constant force over the displacement of its tick."""
    share = 1.0
    for seed in range(4):
        rows = random_port(seed, coupling=coupling, late=late, side="follower")
        x = np.array([position for position, _ in rows])
        force, sent, received, tank = (
            np.array([record_of(row, name) for _, row in rows])
            for name in ("force", "sent", "received", "tank")
        )
        commanded = np.array([row["force"] for _, row in rows])
        np.testing.assert_array_equal(force[late:], commanded[: len(commanded) - late])
        work = np.sum(force[:-1] * np.diff(x, axis=0), axis=1)
        before = tank[:-1, 0] - work + np.diff(received[:, 0])
        expected = np.minimum(before, CAPACITY) - np.diff(sent[:, 0])
        np.testing.assert_allclose(tank[1:, 0], expected, atol=1e-13)
        assert tank.min() >= 0.0
        output = np.cumsum(work) + sent[1:, 0] - received[1:, 0]
        assert output.max() <= 0.2 + 1e-12
        share = min(share, *(record_of(row, "share")[0] for _, row in rows))
    assert share < 0.9  # it was short of energy


def test_a_port_that_is_not_passive_overdraws_its_tank():
    rows = random_port(1, 2000, 1e-9, coupling="four_channel", passive=False)
    assert min(record_of(row, "tank")[0] for _, row in rows) < 0.0


def test_force_is_limited_by_the_energy_in_the_tank():
    """No force with an empty tank; with a low one as much as suffices for the largest speed."""
    port = make(coupling="position_force", tank=PortTankParameters(initial=0.1), force=200.0)
    port.start(position=START, message=np.zeros(MESSAGE))
    port.set_state("tank", 0.02)
    row = port.step(position=START, message=message(1, felt=(-100.0, 0.0, 0.0)))
    np.testing.assert_allclose(row["force"], [20.0, 0.0, 0.0], rtol=1e-12)
    assert record_of(row, "share")[0] == pytest.approx(0.2)
    port.set_state("tank", 0.0)
    row = port.step(position=START, message=message(2, felt=(-100.0, 0.0, 0.0)))
    np.testing.assert_array_equal(row["force"], 0.0)


def test_port_damps_where_energy_is_missing():
    port = make(coupling="position_force", tank=PortTankParameters(initial=0.4, refill=30.0))
    port.start(position=START, message=np.zeros(MESSAGE))
    port.set_state("tank", 0.1)
    row = port.step(position=START + np.array([1e-4, 0, 0]), message=np.zeros(MESSAGE))
    np.testing.assert_allclose(row["force"], [-0.75 * 30.0 * 0.1, 0, 0], rtol=1e-12)


def test_position_and_force_couplings():
    stiff = {"stiffness": 300.0, "damping": 20.0, "passive": False}
    arrival, rate, felt = (
        np.array([0.01, 0.0, 0.0]),
        np.array([0.2, 0, 0]),
        np.array([3.0, 1.0, -2.0]),
    )
    x, v = np.array([0.004, 0.001, 0.0]), np.array([0.1, 0.0, 0.05])

    def last(**options):
        port = make(connected=("felt",), **stiff, **options)
        for k in range(3):
            row = port.step(
                position=START + x + (k - 2) * T * v,
                message=message(k + 1, arrival + (k - 2) * T * rate, felt),
                felt=[7.0, 8.0, 9.0],
            )
        return row

    # x is relative to the first position
    spring = 300.0 * (arrival - 2 * T * v) + 20.0 * (rate - v)
    leader = last(side="leader", coupling="position_force")
    np.testing.assert_allclose(leader["force"], -felt, rtol=1e-12)
    four = last(side="leader", coupling="four_channel", force_share=0.5)
    follower = last(side="follower", coupling="position_force")
    np.testing.assert_allclose(follower["force"], spring, atol=1e-9)
    np.testing.assert_allclose(four["force"], spring + 0.5 * felt, atol=1e-9)
    np.testing.assert_allclose(linear(follower["message"], "felt"), follower["force"])
    np.testing.assert_allclose(linear(four["message"], "felt"), [7.0, 8.0, 9.0])


def test_received_signal_passes_two_lags():
    """tau^2 A'' + 2 tau A' + A = A_arrived, integrated independently."""
    tau, target = 0.02, 0.7
    port = make(smoothing=tau, passive=False)
    arrival = []
    for k in range(60):
        port.step(position=START, message=message(k + 1, (target, 0, 0)))
        arrival.append(port.states["arrival"][0])
    truth = solve_ivp(
        lambda t, y: [y[1], (target - y[0] - 2 * tau * y[1]) / tau**2],
        (0.0, 0.06), [0.0, 0.0], t_eval=T * np.arange(1, 61), rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    np.testing.assert_allclose(arrival, truth.y[0], atol=1e-8)


def test_a_wave_without_energy_is_sent_later():
    """A step of the position while the tank is at its reserve; later a little energy comes."""
    port, step = make(force=30.0), np.array([2e-3, 0.0, 0.0])
    port.start(position=START, message=np.zeros(MESSAGE))
    port.set_state("tank", 0.03)
    sent = []
    for k in range(1500):
        energy = 2e-3 if k > 20 else 0.0
        row = port.step(position=START + step * (k > 0), message=message(k, energy=energy))
        sent.append(row["message"][FIELDS["signal"]][0])
    whole = math.sqrt(2 * B) * step[0]
    assert sent[1] < 0.1 * whole
    assert sent[-1] == pytest.approx(whole, rel=1e-3)
    assert record_of(row, "tank")[0] >= 0.0
    assert (np.diff(sent) >= 0.0).all()


@pytest.mark.parametrize("lack", [0.0, 0.05, 0.4])
def test_a_side_with_excess_energy_supports_one_that_lacks(lack):
    """By a share of its excess, in the ratio of the lack to the initial content."""
    port = make(tank=PortTankParameters(initial=0.1, share=30.0), force=30.0)
    port.start(position=START, message=np.zeros(MESSAGE))
    port.set_state("tank", 0.7)
    newest = message(1)
    newest[FIELDS["lack"]] = lack
    row = port.step(position=START, message=newest)
    expected = 30.0 * T * min(1.0, lack / 0.1) * 0.6
    assert record_of(row, "sent")[0] == pytest.approx(expected, abs=1e-15)
    assert record_of(row, "tank")[0] == pytest.approx(0.7 - expected, rel=1e-12)
    port.set_state("tank", 0.1)
    assert (
        record_of(port.step(position=START, message=newest), "sent")[0] == record_of(row, "sent")[0]
    )


def test_a_side_reports_its_lack_and_deferred_motion():
    tank = PortTankParameters(initial=0.1)
    port, step = make(tank=tank, force=30.0), np.array([2e-3, 0.0, 0.0])
    port.start(position=START, message=np.zeros(MESSAGE))
    port.set_state("tank", 0.03)
    row = port.step(position=START, message=np.zeros(MESSAGE))
    assert row["message"][FIELDS["lack"]][0] == pytest.approx(0.07)
    row = port.step(position=START + step, message=np.zeros(MESSAGE))
    sent = row["message"][FIELDS["signal"]][0] / math.sqrt(2 * B)
    assert record_of(row, "owed")[0] == pytest.approx(step[0] - sent, rel=1e-9)
    assert record_of(row, "owed")[0] > 1.9e-3


def test_an_open_grip_gives_no_force_and_no_work():
    port = make(connected=("grip",), passive=True)
    for k in range(4):
        position = START + np.array([k * 1e-3, 0, 0])
        row = port.step(position=position, message=message(k + 1, (0.1, 0, 0)), grip=[0.0])
    np.testing.assert_array_equal(row["force"], 0.0)
    assert record_of(row, "force").max() == 0.0


def test_nan_is_ignored():
    port = make()
    port.step(position=START, message=np.zeros(MESSAGE))
    row = port.step(position=[np.nan] * 3, message=np.zeros(MESSAGE))
    assert np.isfinite(row["message"]).all()
    assert np.isfinite(row["force"]).all()


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"coupling": "spring"}, "coupling"),
        ({"impedance": 0.0}, "impedance"),
        ({"smoothing": -1.0}, "smoothing"),
        ({"force_share": 1.5}, "force_share"),
    ],
)
def test_wrong_couplings_are_rejected(wrong, key):
    with pytest.raises(InputError, match=key):
        CouplingParameters(**wrong)


def test_wrong_limits_and_tanks_are_rejected():
    with pytest.raises(InputError, match="ticks_late"):
        PortLimits(1.0, 1.0, -1, T)
    with pytest.raises(InputError, match="initial"):
        PortTankParameters(initial=2.0 * CAPACITY)
    assert PortLimits(30.0, 2.0, 1, T).reserve == pytest.approx(0.12)
