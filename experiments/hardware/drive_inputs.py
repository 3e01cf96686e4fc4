"""Inputs of a controller that drives a robot: joint state, torques, forces, obstacles."""

import numpy as np
from pydrake.systems.framework import Context

from diagrams.environment.measured_obstacles import REPORTED
from diagrams.robots.remote_arm import RemoteArm
from diagrams.station import Station
from experiments.hardware.check import FASTEST, LEAST_JUMP, TWICE
from pfsc_drake.drivers.remote_values import Request


class DriveInputs:
    """Inputs of a station for a robot in another process.

    Obstacles are NaN, so that the motion waits, before their first message, and if the last one is
    older than the watch's latency.

    Args:
        station: The station.

    Attributes:
        state: Joint state of the last tick, ``[q, v, q, v]``, shape (4N,).
        fastest: Speeds beyond any joint's [rad/s or m/s], shape (N,).
    """

    def __init__(self, station: Station) -> None:
        assert isinstance(station.part, RemoteArm)
        self._part = station.part
        robot = station.part.nominal_model.robot
        speed = robot.gather("velocity_limit")
        self.fastest = TWICE * np.where(np.isfinite(speed), speed, FASTEST)
        self.state, self._torque = np.zeros(4 * robot.dimension), np.zeros(robot.dimension)
        self._lost = np.zeros(robot.dimension, dtype=bool)
        self._obstacles, self._latency, self._until = None, 0.0, -np.inf
        crossing = station.crossing
        if crossing is not None:
            self._obstacles = station.diagram.GetSubsystemByName(REPORTED)
            self._latency = crossing.watch.latency
            self._unknown = np.full(6 * len(crossing.moving), np.nan)
            self._values = self._unknown

    def receive_obstacles(self, request: Request, time: float) -> None:
        """Update obstacles from a message, if it has any.

        Args:
            request: The message.
            time: Time of arrival by the robot's clock [s].
        """
        if self._obstacles is None or not request.obstacles:
            return
        fits = len(request.obstacles) == len(self._unknown)
        self._values = np.array(request.obstacles) if fits else self._unknown
        self._until = time + self._latency - request.age

    def without_jumps(
        self, state: np.ndarray, period: float, ticks: float
    ) -> tuple[np.ndarray, str | None]:
        """Return a state without positions that jumped farther than joints can move.

        With a single encoder per joint, no other measurement shows whether position or velocity is
        wrong. A joint that jumped is lost: its positions are NaN from then on.

        Args:
            state: Joint state of a status, shape (4N,).
            period: Sampling time [s].
            ticks: Number of sampling intervals since the last state; infinite if this is the first.

        Returns:
            State, shape (4N,), and a message about a joint that jumped, or None.
        """
        n = len(self._lost)
        with np.errstate(invalid="ignore"):
            step = np.abs(state[:n] - self.state[:n])
            jumped = (step > self.fastest * period * ticks + LEAST_JUMP) & ~self._lost
        message = None
        if jumped.any():
            joint = int(np.flatnonzero(jumped)[0])
            self._lost |= jumped
            message = (
                f"joint {joint + 1} jumped by {np.rad2deg(step[joint]):.3g} deg from one status to "
                "the next, faster than it can move"
            )
        is_position = np.tile(np.repeat([1, 0], n), 2)
        return np.where(is_position * np.tile(self._lost, 4), np.nan, state), message

    def between(
        self, state: np.ndarray, torque: np.ndarray, share: float, span: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return joint state and torques at a share of the time since the last tick.

        Args:
            state: Joint state at its end, shape (4N,).
            torque: Torques there, shape (N,).
            share: 0 to 1.
            span: The time [s].
        """
        torques = (1.0 - share) * self._torque + share * torque
        return state_between(self.state, state, share, span), torques

    def keep(self, state: np.ndarray, torque: np.ndarray) -> None:
        """Store joint state and torques of a tick, shapes (4N,) and (N,)."""
        self.state, self._torque = state, torque

    def set_inputs(
        self,
        root: Context,
        time: float,
        state: np.ndarray,
        torque: np.ndarray,
        wrench: np.ndarray | None,
    ) -> None:
        """Set the inputs of the station.

        Args:
            root: Context of the diagram.
            time: Current time by the robot's clock [s].
            state: Joint state, shape (4N,).
            torque: Torques of the joints, shape (N,).
            wrench: Force and torque on the sensor, shape (6,), or None.
        """
        self._part.set_measurement(root, state, torque)
        values = {}
        if self._obstacles is not None:
            values[self._obstacles] = self._values if time <= self._until else self._unknown
        if self._part.wrench is not None and wrench is not None:
            values[self._part.wrench] = wrench
        for source, value in values.items():
            context = source.GetMyMutableContextFromRoot(root)
            source.get_mutable_source_value(context).SetFromVector(value)


def state_between(before: np.ndarray, after: np.ndarray, share: float, span: float) -> np.ndarray:
    """Return the joint state at a share of a span of time, positions being cubic in it.

    Args:
        before: ``[q, v, q, v]`` at its beginning, shape (4N,).
        after: ``[q, v, q, v]`` at its end, shape (4N,).
        share: 0 to 1.
        span: The time between both [s].
    """
    q_0, v_0 = np.split(before, 4)[:2]
    q_1, v_1 = np.split(after, 4)[:2]
    rest = 1.0 - share
    square = share * share
    weights = (square * (3.0 - 2.0 * share), span * share * (rest * rest), span * square * rest)
    rates = (6.0 * share * rest / span, rest * (1.0 - 3.0 * share), share * (1.0 - 3.0 * rest))
    q = q_0 + weights[0] * (q_1 - q_0) + weights[1] * v_0 - weights[2] * v_1
    v = rates[0] * (q_1 - q_0) + rates[1] * v_0 + rates[2] * v_1
    return np.concatenate([q, v, q, v])
