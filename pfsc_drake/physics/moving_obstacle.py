"""Obstacles that move by themselves, and what a sensor tells of them."""

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Annotated, Any

import casadi as ca
import numpy as np
from scipy.interpolate import PchipInterpolator

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.checks import require
from pfsc_drake.control.obstacles.shapes import Capsule, ObstacleShape
from pfsc_drake.geometry.curves.polynomial import PieceTable
from pfsc_drake.physics.force_torque_sensor import NOISE_TICKS, noise_at
from pfsc_drake.yaml.rules import NotNegative, Numbers, Parameters, Positive, Range, Seed

# of its standard deviation, beyond which noise is cut
NOISE_CUT = 3.0
_FARTHEST = 1e3  # m
_JERK = 1e-6  # m/s, change of velocity at once


@dc.dataclass
class Stride(Parameters):
    """A place on the way of an obstacle.

    Attributes:
        time: When it is there [s].
        position: Where [m], shape (3,).
    """

    time: Annotated[float, Range()] = 0.0
    position: Annotated[list[float], Numbers(3)] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])

    def __post_init__(self) -> None:
        super().__post_init__()
        near = max(map(abs, self.position)) <= _FARTHEST
        require(near, "position", self.position, f"3 numbers of at most {_FARTHEST:g} m")


@dc.dataclass
class ObstaclePart(Parameters):
    """A capsule, or a sphere where both ends are the same.

    Attributes:
        start: One end of its line, from the obstacle's position on, axes of the world [m].
        end: The other one [m].
        radius: [m].
    """

    start: Annotated[list[float], Numbers(3)] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    end: Annotated[list[float], Numbers(3)] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    radius: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        self.capsule  # noqa: B018, which checks

    @property
    def capsule(self) -> Capsule:
        """The capsule."""
        (a, b, c), (d, e, f) = self.start, self.end
        return Capsule((a, b, c), (d, e, f), self.radius)


@dc.dataclass
class ObstacleParameters:
    """An obstacle and its way, place to place without overshooting; before and after it stands.

    The way is a piecewise cubic Hermite interpolation, coordinate by coordinate (Fritsch and
    Butland 1984), its velocity continuous in between; where two places are the same it stands.

    Attributes:
        kind: ``sphere``, ``column`` of all heights, ``person`` who stands on its position, or
            ``capsules``, see :class:`~pfsc_drake.control.obstacles.shapes.ObstacleShape`.
        radius: Of all but capsules [m].
        height: Of a person [m].
        parts: Of ``capsules``: which.
        way: Places, two or more, their times ascending.
    """

    kind: str = "column"
    radius: float = 0.25
    height: float = 1.75
    parts: list[ObstaclePart] = dc.field(default_factory=list)
    way: list[Stride] = dc.field(
        default_factory=lambda: [Stride(0.0, [3.0, 0.0, 0.0]), Stride(1.0, [3.0, 0.0, 0.0])]
    )

    def __post_init__(self) -> None:
        self.shape  # noqa: B018, which checks what it looks like
        require(len(self.way) >= 2, "way", f"{len(self.way)} places", "two or more")
        times = [stride.time for stride in self.way]
        ascending = bool(np.all(np.diff(times) > 0.0))
        require(ascending, "way", f"times {times}", "ascending times")

    @property
    def shape(self) -> ObstacleShape:
        """Its shape."""
        parts = tuple(part.capsule for part in self.parts)
        return ObstacleShape(self.kind, self.radius, self.height, parts)

    @property
    def curve(self) -> PchipInterpolator:
        """Its position over time, between the first place and the last."""
        places = np.array([stride.position for stride in self.way], dtype=float)
        return PchipInterpolator([stride.time for stride in self.way], places)

    @property
    def largest_speed(self) -> float:
        """The largest speed on its way [m/s]."""
        curve = self.curve
        times = np.concatenate(
            [np.linspace(a, b, 50) for a, b in zip(curve.x[:-1], curve.x[1:], strict=True)]
        )
        return float(np.linalg.norm(curve(times, 1), axis=1).max())

    @property
    def largest_acceleration(self) -> float:
        """The largest acceleration on its way from time 0 on; infinite where it jerks [m/s^2]."""
        curve = self.curve
        ends = curve(curve.x[[0, -1]], 1)
        begins = curve.x[0] >= 0.0 and np.linalg.norm(ends[0]) > _JERK
        if begins or (curve.x[-1] >= 0.0 and np.linalg.norm(ends[1]) > _JERK):
            return math.inf
        # linear on each piece
        knots = np.maximum(np.stack([curve.x[:-1], curve.x[1:]]), 0.0)
        largest = np.linalg.norm(
            6.0 * curve.c[0] * (knots - curve.x[:-1])[..., None] + 2.0 * curve.c[1], axis=2
        )
        return float(largest[:, curve.x[1:] > 0.0].max(initial=0.0))


class MovingObstacles(Block):
    """Obstacles on their ways.

    Ports:
        state (output): Position and velocity of K obstacles, shape (6K,) [m, m/s].

    Args:
        obstacles: Which.
        period: Sampling time [s].
    """

    expands = False  # tables

    def __init__(self, obstacles: Sequence[ObstacleParameters], period: float) -> None:
        self._ways, self._period = [_Way(obstacle.curve) for obstacle in obstacles], period
        self.inputs, self.states = {}, {}
        self.outputs = {"state": Port(6 * len(obstacles), "m, m/s")}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        time = ca.MX(t * self._period)
        return {"state": ca.vertcat(*[way.at(time) for way in self._ways])}


class _Way:
    """Position and velocity over time, as a table."""

    def __init__(self, curve: PchipInterpolator) -> None:
        self._begin, self._end = float(curve.x[0]), float(curve.x[-1])
        powers = curve.c[::-1]  # lowest first, (4, pieces, 3)
        rates = np.zeros_like(powers)
        rates[:-1] = powers[1:] * np.arange(1, 4)[:, None, None]
        both = np.concatenate([powers, rates], axis=2)
        self._table = PieceTable(curve.x, both.transpose(1, 2, 0))

    def at(self, time: ca.MX) -> ca.MX:
        """Return position and velocity at a time [s], shape (6,)."""
        known = self._table(ca.fmin(ca.fmax(time, self._begin), self._end))
        moves = where(time > self._begin, where(time < self._end, 1.0, 0.0), 0.0)
        return ca.vertcat(known[:3], moves * known[3:])


@dc.dataclass
class ObstacleSensorParameters(Parameters):
    """What a sensor makes of where obstacles are.

    Attributes:
        position_noise: Standard deviation of white normal noise, cut at three of them [m].
        velocity_noise: The same of velocities [m/s].
        period: From measurement to measurement [s].
        delay: From a measurement until it is told [s].
        seed: Seed of the noise.
    """

    position_noise: NotNegative = 0.008
    velocity_noise: NotNegative = 0.05
    period: Positive = 0.02
    delay: NotNegative = 0.06
    seed: Seed = 1

    def deviation(self, count: int) -> np.ndarray:
        """Return the standard deviation of what is told of so many obstacles, shape (6 count,)."""
        one = np.repeat([self.position_noise, self.velocity_noise], 3)
        return np.tile(one, count)


class ObstacleSensor(Block):
    """Tells where obstacles were some time ago, measured now and then, with noise.

    Ports:
        state (input): Position and velocity of K obstacles, shape (6K,) [m, m/s].
        noise (input, optional): Of NOISE_TICKS ticks, see
            :class:`~pfsc_drake.systems.physics.sensor_noise.SensorNoise`.
        obstacles (output): What had been measured then, shape (6K,) [m, m/s]; without direct
            feedthrough.

    State:
        measured: What was measured last. told: What is under way, the oldest first.

    Args:
        count: K.
        every: Ticks from measurement to measurement.
        late: Ticks by which what is told is late.
        deviation: Standard deviation of the noise, beyond three of which it is cut, shape (6K,).
    """

    expands = False  # noise is looked up

    def __init__(self, count: int, every: int, late: int, deviation: np.ndarray) -> None:
        self._every, self._late, self._size = every, late, 6 * count
        self._most = ca.DM(NOISE_CUT * np.asarray(deviation))
        self.inputs = {
            "state": Port(self._size, "m, m/s"),
            "noise": Port(self._size * NOISE_TICKS, "m, m/s", optional=True),
        }
        self.outputs = {"obstacles": Port(self._size, "m, m/s")}
        self.states = {"measured": self._size}
        if late:
            self.states["told"] = late * self._size

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start."""
        told = {"told": ca.repmat(u.state, self._late, 1)} if self._late else {}
        return {"measured": u.state, **told}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"obstacles": x.told[: self._size] if self._late else x.measured}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick."""
        noise = noise_at(u.noise, self._size, t)
        cut = ca.fmin(ca.fmax(noise, -self._most), self._most)
        measures = ca.fmod(t, self._every) == 0.0
        told = {}
        if self._late:
            told["told"] = ca.vertcat(x.told[self._size :], x.measured)
        return {"measured": where(measures, u.state + cut, x.measured), **told}
