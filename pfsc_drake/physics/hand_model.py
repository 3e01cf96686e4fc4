"""Operator model: a hand on the tool as a spring-damper towards a moving target."""

from dataclasses import dataclass, field
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import where
from pfsc_drake.blocks.rotations import rotation_vector
from pfsc_drake.errors import require
from pfsc_drake.physics.hand_path import CoordinateMap, HandPath, OrientationTarget
from pfsc_drake.physics.scripted_force import FRAMES, smooth_step
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.rules import Numbers, OneOf, Parameters, Range, Seed


@dataclass
class Wander:
    """Random targets of an operator within a box.

    Attributes:
        low: Lower corner of the box, in the operator's frame, shape (3,) [m].
        high: Upper corner, shape (3,) [m].
        begin: Time at which the operator grasps the tool [s].
        end: End of the motion [s].
        shortest: Shortest time between targets [s].
        longest: Longest time between targets [s].
    """

    low: np.ndarray = field(default_factory=lambda: np.zeros(3), metadata=equal(3))
    high: np.ndarray = field(default_factory=lambda: np.zeros(3), metadata=equal(3))
    begin: float = 0.0
    end: float = 1.0
    shortest: float = 0.2
    longest: float = 1.0

    def __post_init__(self) -> None:
        self.low, self.high = (np.asarray(x, dtype=float) for x in (self.low, self.high))
        corners = [self.low.tolist(), self.high.tolist()]
        box = self.low.shape == self.high.shape == (3,) and bool(np.all(self.low <= self.high))
        require(box, "low, high", corners, "3 numbers each, low not above high")
        times = [self.begin, self.end]
        later = bool(np.isfinite(times).all()) and self.begin < self.end
        require(later, "begin, end", times, "finite numbers, the end after the begin")
        between = [self.shortest, self.longest]
        positive = 0.01 <= self.shortest <= self.longest < np.inf
        require(positive, "shortest, longest", between, "0.01 s or more, the longest the longer")

    def target_points(self, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Return ascending times [s], shape (k,), and target positions [m], shape (k, 3).

        Args:
            seed: Seed of the random numbers.
        """
        random = np.random.default_rng(seed)
        count = 2 + int((self.end - self.begin) / self.shortest)
        times = self.begin + np.cumsum(random.uniform(self.shortest, self.longest, count))
        times = np.concatenate([[self.begin], times[times < self.end]])
        return times, random.uniform(self.low, self.high, (len(times), 3))


_FARTHEST = 1e4  # m
_LARGEST = 1e9  # of stiffness, damping and force; products do not overflow
_LARGEST_ANGLE = 3600.0  # deg
# sinusoids per axis, enough for an irregular tremor
_TREMOR_LINES = 16


@dataclass
class HandWaypoint(Parameters):
    """Target of the operator: position of the tool point and orientation of the tool.

    Attributes:
        time: Time of arrival [s].
        position: Position in the operator's frame, shape (3,) [m].
        zyx_deg: ZYX angles (2.7) of the tool in the world, shape (3,) [deg]; empty for the angles
            of the previous waypoint.
    """

    time: float = 0.0
    position: Annotated[np.ndarray, Numbers(3, Range(-_FARTHEST, _FARTHEST, "m"))] = field(
        default_factory=lambda: np.zeros(3)
    )
    zyx_deg: Annotated[
        np.ndarray, Numbers(3, Range(-_LARGEST_ANGLE, _LARGEST_ANGLE, "deg"), empty=True)
    ] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        super().__post_init__()
        self.position = np.asarray(self.position, dtype=float)
        self.zyx_deg = np.asarray(self.zyx_deg, dtype=float)


_Strength = Annotated[float, Range(0.0, _LARGEST, open=True)]
_Weak = Annotated[float, Range(0.0, _LARGEST)]


@dataclass
class HandParameters(Parameters):
    """Parameters of an operator; stiffness and damping are in the range of a relaxed human arm.

    Attributes:
        waypoints: Waypoints of the target, in ascending time.
        frame: ``world``: positions are along the world's axes; ``manifold``: they are
            ``eta, xi_1, xi_2`` of the path.
        stiffness: K [N/m].
        damping: D [N s/m].
        rotational_stiffness: K_r [Nm/rad] of the orientations of the waypoints; zero for an
            operator without orientation targets.
        rotational_damping: D_r [Nm s/rad] of the grip.
        force_limit: Largest magnitude of the force [N].
        torque_limit: Largest magnitude of the torque [Nm].
        reaction_delay: Delay between observation and force [s]; a multiple of the sampling time, at
            most 10,000 of it.
        tremor: Standard deviation of the tremor force per axis [N].
        tremor_band: Lowest and highest frequency of the tremor [Hz], shape (2,).
        grip_ramp: Duration of grasping and of releasing the tool [s].
        release: Begin of the release [s]; infinite: never.
        seed: Seed of the random numbers.
        source: Source of the values.
        wander: Box of random targets instead of the waypoints; null for the waypoints.
    """

    waypoints: list[HandWaypoint] = field(default_factory=lambda: [HandWaypoint()])
    frame: Annotated[str, OneOf(FRAMES)] = "world"
    stiffness: _Strength = 300.0
    damping: _Weak = 30.0
    rotational_stiffness: _Weak = 0.0
    rotational_damping: _Weak = 0.0
    force_limit: _Strength = 45.0
    torque_limit: _Strength = 3.0
    reaction_delay: _Weak = 0.0
    tremor: _Weak = 0.0
    tremor_band: np.ndarray = field(default_factory=lambda: np.array([8.0, 12.0]))
    grip_ramp: _Strength = 0.2
    release: float = np.inf
    seed: Seed = 0
    source: str = "assumed"
    wander: Wander | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        band = np.asarray(self.tremor_band, dtype=float)
        fits = band.shape == (2,) and bool(0.0 < band[0] < band[1] < np.inf)
        require(fits, "tremor_band", band.tolist(), "2 positive and ascending frequencies")
        times = self.target_points()[0]
        ascending = times.size > 0 and bool(
            np.all(np.diff(times) > 0.0) and np.all(np.isfinite(times))
        )
        require(ascending, "waypoints", times.tolist(), "one or more with ascending times")
        require(self.release > times[0], "release", self.release, f"after {times[0]:g} s")
        self._check_turning()

    def _check_turning(self) -> None:
        oriented = [self.wander is None and point.zyx_deg.size > 0 for point in self.waypoints]
        turns, allowed = self.rotational_stiffness > 0.0, "0, or zyx_deg in the first waypoint"
        if turns or any(oriented):
            first = bool(oriented) and oriented[0]
            require(first, "rotational_stiffness", self.rotational_stiffness, allowed)
            allowed = "positive where waypoints have zyx_deg"
            require(turns, "rotational_stiffness", self.rotational_stiffness, allowed)

    def target_points(self) -> tuple[np.ndarray, np.ndarray]:
        """Return times and positions of the target, shapes (k,) [s] and (k, 3) [m]."""
        if self.wander is not None:
            return self.wander.target_points(self.seed)
        times = np.array([waypoint.time for waypoint in self.waypoints], dtype=float)
        return times, np.array([waypoint.position for waypoint in self.waypoints])

    def orientation(self) -> OrientationTarget | None:
        """Return the orientation target, or None."""
        if self.rotational_stiffness == 0.0:
            return None
        angles: list[np.ndarray] = []
        for waypoint in self.waypoints:
            angles.append(waypoint.zyx_deg if waypoint.zyx_deg.size else angles[-1])
        return OrientationTarget(self.target_points()[0], np.array(angles))


class HandModel:
    """Operator model: force of a hand on the tool as expressions of time and observations.

    The desired force and torque are ``f_c = K (p_d - y_t) + D (p_d' - y_t')`` and
    ``tau_c = K_r r + D_r (w_d - w)``. After the reaction delay the operator exerts
    ``s (limit(f_c + tremor))`` and ``s limit(tau_c)``: s rises from 0 to 1 while the tool is
    grasped and returns to 0 at its release; limits refer to the magnitude.

    The target ``p_d`` moves from waypoint to waypoint with minimum jerk, at rest in each, and so
    does ``R_d`` with its angular velocity w_d; ``r`` is axis times angle of ``R_d R_e'``. Without
    an orientation target the torque is ``-D_r w``. The tremor is a sum of sinusoids, whose
    frequencies and phases depend on the seed. Without delay and within its limits, an operator with
    a constant target is passive.

    Args:
        parameters: Parameters of the operator.
        to_world: Map of coordinates of the frame ``manifold`` to the world.

    Raises:
        InputError: If the waypoints are in the frame ``manifold`` and there is no path.
    """

    def __init__(self, parameters: HandParameters, to_world: CoordinateMap | None = None) -> None:
        self._parameters = parameters
        if parameters.frame == "manifold":
            require(to_world is not None, "frame", parameters.frame, "world without a path")
        else:
            to_world = None
        times, positions = parameters.target_points()
        self._times, self._path = times, HandPath(times, positions, to_world)
        self._orientation = parameters.orientation()
        random = np.random.default_rng(parameters.seed)
        low, high = parameters.tremor_band
        steps = np.arange(_TREMOR_LINES) + random.uniform(size=(3, _TREMOR_LINES))
        self._pulsations = 2.0 * np.pi * (low + (high - low) * steps / _TREMOR_LINES)
        self._phases = random.uniform(0.0, 2.0 * np.pi, (3, _TREMOR_LINES))

    @property
    def begin(self) -> float:
        """Time at which the tool is grasped [s]."""
        return float(self._times[0])

    @property
    def end(self) -> float:
        """Time at which the target comes to rest finally [s]."""
        return float(self._times[-1])

    def target(self, time: Any) -> tuple[Any, Any]:
        """Return ``p_d`` [m] and ``p_d'`` [m/s], in the world, shape (3,) each."""
        return self._path.at(time)

    def tremor(self, time: Any) -> Any:
        """Return the tremor force, shape (3,) [N]."""
        amplitude = self._parameters.tremor * np.sqrt(2.0 / _TREMOR_LINES)
        if amplitude == 0.0:
            return ca.DM.zeros(3)
        lines = ca.cos(ca.DM(self._pulsations) * time + ca.DM(self._phases))
        return amplitude * ca.sum2(lines)

    def grip(self, time: Any) -> Any:
        """Return the grip ``s``, from 0 to 1."""
        hand = self._parameters
        taking = smooth_step((time - self.begin) / hand.grip_ramp)
        if not np.isfinite(hand.release):
            return taking
        return taking * (1.0 - smooth_step((time - hand.release) / hand.grip_ramp))

    def desired_wrench(
        self, time: Any, y_t: Any, twist: Any, R_e: Any = None, reach: float = np.inf
    ) -> Any:
        """Return ``[f_c, tau_c]``, world axes, shape (6,) [N, Nm].

        Args:
            time: [s].
            y_t: Tool point [m], shape (3,).
            twist: ``[y_t', w]``, world axes, shape (6,) [m/s, rad/s].
            R_e: Orientation of the tool, shape (3, 3); None without an orientation target.
            reach: Distance beyond which the target is assumed to be at rest [m].
        """
        hand, (p_d, v_d) = self._parameters, self.target(time)
        if np.isfinite(reach):
            v_d = where(ca.norm_2(p_d - y_t) > reach, 0.0, v_d)
        force = hand.stiffness * (p_d - y_t) + hand.damping * (v_d - twist[:3])
        torque = -hand.rotational_damping * twist[3:]
        if self._orientation is not None and R_e is not None:
            R_d, w_d = self._orientation.at(time)
            turn = rotation_vector(R_d @ R_e.T)
            torque += hand.rotational_stiffness * turn + hand.rotational_damping * w_d
        return ca.vertcat(force, torque)

    def output_wrench(self, time: Any, desired_wrench: Any) -> Any:
        """Return the wrench on the tool, world axes, shape (6,) [N, Nm].

        Args:
            time: [s].
            desired_wrench: Desired wrench one reaction delay ago, shape (6,).
        """
        force = limit_magnitude(
            desired_wrench[:3] + self.tremor(time), self._parameters.force_limit
        )
        torque = limit_magnitude(desired_wrench[3:], self._parameters.torque_limit)
        return self.grip(time) * ca.vertcat(force, torque)


def observed_twist(before: Any, now: Any, period: float) -> Any:
    """Return ``[y_t', w]`` between two tool poses, world axes, shape (6,) [m/s, rad/s].

    ``w`` from the antisymmetric part of ``R_now R_before'``, for turns much below a radian.

    Args:
        before: ``[y_t, R_e by rows]``, shape (12,).
        now: The later pose.
        period: Time between them [s].
    """
    turn = orientation(now) @ orientation(before).T
    return ca.vertcat(now[:3] - before[:3], ca.inv_skew((turn - turn.T) / 2.0)) / period


def orientation(pose: Any) -> Any:
    """Return ``R_e`` of a tool pose ``[y_t, R_e by rows]``, shape (3, 3)."""
    return ca.reshape(pose[3:], 3, 3).T


def limit_magnitude(vector: Any, limit: float) -> Any:
    """Return a vector whose magnitude is limited, with the same direction."""
    size = ca.norm_2(vector)
    return where(size > limit, vector * (limit / size), vector)
