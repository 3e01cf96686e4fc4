"""Control of a robot by messages: one tick for each received status."""

import time
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.robots.remote_arm import RemoteArm
from diagrams.station import Station
from experiments.hardware.check import (
    AT_REST,
    BRIDGED,
    LARGEST_GAP,
    LONGEST_STOP,
    RESTED_FOR,
    STOP_FACTOR,
    STOP_SPEED,
    check_first,
)
from experiments.hardware.drive_inputs import DriveInputs
from experiments.results.run_log import RunLog
from experiments.simulation import SimulationResult
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.drivers.link import ControllerEndpoint
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode, RobotStatus
from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Request
from pfsc_drake.physics.driver import torque_rates
from pfsc_drake.robot.robot_model import gravity_function

# state of the reference with its own time and its speed scaling
SPEED_SCALING = "controller.reference_generator.pace"
# largest rate of commanded torques, as in drivers [Nm/s], and share of a joint's effort limit
_TORQUE_RATE, _EFFORT_SHARE = 1000.0, 0.95
_US = 1e6
_FAULT = "a fault"
_SECOND = 1000  # ticks


@dataclass
class DrivenTick:
    """Record of one tick.

    Attributes:
        age: Time from its status to its command [s]; NaN without a status.
        missed: 1 without a status.
        clipped: Number of joints with limited commands.
        robot_mode: Mode of the robot.
        sent: Command, shape (N,).
        override: Requested speed scaling.
    """

    age: float
    missed: int
    clipped: int
    robot_mode: int
    sent: np.ndarray
    override: float


class Drive:
    """Controller of a station, advanced by the status messages of a robot.

    Args:
        station: A station for a robot in another process.
        end: The link.
        override: Initial speed scaling of the reference.

    Attributes:
        period: Sampling time [s].
        mode: Kind of the commands.
        limit: Largest commanded torques [Nm or N], shape (N,).
        rate: Their largest rates [Nm/s or N/s], shape (N,).
        inputs: Inputs of the station.
        ticks: Records of the ticks.
        fault: Reason of the end, or None.
        override: Requested speed scaling of the reference.
        largest_scaling: Largest speed scaling.
        motion_time: Time in the planned motion [s].
        has_motion: Whether the reference moves by itself, not by hand guiding.
    """

    def __init__(self, station: Station, end: ControllerEndpoint, override: float = 1.0) -> None:
        assert isinstance(station.part, RemoteArm)
        self._station, self._part, self._end = station, station.part, end
        self.inputs, self.ticks = DriveInputs(station), list[DrivenTick]()
        robot = station.part.nominal_model.robot
        self._n, self.period = robot.dimension, station.controller.period
        self._weight = gravity_function(robot)
        effort = robot.gather("effort_limit")
        self.limit = _EFFORT_SHARE * effort
        self.rate = torque_rates(_TORQUE_RATE, effort)
        self._q, self.mode = station.start_posture, command_mode(station)
        self._simulator = Simulator(station.diagram)
        self._first: RobotStatus | None = None
        self._sent: np.ndarray | None = None
        self._tick = self._resting = 0
        self._stopping: str | None = None
        self._stop_time, self._stop_speed = 0.0, np.inf
        self.fault: str | None = None
        self.largest_scaling, plan = LARGEST_OVERRIDE, station.task.drive_plan
        if plan is not None:
            r = station.law.linearization.relative_degree
            self.largest_scaling = min(LARGEST_OVERRIDE, plan.largest_scaling(r))
        self.override, self.motion_time = min(override, self.largest_scaling), 0.0
        self.has_motion = not isinstance(station.task, SpaceTask)

    @property
    def root(self) -> Context:
        """Context of the diagram."""
        return self._simulator.get_mutable_context()

    @property
    def time(self) -> float:
        """Time since the first status by the robot's clock [s]."""
        return self._tick * self.period

    def begin(self, status: RobotStatus) -> np.ndarray:
        """Check a robot before it moves, and return the first command, shape (N,).

        Args:
            status: Its first status.

        Raises:
            InputError: If it is not the robot of the scenario, at rest at the scenario's start.
        """
        check_first(status, self.mode, self._station.start_posture)
        self._first = status
        self._station.set_start(self.root)
        self._set_inputs(self._state(status), status.torque)
        self._part.set_override(self.root, self.override)
        self._simulator.Initialize()
        return self._command()

    def answer(self, status: RobotStatus, received: float | None = None) -> None:
        """Advance to the tick of a status, and send the command.

        Args:
            status: The status.
            received: Its arrival time by ``time.perf_counter`` [s].
        """
        assert self._first is not None
        received = time.perf_counter() if received is None else received
        number = round((status.utime - self._first.utime) / (_US * self.period))
        missed = number - self._tick
        if missed < 0:
            return  # an old one
        if missed * self.period > LARGEST_GAP:
            self.lose(f"the robot's clock jumped by {missed * self.period:.3g} s")
            return
        ticks = missed + 1 if self._tick > 0 else np.inf
        state, jumped = self.inputs.without_jumps(self._state(status), self.period, ticks)
        if jumped is not None:
            self.stop(jumped)
        self._bridge(state, missed, status)
        if missed > BRIDGED:
            self.stop(f"no status of the robot for {1e3 * missed * self.period:.0f} ms")
        self._set_inputs(state, status.torque)
        q = state[: self._n]
        self._q = np.where(np.isfinite(q), q, self._q)
        # send the command first, update and log afterwards
        before = self.root.get_time()
        self.root.SetTime(self.time)
        command = self._command()
        values, clipped = self._within_limits(command)
        if not np.isfinite(values).all():
            self.root.SetTime(before)
            self.lose("the controller's command is not finite")
            return
        faulty = self._station.controller.fault(self._station.blocks, self.root)
        if faulty and self._stopping is None:
            self._begin_stop(_FAULT)
        self._end.send(RobotCommand(status.utime, self.mode, values))
        age = time.perf_counter() - received
        self._sent = values
        self.root.SetTime(before)
        self._advance(
            DrivenTick(age, missed, clipped, int(status.robot_mode), values, self.override)
        )
        self.inputs.keep(state, status.torque)
        self._look(status, state)

    def handle_request(self, request: Request) -> None:
        """Apply a request from the next tick on.

        Args:
            request: The request.
        """
        if request.override is not None:
            self.override = min(request.override, self.largest_scaling)
            self._part.set_override(self.root, self.override)
        self.inputs.receive_obstacles(request, self.time)
        if request.stop:
            self.stop("stop requested")

    def progress(self) -> dict[str, float]:
        """Return progress and state as numbers by name, for monitoring."""
        last = self.ticks[-1]
        layout, law = self._station.law.layout, self._station.law.linearization
        names = [coordinate.name for coordinate in law.manifold.coordinates]
        row = self._station.log.now(self._station.blocks, self.root)["law"]
        values = row[layout.manifold_state][: len(names)].tolist()
        return {
            "time": self.time,
            "motion_time": self.motion_time,
            "override": self.override,
            "stopping": float(self._stopping is not None),
            "ended": float(self.has_ended),
            "missed": float(sum(tick.missed for tick in self.ticks[-_SECOND:])),
            "clipped": float(last.clipped),
            "status_age": last.age,
            **dict(zip(names, values, strict=True)),
        }

    def stop(self, why: str) -> None:
        """Let the controller bring the robot to rest, then end.

        Args:
            why: Reason for messages.
        """
        if self._stopping is None:
            self._begin_stop(why)
            self._part.request_stop(self.root)

    def _begin_stop(self, why: str) -> None:
        n = self._n
        self._stopping, self._stop_time = why, self.time
        self._stop_speed = (
            STOP_FACTOR * np.nanmax(np.abs(self.inputs.state[n : 2 * n])) + STOP_SPEED
        )

    @property
    def has_ended(self) -> bool:
        """Whether commands have ended, so that the robot's driver damps it."""
        if self.fault is not None:
            return True
        if self._stopping is None:
            return False
        long = self.time - self._stop_time > LONGEST_STOP
        return long or self._resting * self.period > RESTED_FOR

    def lose(self, why: str) -> None:
        """End immediately, without a stop.

        Args:
            why: Reason for messages.
        """
        self.fault = why

    def result(self, wall: float) -> SimulationResult:
        """Return the result of the run.

        Args:
            wall: Wall clock time [s].
        """
        found = self._station.found_fault(self.root)
        reason, since = self.fault, None
        if found is not None:
            reason, since = found.sentence, found.time
        if self._stopping is not None and reason is not None and self._stopping != _FAULT:
            reason = self._stopping
        if self.fault is not None:
            reason = self.fault
        return SimulationResult(self.root, self.time / max(wall, 1e-9), reason, since)

    def add_to(self, log: RunLog) -> None:
        """Add the records of the ticks to the log of a run.

        Args:
            log: The log.
        """
        noted = self.ticks[: len(log.time)]
        noted += [noted[-1]] * (len(log.time) - len(noted))
        modes = [mode.name.lower() for mode in RobotMode]
        log.add("status_age", [1e6 * tick.age for tick in noted])
        for name in ("missed", "clipped", "sent", "override"):
            log.add(name, [getattr(tick, name) for tick in noted])
        log.add("robot_mode", [tick.robot_mode for tick in noted], labels=modes)

    def _state(self, status: RobotStatus) -> np.ndarray:
        """Return ``[q_J, v_J, q_M, v_M]`` of a status, shape (4N,)."""
        return np.concatenate([status.q, status.v, status.q, status.v])

    def _set_inputs(self, state: np.ndarray, torque: np.ndarray) -> None:
        self.inputs.set_inputs(self.root, self.time, state, torque, self._end.wrench)

    def _command(self) -> np.ndarray:
        """Return the command to the robot: torques without gravity, or velocities."""
        drive = self._station.controller.drive(self._station.blocks, self.root)
        if self.mode is ControlMode.VELOCITY:
            return drive
        return drive - self._weight(self._q).full().ravel()

    def _within_limits(self, command: np.ndarray) -> tuple[np.ndarray, int]:
        """Return the limited command, and the number of limited joints."""
        if self.mode is ControlMode.VELOCITY:
            return command, 0
        values = np.clip(command, -self.limit, self.limit)
        if self._sent is not None:
            most = self.rate * self.period
            values = self._sent + np.clip(values - self._sent, -most, most)
        return values, int(np.count_nonzero(np.abs(values - command) > 1e-9))

    def _bridge(self, state: np.ndarray, missed: int, status: RobotStatus) -> None:
        """Advance the controller through missed ticks with an interpolated motion of the robot.

        Positions are cubic in time, velocities their rates: inconsistent values would cause a
        fault, and a stop would begin at a wrong position.
        """
        for k in range(1, missed + 1):
            share, span = k / (missed + 1), (missed + 1) * self.period
            self._set_inputs(*self.inputs.between(state, status.torque, share, span))
            last = np.zeros(self._n) if self._sent is None else self._sent
            self._advance(DrivenTick(np.nan, 1, 0, int(status.robot_mode), last, self.override))

    def _advance(self, tick: DrivenTick) -> None:
        self.ticks.append(tick)
        # beyond the tick, so that it is logged with its measurements
        self._simulator.AdvanceTo((self._tick + 0.5) * self.period)
        self._tick += 1
        self.motion_time += self.period * self._speed_scaling()

    def _speed_scaling(self) -> float:
        """Return the filtered speed scaling of the reference."""
        if not self.has_motion:
            return 1.0
        return float(self._station.blocks.state(self.root, SPEED_SCALING)[1])

    def _look(self, status: RobotStatus, state: np.ndarray) -> None:
        """Stop if the leader is lost; end if the robot does not follow commands."""
        leader = self._station.leader
        if leader is not None and leader.is_lost:
            self.stop(f"no message of the leader for {leader.patience:g} s")
        if status.robot_mode is not RobotMode.MOVE:
            self.lose(f"the robot went into mode {status.robot_mode.name}")
        speed = np.abs(state[self._n : 2 * self._n]).max()
        if speed > self._stop_speed:
            why = self._stopping if self._stopping != _FAULT else self.result(1.0).fault
            self.lose(f"{why}; the stop accelerated the robot and was left to its driver")
            self._end.send(RobotCommand(status.utime, self.mode, np.zeros(self._n)))
        # a joint with NaN velocity does not count as resting
        self._resting = self._resting + 1 if speed <= AT_REST else 0


def command_mode(station: Station) -> ControlMode:
    """Return the kind of a law's commands, torque or velocity.

    Args:
        station: The station.
    """
    torques = station.law.linearization.relative_degree > 1
    return ControlMode.TORQUE if torques else ControlMode.VELOCITY
