"""Couplings over a channel: felt as the theory says, passive whatever happens, in step again."""

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
    """Return time [s], and what an operator of 300 N/m and 20 N s/m is asked."""
    time = np.arange(round(duration / PERIOD)) * PERIOD
    asked = np.zeros((len(time), 8))
    asked[:, 6:] = 300.0, 20.0
    return time, asked


def press(station, delay):
    """Return the motion of a point that is led to the wall and pressed, from 5 s on more."""

    def step(begin, end):
        x = np.clip((time - begin) / (end - begin), 0.0, 1.0)
        return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)

    time, asked = operator(10.0)
    asked[:, 0] = 0.12 * step(0.3, 1.3) + 0.03 * step(5.0, 5.5)
    return station.run(asked, ChannelParameters(delay), ChannelParameters(delay))


def felt_at(station, delay):
    """Return impedance of free motion [N s/m] and stiffness of a rigid wall [N/m] at a delay."""
    time, asked = operator(8.0)
    asked[:, 1] = 0.05 * np.sin(2.0 * np.pi * FREQUENCY * time)
    free = station.run(asked, ChannelParameters(delay), ChannelParameters(delay))
    last = time >= 8.0 - 2.0 / FREQUENCY
    wave = np.exp(-2j * np.pi * FREQUENCY * time[last])
    impedance = abs((free.motor[last, 1] @ wave) / (free.handle[last, 4] @ wave))
    pressed, ends = press(station, delay), (slice(4500, 5000), slice(9500, 10_000))
    force, way = ([x[end, 0].mean() for end in ends] for x in (pressed.motor, pressed.handle))
    return impedance, (force[0] - force[1]) / (way[1] - way[0])


def wave_theory(station, delay):
    """Return the same of a lossless line before ``Z = m s + d``, and before what is rigid.

    A line of the impedance b and a delay T is felt as ``b (Z + b tanh(sT)) / (b + Z tanh(sT))``;
    before what is rigid, at rest, as a spring ``b / T``. T is the channel's delay, two lags of what
    is taken over, and a tick on either side.
    """
    b, s = station.coupling.impedance, 2j * np.pi * FREQUENCY
    late = delay + 2.0 * station.coupling.smoothing + 2.0 * PERIOD
    load, tanh = station.mass * s + station.damping, np.tanh(s * late)
    return abs(b * (load + b * tanh) / (b + load * tanh)), b / late


def station(coupling="waves", passive=True, smoothing=0.015, planes=PLANES):
    way = CouplingParameters(coupling, passive, impedance=60.0, smoothing=smoothing)
    return PointStation(way, planes)


@pytest.fixture(scope="module", name="waves")
def fixture_waves():
    return PointTeleoperation(station())


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.2])
def test_waves_are_felt_as_a_line_with_a_load(delay):
    """A lossless line before a mass with damping, and before what is rigid."""
    there = station(smoothing=0.002, planes=PLANES[:1])
    felt = felt_at(PointTeleoperation(there), delay)
    np.testing.assert_allclose(felt, wave_theory(there, delay), rtol=0.04)


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
def test_a_passive_coupling_never_gives_more_than_its_tanks_held(coupling):
    """Whatever the hand does, and the channel: delay to 0.5 s, jitter, half of it lost."""
    there = PointTeleoperation(station(coupling))
    for seed in range(4):
        drawn = draw_sequence(seed, 1.5)
        energy = energy_of(there.run(drawn.asked, drawn.there, drawn.back, drawn.wall), PLANES)
        assert energy.coupling >= 0.0
        assert energy.tank >= 0.0
        assert energy.deepest < 1e-9


@pytest.mark.slow
def test_what_is_not_made_passive_gives_more():
    there = PointTeleoperation(station("position_force", passive=False))
    drawn = draw_sequence(3, 2.0)
    assert energy_of(there.run(drawn.asked, drawn.there, drawn.back), PLANES).coupling < -1.0


def test_both_sides_meet_again_where_they_rest(waves):
    """After a wild motion over a channel that loses half; far from planes."""
    drawn = draw_sequence(2, 6.0)
    asked = 0.3 * drawn.asked
    asked[2500:, :3] = asked[2499, :3] * np.exp(-np.arange(3500) / 200.0)[:, None]
    asked[:, 3:6] = 0.0
    asked[:, 6:] = 300.0, 20.0
    channels = [ChannelParameters(0.1, 0.1, 0.5, seed) for seed in (1, 2)]
    motion = waves.run(asked, *channels)
    apart = np.linalg.norm(motion.handle[:, :3] - motion.point, axis=1)
    assert apart[:2500].max() > 5e-3
    assert apart[-1] < 2e-4


def silent(begin, length):
    """Return the ages of messages of a link that is away for some ticks."""

    def ages(parameters, period):
        age = message_ages(parameters, period).copy()
        away = np.arange(length)
        age[begin : begin + length] = age[begin] + away
        return age

    return ages


@pytest.mark.slow
def test_both_sides_meet_again_after_a_link_was_away(monkeypatch):
    """For a second, in which the hand goes on by 0.1 m and more; and it is given no energy."""
    monkeypatch.setattr(point_station, "message_ages", silent(1500, 1000))
    waves = PointTeleoperation(PointStation(CouplingParameters(impedance=40.0)))
    asked = np.zeros((6000, 8))
    asked[:, 0] = 0.25 * np.clip(PERIOD * np.arange(6000) - 1.0, 0.0, 1.0)
    asked[:, 6:] = 300.0, 20.0
    motion = waves.run(asked, *[ChannelParameters(0.1, seed=seed) for seed in (1, 2)])
    apart = np.linalg.norm(motion.handle[:, :3] - motion.point, axis=1)
    owed = of(motion.follower, "owed")
    assert apart[2500] > 0.15
    assert owed[3000] == pytest.approx(apart[3000], abs=0.05)
    assert apart[-1] < 1e-3
    assert owed[-1] < 1e-3
    assert energy_of(motion, PLANES).coupling >= 0.0


@pytest.mark.slow(but=["1", "0"])
@pytest.mark.parametrize("seed", range(4))
def test_links_that_are_away_give_no_energy(monkeypatch, seed):
    random = np.random.default_rng(seed)
    begin, length = random.integers(200, 800, 2).tolist()
    monkeypatch.setattr(point_station, "message_ages", silent(begin, length))
    there, drawn = PointTeleoperation(station()), draw_sequence(seed + 20, 2.0)
    energy = energy_of(there.run(drawn.asked, drawn.there, drawn.back, drawn.wall), PLANES)
    assert energy.coupling >= 0.0
    assert energy.tank >= 0.0


def test_energy_is_counted_as_the_ports_tell(waves):
    """The tanks' law, recounted from both records."""
    drawn = draw_sequence(5, 1.0)
    motion = waves.run(drawn.asked, drawn.there, drawn.back)
    for record, other in (
        (motion.leader, motion.follower),
        (motion.follower, motion.leader),
    ):
        work = np.sum(of(record, "force")[:-1] * np.diff(of(record, "position"), axis=0), axis=1)
        change = np.diff(of(record, "received")) - np.diff(of(record, "sent")) - work
        np.testing.assert_allclose(np.diff(of(record, "tank")), change, atol=1e-12)
        assert (of(record, "received") <= of(other, "sent") + 1e-15).all()
    assert len(motion.hand) == round(1.0 / PERIOD)
