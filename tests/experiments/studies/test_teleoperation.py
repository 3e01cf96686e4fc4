"""Couplings over a channel: felt as the theory says, passive whatever happens, in step again."""

import json

import numpy as np
import pytest

from experiments.studies.teleoperation import point as point_module
from experiments.studies.teleoperation.point import PERIOD, PointStation, PointTeleoperation, of
from experiments.studies.teleoperation.sequences import draw_sequence, energy_of
from experiments.studies.teleoperation.study import PLANES, write_teleoperation
from experiments.studies.teleoperation.transparency import felt_at, press, wave_theory
from pfsc_drake.control.teleoperation.parameters import CouplingParameters
from pfsc_drake.physics.channel import ChannelParameters, message_ages


def station(coupling="waves", passive=True, smoothing=0.015, planes=PLANES):
    way = CouplingParameters(coupling, passive, impedance=60.0, smoothing=smoothing)
    return PointStation(way, planes)


@pytest.fixture(scope="module", name="waves")
def fixture_waves():
    return PointTeleoperation(station())


@pytest.mark.slow(but="0.2")
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.2])
def test_waves_are_felt_as_a_line_with_a_load(delay):
    """A lossless line before a mass with damping, and before what is rigid."""
    there = station(smoothing=0.002, planes=PLANES[:1])
    felt = felt_at(PointTeleoperation(there), delay)
    impedance, stiffness = wave_theory(there, [delay])
    assert felt.impedance == pytest.approx(impedance[0], rel=0.04)
    assert felt.stiffness == pytest.approx(stiffness[0], rel=0.04)


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
    monkeypatch.setattr(point_module, "message_ages", silent(1500, 1000))
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


@pytest.mark.parametrize("seed", range(4))
def test_links_that_are_away_give_no_energy(monkeypatch, seed):
    random = np.random.default_rng(seed)
    begin, length = random.integers(200, 800, 2).tolist()
    monkeypatch.setattr(point_module, "message_ages", silent(begin, length))
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


@pytest.mark.slow
def test_the_study_is_written(tmp_path):
    write_teleoperation(tmp_path / "study", lambda line: None, [0.0, 0.2], 2)
    names = {path.name for path in (tmp_path / "study" / "figures").iterdir()}
    assert names == {"transparency.png", "contact.png", "energy.png"}
    metrics = json.loads((tmp_path / "study" / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["waves: sequences_below_bound"]["value"] == 0.0
