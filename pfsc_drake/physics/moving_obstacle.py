"""Moving obstacles and the sensor that measures them."""

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

# standard deviations at which noise is cut
NOISE_CUT = 3.0
_FARTHEST = 1e3  # m
_JERK = 1e-6  # m/s, step of velocity


@dc.dataclass
class ObstacleWaypoint(Parameters):
    """A waypoint of an obstacle.

    Attributes:
        time: Time of arrival [s].
        position: Position [m], shape (3,).
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
        start: One end of its axis relative to the obstacle's position, world axes [m].
        end: The other end [m].
        radius: Radius [m].
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
    """An obstacle and its trajectory between waypoints; before and after it is at rest.

    The trajectory is a piecewise cubic Hermite interpolation, coordinate by coordinate (Fritsch and
    Butland 1984), without overshoot and with a continuous velocity in between; the obstacle rests
    between equal waypoints.

    Attributes:
        kind: ``sphere``, ``column`` of infinite height, ``person`` who stands on its position, or
            ``capsules``, see :class:`~pfsc_drake.control.obstacles.shapes.ObstacleShape`.
        radius: Radius, except of capsules [m].
        height: Height of a person [m].
        parts: Parts of ``capsules``.
        way: Waypoints, two or more, with ascending times.
    """

    kind: str = "column"
    radius: float = 0.25
    height: float = 1.75
    parts: list[ObstaclePart] = dc.field(default_factory=list)
    way: list[ObstacleWaypoint] = dc.field(
        default_factory=lambda: [
            ObstacleWaypoint(0.0, [3.0, 0.0, 0.0]),
            ObstacleWaypoint(1.0, [3.0, 0.0, 0.0]),
        ]
    )

    def __post_init__(self) -> None:
        self.shape  # noqa: B018, which checks the shape
        require(len(self.way) >= 2, "way", f"{len(self.way)} places", "two or more")
        times = [waypoint.time for waypoint in self.way]
        ascending = bool(np.all(np.diff(times) > 0.0))
        require(ascending, "way", f"times {times}", "ascending times")

    @property
    def shape(self) -> ObstacleShape:
        """Its shape."""
        parts = tuple(part.capsule for part in self.parts)
        return ObstacleShape(self.kind, self.radius, self.height, parts)

    @property
    def curve(self) -> PchipInterpolator:
        """Its position over time, between the first and the last waypoint."""
        positions = np.array([waypoint.position for waypoint in self.way], dtype=float)
        return PchipInterpolator([waypoint.time for waypoint in self.way], positions)

    @property
    def largest_speed(self) -> float:
        """The largest speed of its trajectory [m/s]."""
        curve = self.curve
        times = np.concatenate(
            [np.linspace(a, b, 50) for a, b in zip(curve.x[:-1], curve.x[1:], strict=True)]
        )
        return float(np.linalg.norm(curve(times, 1), axis=1).max())

    @property
    def largest_acceleration(self) -> float:
        """The largest acceleration from time 0 on; infinite at a step of velocity [m/s^2]."""
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
    """Obstacles on their trajectories.

    Ports:
        state (output): Position and velocity of K obstacles, shape (6K,) [m, m/s].

    Args:
        obstacles: The K obstacles.
        period: Sampling time [s].
    """

    expands = False  # tables

    def __init__(self, obstacles: Sequence[ObstacleParameters], period: float) -> None:
        self._trajectories = [_Trajectory(obstacle.curve) for obstacle in obstacles]
        self._period = period
        self.inputs, self.states = {}, {}
        self.outputs = {"state": Port(6 * len(obstacles), "m, m/s")}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        time = ca.MX(t * self._period)
        return {"state": ca.vertcat(*[one.at(time) for one in self._trajectories])}


class _Trajectory:
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
    """Sensor model of obstacles.

    Attributes:
        position_noise: Standard deviation of white normal noise, cut at three deviations [m].
        velocity_noise: Standard deviation of the noise of velocities [m/s].
        period: Sampling time of measurements [s].
        delay: Delay of a measurement [s].
        seed: Seed of the noise.
    """

    position_noise: NotNegative = 0.008
    velocity_noise: NotNegative = 0.05
    period: Positive = 0.02
    delay: NotNegative = 0.06
    seed: Seed = 1

    def deviation(self, count: int) -> np.ndarray:
        """Return the standard deviation of the noise of ``count`` obstacles, shape (6 count,)."""
        one = np.repeat([self.position_noise, self.velocity_noise], 3)
        return np.tile(one, count)


class ObstacleSensor(Block):
    """Measures obstacles with a sampling time, a delay and noise.

    Ports:
        state (input): Position and velocity of K obstacles, shape (6K,) [m, m/s].
        noise (input, optional): Noise of NOISE_TICKS ticks, see
            :class:`~pfsc_drake.systems.physics.sensor_noise.SensorNoise`.
        obstacles (output): Delayed measurement, shape (6K,) [m, m/s]; without direct feedthrough.

    State:
        measured: Last measurement. delayed: Measurements within the delay, the oldest first.

    Args:
        count: K.
        every: Sampling time of measurements in ticks.
        late: Delay of measurements in ticks.
        deviation: Standard deviation of the noise, which is cut at three deviations, shape (6K,).
    """

    expands = False  # noise is a table

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
            self.states["delayed"] = late * self._size

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states."""
        delayed = {"delayed": ca.repmat(u.state, self._late, 1)} if self._late else {}
        return {"measured": u.state, **delayed}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"obstacles": x.delayed[: self._size] if self._late else x.measured}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick."""
        noise = noise_at(u.noise, self._size, t)
        cut = ca.fmin(ca.fmax(noise, -self._most), self._most)
        measures = ca.fmod(t, self._every) == 0.0
        delayed = {}
        if self._late:
            delayed["delayed"] = ca.vertcat(x.delayed[self._size :], x.measured)
        return {"measured": where(measures, u.state + cut, x.measured), **delayed}
