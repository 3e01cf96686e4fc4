"""What a hand feels through a channel: of free motion, of a hard wall, by coupling and delay."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.studies.teleoperation.point import (
    PERIOD,
    Motion,
    PointStation,
    PointTeleoperation,
)
from pfsc_drake.physics.channel import ChannelParameters

# of the hand: N/m, N s/m
_STIFFNESS, _DAMPING = 300.0, 20.0
# the wall [m], where a hand that presses wants to be: first, then [m]
WALL, _PRESSES = 0.1, (0.12, 0.15)
_AMPLITUDE, FREQUENCY = 0.05, 0.5  # m, Hz
_FREE, _PRESSED = 8.0, 10.0  # s
_UNSTEADY = 1.0  # N, rms, of a force that should be at rest


@dataclass(frozen=True)
class Felt:
    """What is felt at a delay.

    Attributes:
        impedance: Force by velocity where all moves freely, magnitude [N s/m].
        stiffness: Of the wall, that is rigid [N/m]; NaN where the force does not come to rest.
        apart: Largest distance of leader and follower in free motion [m].
        unsteady: How far the force at the wall is from its mean in the last second, rms [N].
    """

    impedance: float
    stiffness: float
    apart: float
    unsteady: float


def felt_at(station: PointTeleoperation, delay: float) -> Felt:
    """Return what is felt at a delay.

    Args:
        station: What follows, with a plane at :data:`WALL` along x.
        delay: Each way [s].
    """
    free, pressed = move_freely(station, delay), press(station, delay)
    time = np.arange(len(free.handle)) * PERIOD
    last = time >= _FREE - 2.0 / FREQUENCY
    wave = np.exp(-2j * np.pi * FREQUENCY * time[last])
    impedance = -(free.motor[last, 1] @ wave) / (free.handle[last, 4] @ wave)
    apart = np.abs(free.handle[last, 1] - free.point[last, 1]).max()
    ends = [slice(round(t / PERIOD) - 500, round(t / PERIOD)) for t in (_PRESSED / 2.0, _PRESSED)]
    force = [-float(pressed.motor[end, 0].mean()) for end in ends]
    way = [float(pressed.handle[end, 0].mean()) for end in ends]
    unsteady = float(pressed.motor[-1000:, 0].std())
    stiffness = (force[1] - force[0]) / (way[1] - way[0]) if unsteady < _UNSTEADY else np.nan
    return Felt(float(abs(impedance)), stiffness, float(apart), unsteady)


def move_freely(station: PointTeleoperation, delay: float) -> Motion:
    """Return what happens where a hand moves to and fro, far from the wall."""
    time, asked = _hand(_FREE)
    asked[:, 1] = _AMPLITUDE * np.sin(2.0 * np.pi * FREQUENCY * time)
    return _run(station, asked, delay)


def press(station: PointTeleoperation, delay: float) -> Motion:
    """Return what happens where a hand leads the point to the wall, and presses, then more."""
    time, asked = _hand(_PRESSED)
    asked[:, 0] = _step(time, 0.3, 1.3) * _PRESSES[0]
    asked[:, 0] += _step(time, 5.0, 5.5) * (_PRESSES[1] - _PRESSES[0])
    return _run(station, asked, delay)


def wave_theory(station: PointStation, delays: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return impedance [N s/m] and stiffness [N/m] that waves should let a hand feel.

    A line of the impedance b and a delay T before a mass with damping, ``Z = m s + d``, is felt as
    ``b (Z + b tanh(sT)) / (b + Z tanh(sT))``; before what is rigid, ``b / tanh(sT)``, at rest as a
    spring ``b / T``. T is the channel's delay, two lags of what is taken over, and a tick on
    either side.

    Args:
        station: What follows.
        delays: Of the channel, each way [s].
    """
    b, s = station.coupling.impedance, 2j * np.pi * FREQUENCY
    late = np.array(delays) + 2.0 * station.coupling.smoothing + 2.0 * PERIOD
    load, tanh = station.mass * s + station.damping, np.tanh(s * late)
    felt = b * (load + b * tanh) / (b + load * tanh)
    return np.abs(felt), b / late


def _hand(duration: float) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(round(duration / PERIOD)) * PERIOD
    asked = np.zeros((len(time), 8))
    asked[:, 6:] = _STIFFNESS, _DAMPING
    return time, asked


def _step(time: np.ndarray, begin: float, end: float) -> np.ndarray:
    x = np.clip((time - begin) / (end - begin), 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x * x))


def _run(station: PointTeleoperation, asked: np.ndarray, delay: float) -> Motion:
    channel = ChannelParameters(delay)
    return station.run(asked, channel, channel)
