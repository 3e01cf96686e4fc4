"""Hands that pull and push at random, and whether a coupling ever gives more than it had."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.physics.channel import ChannelParameters
from tests.control.teleoperation.point_station import PERIOD, Motion, of

# longest delay and jitter [s], most that is lost
_DELAY, _JITTER, _LOSS = 0.5, 0.1, 0.5
_FARTHEST, _STIFFEST = 0.15, 600.0  # m, N/m


@dataclass(frozen=True)
class Sequence:
    """What is drawn for one run.

    Attributes:
        asked: Of the hand, shape (ticks, 8), see :class:`StudyHand`.
        there: Channel to the follower.
        back: Channel from it.
        wall: Place along x [m] and stiffness [N/m] of a wall.
    """

    asked: np.ndarray
    there: ChannelParameters
    back: ChannelParameters
    wall: tuple[float, float]


def draw_sequence(seed: int, duration: float) -> Sequence:
    """Return a hand that wants somewhere else now and then, pushes and trembles, and a channel.

    Args:
        seed: Another one draws another.
        duration: [s].
    """
    random = np.random.default_rng(seed)
    ticks = round(duration / PERIOD)
    time, asked = np.arange(ticks) * PERIOD, np.zeros((ticks, 8))
    changes = np.cumsum(random.uniform(0.2, 1.0, ticks // 200 + 2))
    leg = np.searchsorted(changes, time)
    targets = random.uniform(-_FARTHEST, _FARTHEST, (len(changes) + 1, 3))
    pushes = random.normal(0.0, 5.0, (len(changes) + 1, 3))
    tremor = random.uniform(0.0, 2.0) * np.sin(
        2.0 * np.pi * random.uniform(6.0, 12.0, 3) * time[:, None] + random.uniform(0, 6.28, 3)
    )
    asked[:, :3] = _smoothed(targets[leg], 0.1)
    asked[:, 3:6] = _smoothed(pushes[leg], 0.05) + tremor
    asked[:, 6] = random.uniform(0.0, _STIFFEST)
    asked[:, 7] = random.uniform(0.0, 30.0)
    channels = [
        ChannelParameters(
            random.uniform(0.0, _DELAY),
            random.uniform(0.0, _JITTER),
            random.uniform(0.0, _LOSS),
            int(random.integers(1, 1 << 30)),
        )
        for _ in range(2)
    ]
    wall = float(random.uniform(0.0, 0.1)), float(random.choice([0.0, 500.0, 2000.0]))
    return Sequence(asked, channels[0], channels[1], wall)


def _smoothed(values: np.ndarray, constant: float) -> np.ndarray:
    """Return values behind a lag of first order, from zero, shape (ticks, k)."""
    share, now, rows = -np.expm1(-PERIOD / constant), np.zeros(values.shape[1]), []
    for value in values:
        now = now + share * (value - now)
        rows.append(now)
    return np.array(rows)


@dataclass(frozen=True)
class Energy:
    """What a run's energy was at worst.

    Attributes:
        coupling: Work of both sides together above minus what their tanks held at first [J].
        hand: Work of hand and wall, the same [J].
        tank: Least in a tank [J].
        deepest: How far the point was behind a plane [m].
        fastest: Of the handle [m/s].
    """

    coupling: float
    hand: float
    tank: float
    deepest: float
    fastest: float


def energy_of(motion: Motion, planes: list[tuple[list[float], list[float]]]) -> Energy:
    """Return what a run's energy was at worst.

    Args:
        motion: The run, with scales of one.
        planes: What the point may not cross, ``(point, normal)`` each.
    """
    tanks = np.stack([of(record, "tank") for record in (motion.leader, motion.follower)])
    # within the first tick nothing is sent and nothing done
    stored = float(tanks[:, 0].sum())
    done = np.zeros(len(motion.hand) - 1)
    for record in (motion.leader, motion.follower):
        steps = of(record, "force")[:-1] * np.diff(of(record, "position"), axis=0)
        done -= steps.sum(axis=1)
    by_hand = np.sum(motion.hand[:-1] * np.diff(motion.handle[:, :3], axis=0), axis=1)
    by_wall = np.sum(motion.wall[:-1] * np.diff(motion.point, axis=0), axis=1)
    depth = [(np.array(point) - motion.point) @ np.array(normal) for point, normal in planes]
    return Energy(
        stored + float(np.cumsum(done).min()),
        stored + float(np.cumsum(by_hand + by_wall).min()),
        float(tanks.min()),
        float(np.max(depth)),
        float(np.linalg.norm(motion.handle[:, 3:], axis=1).max()),
    )
