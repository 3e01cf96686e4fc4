"""Random operator motions, and the energy balance of a coupling."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.physics.channel import ChannelParameters
from tests.control.teleoperation.point_station import PERIOD, Motion, of

# largest delay and jitter [s], largest loss
_DELAY, _JITTER, _LOSS = 0.5, 0.1, 0.5
_FARTHEST, _STIFFEST = 0.15, 600.0  # m, N/m


@dataclass(frozen=True)
class Sequence:
    """Random inputs of one run.

    Attributes:
        requested: Inputs of the operator model, shape (ticks, 8), see :class:`StudyHand`.
        there: Channel to the follower.
        back: Channel from the follower.
        wall: Position along x [m] and stiffness [N/m] of a wall.
    """

    requested: np.ndarray
    there: ChannelParameters
    back: ChannelParameters
    wall: tuple[float, float]


def draw_sequence(seed: int, duration: float) -> Sequence:
    """Return an operator motion with changing targets, pushes and tremor, and random channels.

    Args:
        seed: Seed of the random numbers.
        duration: Duration [s].
    """
    random = np.random.default_rng(seed)
    ticks = round(duration / PERIOD)
    time, requested = np.arange(ticks) * PERIOD, np.zeros((ticks, 8))
    changes = np.cumsum(random.uniform(0.2, 1.0, ticks // 200 + 2))
    leg = np.searchsorted(changes, time)
    targets = random.uniform(-_FARTHEST, _FARTHEST, (len(changes) + 1, 3))
    pushes = random.normal(0.0, 5.0, (len(changes) + 1, 3))
    tremor = random.uniform(0.0, 2.0) * np.sin(
        2.0 * np.pi * random.uniform(6.0, 12.0, 3) * time[:, None] + random.uniform(0, 6.28, 3)
    )
    requested[:, :3] = _smoothed(targets[leg], 0.1)
    requested[:, 3:6] = _smoothed(pushes[leg], 0.05) + tremor
    requested[:, 6] = random.uniform(0.0, _STIFFEST)
    requested[:, 7] = random.uniform(0.0, 30.0)
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
    return Sequence(requested, channels[0], channels[1], wall)


def _smoothed(values: np.ndarray, constant: float) -> np.ndarray:
    """Return values behind a lag of first order, from zero, shape (ticks, k)."""
    share, now, rows = -np.expm1(-PERIOD / constant), np.zeros(values.shape[1]), []
    for value in values:
        now = now + share * (value - now)
        rows.append(now)
    return np.array(rows)


@dataclass(frozen=True)
class Energy:
    """Extreme energies of a run.

    Attributes:
        coupling: Initial content of both tanks minus the largest work of both sides [J].
        hand: The same for the work of operator and wall [J].
        tank: Least content of a tank [J].
        deepest: Largest penetration of a plane [m].
        fastest: Largest speed of the handle [m/s].
    """

    coupling: float
    hand: float
    tank: float
    deepest: float
    fastest: float


def energy_of(motion: Motion, planes: list[tuple[list[float], list[float]]]) -> Energy:
    """Return the extreme energies of a run.

    Args:
        motion: The run, with scales of one.
        planes: Boundaries of the point, ``(point, normal)`` each.
    """
    tanks = np.stack([of(record, "tank") for record in (motion.leader, motion.follower)])
    # no energy is sent and no work done in the first tick
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
