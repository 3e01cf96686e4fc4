"""Slow motion of one joint after the other, to check torques and directions of a robot."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from diagrams.robots.remote_arm import RemoteArm
from experiments.finished_run import steady_clock
from experiments.hardware.check import FOREIGN, check_alone, check_ready, listen
from experiments.hardware.drive import command_mode
from experiments.hardware.driven_run import prepare_driven, real_time_priority
from experiments.hardware.statics import StaticCheck, check_statics
from experiments.scenario_file import ScenarioFile
from pfsc_drake.checks import require_between
from pfsc_drake.drivers.driver_rules import check_mode
from pfsc_drake.drivers.link import ControllerEndpoint
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode, RobotStatus
from pfsc_drake.physics.velocity_servo import joint_inertia
from pfsc_drake.robot.robot_model import mass_function
from pfsc_drake.robot.serial.chain import SerialChain
from reporting.interruption import watch_interruption
from reporting.progress import ProgressListener

_LEAST, _LARGEST = 0.5, 20.0  # deg
_OF_A_JOINT, _SETTLING = 5.0, 1.0  # s
# of the servo that moves the joints, in addition to the robot's gravity compensation [1/s]
_BANDWIDTH = 15.0
# share of the drives' effort limits
_EFFORT = 0.2
# largest tracking error of a joint [rad]
_LOST = np.deg2rad(3.0)
_SILENCE = 0.1  # s
_BINS = 8
# limits of the ratio of reported velocity to the derivative of the position
_SLOWEST, _FASTEST = 0.5, 1.5


class JointTour:
    """Motion of one joint after the other out and back, along a cosine.

    Torques in addition to the robot's gravity compensation come from a PID controller with a triple
    pole, which needs only a rough inertia of each joint::

        tau = D (3 w^2 e + 3 w e' + w^3 int e)

    Args:
        robot: Nominal model, N joints.
        start: Initial posture at rest, shape (N,) [rad or m].
        degrees: Travel of each joint [deg], towards the middle of its range.
        mode: Kind of the commands, torque or velocity.
        period: Sampling time [s].

    Raises:
        InputError: If the angle is out of range.

    Attributes:
        mode: See above.
        dimension: N.
        duration: Duration of the motion [s].
    """

    def __init__(
        self,
        robot: SerialChain,
        start: np.ndarray,
        degrees: float,
        mode: ControlMode,
        period: float,
    ) -> None:
        require_between("--move", degrees, _LEAST, _LARGEST, "deg")
        n = robot.dimension
        self._start, self.mode, self._period, self.dimension = start, mode, period, n
        lower, upper = robot.gather("position_limits").T
        with np.errstate(invalid="ignore"):
            middle = np.where(np.isfinite(lower + upper), (lower + upper) / 2.0, start)
        self._stroke = np.deg2rad(degrees) * np.where(middle >= start, 1.0, -1.0)
        self._inertia = joint_inertia(robot, start)
        self._mass = np.array(mass_function(robot)(start)) + np.diag(robot.D_M)
        self._most = _EFFORT * robot.gather("effort_limit")
        self._sum = np.zeros(n)
        self.duration = _SETTLING + n * _OF_A_JOINT

    def desired(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return desired positions, velocities and accelerations of the joints, each (N,).

        Args:
            time: Time since the beginning [s].
        """
        q, v, a = self._start.copy(), np.zeros(self.dimension), np.zeros(self.dimension)
        joint, phase = divmod(max(time - _SETTLING, 0.0), _OF_A_JOINT)
        if joint < self.dimension:
            i, w = int(joint), 2.0 * math.pi / _OF_A_JOINT
            q[i] += self._stroke[i] * (1.0 - math.cos(w * phase)) / 2.0
            v[i] = self._stroke[i] * w * math.sin(w * phase) / 2.0
            a[i] = self._stroke[i] * w**2 * math.cos(w * phase) / 2.0
        return q, v, a

    def command(self, time: float, status: RobotStatus) -> np.ndarray:
        """Return the command, shape (N,).

        Args:
            time: Time since the beginning [s].
            status: Its status.
        """
        q, v, _ = self.desired(time)
        e, w = q - status.q, _BANDWIDTH
        if self.mode is ControlMode.VELOCITY:
            return v + w * e
        self._sum += self._period * e
        tau = self._inertia * (3.0 * w**2 * e + 3.0 * w * (v - status.v) + w**3 * self._sum)
        return np.clip(tau, -self._most, self._most)

    def inertial(self, time: float) -> np.ndarray:
        """Return the torques that accelerate the joints, shape (N,).

        Args:
            time: Time since the beginning [s].
        """
        return self._mass @ self.desired(time)[2]

    def lost(self, time: float, status: RobotStatus) -> str | None:
        """Return a message about a joint that does not follow, or None.

        Args:
            time: Time since the beginning [s].
            status: The robot's status.
        """
        off = status.q - self.desired(time)[0]
        worst = int(np.abs(off).argmax())
        if not abs(off[worst]) > _LOST:
            return None
        return (
            f"joint {worst + 1} is {np.rad2deg(off[worst]):.1f} deg from its commanded position: "
            "does it turn in the opposite direction, or is it blocked?"
        )


def move_slowly(
    end: ControllerEndpoint,
    tour: JointTour,
    interrupted: Callable[[], bool],
    progress: Callable[[float, str], None],
) -> tuple[np.ndarray, np.ndarray, str | None]:
    """Move each joint of a robot slowly out and back, and return its measurements.

    After any error commands end, so that the robot's driver damps it.

    Args:
        end: The link.
        tour: The motion.
        interrupted: Whether to end.
        progress: Progress listener.

    Returns:
        Postures, shape (M, N) [rad or m]; torques measured there minus inertial torques, mean of
        both directions to cancel friction, shape (M, N) [Nm or N], NaN for resting joints, whose
        friction is unknown; and a message about an error, or None.
    """
    heard, begin, complaint, last_report = [], None, None, -1.0
    while complaint is None:
        status = end.receive(_SILENCE)
        if status is None:
            complaint = f"no status of the robot for {1e3 * _SILENCE:.0f} ms"
            break
        begin = status.utime if begin is None else begin
        time = 1e-6 * (status.utime - begin)
        if time > tour.duration:
            break
        if interrupted():
            complaint = "interrupted"
        elif end.foreign:
            complaint = FOREIGN
        elif status.robot_mode is not RobotMode.MOVE:
            complaint = f"the robot went into mode {status.robot_mode.name}"
        elif not (np.isfinite(status.q).all() and np.isfinite(status.v).all()):
            complaint = "the robot's positions or velocities are not finite"
        else:
            complaint = tour.lost(time, status)
        if complaint is None:
            end.send(RobotCommand(status.utime, tour.mode, tour.command(time, status)))
            heard.append((time, replace(status, torque=status.torque - tour.inertial(time))))
            if time - last_report > 0.2:
                last_report = time
                progress(time, "moving one joint after the other")
    if complaint is None:
        complaint = _velocity_complaint(heard)
    return *_means(heard, tour.dimension), complaint


def _velocity_complaint(heard: list[tuple[float, RobotStatus]]) -> str | None:
    """Return a message about a joint whose velocity contradicts its position, or None."""
    t = np.array([time for time, _ in heard])
    q, v = (np.array([getattr(s, name) for _, s in heard]) for name in ("q", "v"))
    rate = np.gradient(q, t, axis=0) if len(t) > 2 else np.zeros_like(v)
    for i in range(q.shape[1]):
        own = (t - _SETTLING >= i * _OF_A_JOINT) & (t - _SETTLING < (i + 1) * _OF_A_JOINT)
        ratio = (rate[own, i] @ v[own, i]) / max(rate[own, i] @ rate[own, i], 1e-12)
        if own.any() and not _SLOWEST < ratio < _FASTEST:
            return (
                f"joint {i + 1} reports {ratio:.2f} times the derivative of its position as "
                "velocity; "
                "is its sign or unit wrong?"
            )
    return None


def _means(heard: list[tuple[float, RobotStatus]], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return postures and torques of the moving joint, the mean of both directions, (M, N)."""
    t = np.array([time for time, _ in heard]) - _SETTLING
    q, torque = (np.array([getattr(s, name) for _, s in heard]) for name in ("q", "torque"))
    joint, phase = np.divmod(t, _OF_A_JOINT)
    # the same position out and back, except at the reversal
    bins = (np.abs(phase / _OF_A_JOINT - 0.5) * 2.0 * _BINS).astype(int)
    back = phase >= _OF_A_JOINT / 2.0
    postures, torques = [], []
    for i in range(n):
        for k in range(1, _BINS - 1):
            there = (joint == i) & (bins == k)
            directions = [there & ~back, there & back]
            if all(direction.any() for direction in directions):
                postures.append(
                    np.mean([q[direction].mean(axis=0) for direction in directions], axis=0)
                )
                torques.append(np.full(n, np.nan))
                torques[-1][i] = np.mean([torque[direction, i].mean() for direction in directions])
    return np.array(postures).reshape(-1, n), np.array(torques).reshape(-1, n)


def check_scenario(
    scenario: ScenarioFile,
    end: ControllerEndpoint,
    progress: ProgressListener,
    degrees: float = 0.0,
) -> StaticCheck:
    """Compare a robot's torques with those of a scenario's model, at rest and in slow motion.

    Args:
        scenario: The scenario as read.
        end: The link to the robot.
        progress: Progress listener.
        degrees: Travel of each joint [deg]; if 0, nothing is sent.

    Raises:
        InputError: If the scenario is wrong, or the robot is a different one, silent, or moving.
    """
    progress(0.0, "preparing")
    station = prepare_driven(scenario, None, recording=False, progress=progress).station
    assert isinstance(station.part, RemoteArm)
    progress(0.0, "listening")
    model, period = station.part.nominal_model.robot, station.controller.period
    assert isinstance(model, SerialChain)
    status = listen(end, period)
    if not degrees:
        return check_statics(model, status.q[None], status.torque[None])
    mode = command_mode(station)
    check_mode(mode, end.dialect.modes, end.dialect.name)
    check_ready(status, mode, model.dimension)
    check_alone(end)
    tour = JointTour(model, status.q, degrees, mode, period)
    with steady_clock(), watch_interruption() as interrupted, real_time_priority():
        q, torque, complaint = move_slowly(end, tour, interrupted, progress)
    # at rest, friction carries an unknown part of the load
    at_rest = status.torque * (np.nan if len(q) else 1.0)
    found = check_statics(model, np.vstack([status.q, q]), np.vstack([at_rest, torque]))
    return replace(found, measured=np.vstack([status.torque, torque]), complaint=complaint)
