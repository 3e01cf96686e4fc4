"""Couplings over a channel: impedance, passivity, and recovery of the positions."""

import numpy as np
import pytest

from pfsc_drake.control.teleoperation.coupling_parameters import CouplingParameters
from pfsc_drake.physics.channel import ChannelParameters, message_ages
from tests.control.teleoperation import point_station
from tests.control.teleoperation.point_station import PERIOD, PointStation, PointTeleoperation, of
from tests.control.teleoperation.random_sequences import draw_sequence, energy_of

WALL, FREQUENCY = 0.1, 0.5  # m, Hz
# sharp and blunt edges with the first
PLANES = [
    ([WALL, 0.0, 0.0], [-1.0, 0.0, 0.0]),
    ([0.0, 0.08, 0.0], [0.0, -1.0, 0.0]),
    ([0.0, 0.0, -0.1], [0.5, 0.0, float(np.sqrt(0.75))]),
]


def operator(duration):
    """Return time [s], and inputs of an operator of 300 N/m and 20 N s/m."""
    time = np.arange(round(duration / PERIOD)) * PERIOD
    requested = np.zeros((len(time), 8))
    requested[:, 6:] = 300.0, 20.0
    return time, requested


def press(station, delay):
    """Return the motion of a point that moves to the wall and presses, more from 5 s on."""

    def step(begin, end):
        x = np.clip((time - begin) / (end - begin), 0.0, 1.0)
        return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)

    time, requested = operator(10.0)
    requested[:, 0] = 0.12 * step(0.3, 1.3) + 0.03 * step(5.0, 5.5)
    return station.run(requested, ChannelParameters(delay), ChannelParameters(delay))


def felt_at(station, delay):
    """Return impedance of free motion [N s/m] and stiffness of a rigid wall [N/m] at a delay."""
    time, requested = operator(8.0)
    requested[:, 1] = 0.05 * np.sin(2.0 * np.pi * FREQUENCY * time)
    free = station.run(requested, ChannelParameters(delay), ChannelParameters(delay))
    last = time >= 8.0 - 2.0 / FREQUENCY
    wave = np.exp(-2j * np.pi * FREQUENCY * time[last])
    impedance = abs((free.motor[last, 1] @ wave) / (free.handle[last, 4] @ wave))
    pressed, ends = press(station, delay), (slice(4500, 5000), slice(9500, 10_000))
    force, position = ([x[end, 0].mean() for end in ends] for x in (pressed.motor, pressed.handle))
    return impedance, (force[0] - force[1]) / (position[1] - position[0])


def wave_theory(station, delay):
    """Return both for a lossless line with the load ``Z = m s + d``, and with a rigid end.

    A line of impedance b and delay T has the impedance ``b (Z + b tanh(sT)) / (b + Z tanh(sT))``;
    with a rigid end, at rest, it is a spring ``b / T``. T is the channel's delay plus two lags and
    a tick on either side.
    """
    b, s = station.coupling.impedance, 2j * np.pi * FREQUENCY
    late = delay + 2.0 * station.coupling.smoothing + 2.0 * PERIOD
    load, tanh = station.mass * s + station.damping, np.tanh(s * late)
    return abs(b * (load + b * tanh) / (b + load * tanh)), b / late


def station(coupling="waves", passive=True, smoothing=0.015, planes=PLANES):
    parameters = CouplingParameters(coupling, passive, impedance=60.0, smoothing=smoothing)
    return PointStation(parameters, planes)


@pytest.fixture(scope="module", name="waves")
def fixture_waves():
    return PointTeleoperation(station())


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.2])
def test_waves_have_the_impedance_of_a_line_with_a_load(delay):
    """A lossless line with a damped mass, and with a rigid end."""
    line = station(smoothing=0.002, planes=PLANES[:1])
    felt = felt_at(PointTeleoperation(line), delay)
    np.testing.assert_allclose(felt, wave_theory(line, delay), rtol=0.04)


@pytest.mark.slow
def test_a_wall_at_200_ms_is_stable_with_waves_and_not_without():
    calm = press(PointTeleoperation(station(smoothing=0.002)), 0.2)
    wild = press(PointTeleoperation(station("position_force", False, 0.002)), 0.2)
    assert calm.motor[-2000:, 0].std() < 0.5
    assert wild.motor[-2000:, 0].std() > 10.0
    for motion in (calm, wild):
        assert motion.point[:, 0].max() < 0.1 + 1e-9


@pytest.mark.slow(but="position_force")
@pytest.mark.parametrize("coupling", ["waves", "position_force", "four_channel"])
def test_a_passive_coupling_outputs_no_more_than_its_tanks_contained(coupling):
    """For random operators and channels: delay up to 0.5 s, jitter, up to half of it lost."""
    teleoperation = PointTeleoperation(station(coupling))
    for seed in range(4):
        drawn = draw_sequence(seed, 1.5)
        energy = energy_of(
            teleoperation.run(drawn.requested, drawn.there, drawn.back, drawn.wall), PLANES
        )
        assert energy.coupling >= 0.0
        assert energy.tank >= 0.0
        assert energy.deepest < 1e-9


@pytest.mark.slow
def test_a_coupling_that_is_not_passive_outputs_more():
    teleoperation = PointTeleoperation(station("position_force", passive=False))
    drawn = draw_sequence(3, 2.0)
    assert (
        energy_of(teleoperation.run(drawn.requested, drawn.there, drawn.back), PLANES).coupling
        < -1.0
    )


def test_positions_agree_again_at_rest(waves):
    """After a wild motion over a channel that loses half; far from planes."""
    drawn = draw_sequence(2, 6.0)
    requested = 0.3 * drawn.requested
    requested[2500:, :3] = requested[2499, :3] * np.exp(-np.arange(3500) / 200.0)[:, None]
    requested[:, 3:6] = 0.0
    requested[:, 6:] = 300.0, 20.0
    channels = [ChannelParameters(0.1, 0.1, 0.5, seed) for seed in (1, 2)]
    motion = waves.run(requested, *channels)
    apart = np.linalg.norm(motion.handle[:, :3] - motion.point, axis=1)
    assert apart[:2500].max() > 5e-3
    assert apart[-1] < 2e-4


def silent(begin, length):
    """Return the ages of messages of a link that is interrupted for some ticks."""

    def ages(parameters, period):
        age = message_ages(parameters, period).copy()
        away = np.arange(length)
        age[begin : begin + length] = age[begin] + away
        return age

    return ages


@pytest.mark.slow
def test_positions_agree_again_after_an_interruption(monkeypatch):
    """For one second, in which the operator moves by 0.1 m and more, without energy output."""
    monkeypatch.setattr(point_station, "message_ages", silent(1500, 1000))
    waves = PointTeleoperation(PointStation(CouplingParameters(impedance=40.0)))
    requested = np.zeros((6000, 8))
    requested[:, 0] = 0.25 * np.clip(PERIOD * np.arange(6000) - 1.0, 0.0, 1.0)
    requested[:, 6:] = 300.0, 20.0
    motion = waves.run(requested, *[ChannelParameters(0.1, seed=seed) for seed in (1, 2)])
    apart = np.linalg.norm(motion.handle[:, :3] - motion.point, axis=1)
    owed = of(motion.follower, "owed")
    assert apart[2500] > 0.15
    assert owed[3000] == pytest.approx(apart[3000], abs=0.05)
    assert apart[-1] < 1e-3
    assert owed[-1] < 1e-3
    assert energy_of(motion, PLANES).coupling >= 0.0


@pytest.mark.slow(but=["1", "0"])
@pytest.mark.parametrize("seed", range(4))
def test_interruptions_output_no_energy(monkeypatch, seed):
    random = np.random.default_rng(seed)
    begin, length = random.integers(200, 800, 2).tolist()
    monkeypatch.setattr(point_station, "message_ages", silent(begin, length))
    teleoperation, drawn = PointTeleoperation(station()), draw_sequence(seed + 20, 2.0)
    energy = energy_of(
        teleoperation.run(drawn.requested, drawn.there, drawn.back, drawn.wall), PLANES
    )
    assert energy.coupling >= 0.0
    assert energy.tank >= 0.0


def test_energy_balance_of_both_records(waves):
    """Energy balance of the tanks from both records."""
    drawn = draw_sequence(5, 1.0)
    motion = waves.run(drawn.requested, drawn.there, drawn.back)
    for record, other in (
        (motion.leader, motion.follower),
        (motion.follower, motion.leader),
    ):
        work = np.sum(of(record, "force")[:-1] * np.diff(of(record, "position"), axis=0), axis=1)
        change = np.diff(of(record, "received")) - np.diff(of(record, "sent")) - work
        np.testing.assert_allclose(np.diff(of(record, "tank")), change, atol=1e-12)
        assert (of(record, "received") <= of(other, "sent") + 1e-15).all()
    assert len(motion.hand) == round(1.0 / PERIOD)
