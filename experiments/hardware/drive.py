"""A controller that drives a robot by messages: one tick for each status that comes."""

import time

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.robots.remote_arm import RemoteArm
from diagrams.station import Station
from experiments.hardware.bridge import state_between
from experiments.hardware.check import AT_REST, check_first
from experiments.hardware.drive_options import (
    FASTER,
    FASTEST,
    LARGEST_GAP,
    LEAST_JUMP,
    LEAST_SPEED,
    LONGEST_STOP,
    PACE,
    RESTED,
    TWICE,
    DriveOptions,
    command_mode,
)
from experiments.hardware.drive_record import DrivenTick, DriveRecord
from experiments.hardware.told_obstacles import ToldObstacles
from experiments.simulation import SimulationResult
from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode, RobotStatus
from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Request
from pfsc_drake.following.tasks.space_task import SpaceTask
from pfsc_drake.physics.driver import torque_rates
from pfsc_drake.robot.robot_model import gravity_function

_US = 1e6
_FAULT = "a fault"
_SECOND = 1000  # ticks


class Drive:
    """A station's controller, advanced by what a robot tells.

    Args:
        station: A station whose robot stands elsewhere.
        end: The link.
        options: What it allows itself.
        override: Share of its planned pace at which the reference moves at first.

    Attributes:
        period: Sampling time [s].
        mode: What the robot is commanded by.
        limit: Largest torques that are sent [Nm or N], shape (N,).
        rate: How fast they may change [Nm/s or N/s], shape (N,).
        fastest: Speeds that no joint can have [rad/s or m/s], shape (N,).
        record: What happened.
        fault: Why it ended, or None.
        override: Share of its planned pace at which the reference is to move.
        fastest_pace: Largest share of the planned pace.
        motion_time: How far it is in the time of the motion as planned [s].
        has_motion: Whether the reference moves by itself, not because a hand leads the tool.
    """

    def __init__(
        self,
        station: Station,
        end: ControllerEnd,
        options: DriveOptions,
        override: float = 1.0,
    ) -> None:
        assert isinstance(station.part, RemoteArm)
        self._station, self._part, self._end, self._options = station, station.part, end, options
        robot = station.part.belief.robot
        self._n, self.period = robot.dimension, station.controller.period
        self._weight = gravity_function(robot)
        effort = robot.gather("effort_limit")
        self.limit = options.effort_share * effort
        speed = robot.gather("velocity_limit")
        self.fastest = TWICE * np.where(np.isfinite(speed), speed, FASTEST)
        self._lost = np.zeros(self._n, dtype=bool)
        self.rate = torque_rates(options.torque_rate, effort)
        self._q = station.start_posture
        self.mode = command_mode(station)
        self._simulator, self._obstacles = Simulator(station.diagram), ToldObstacles(station)
        self._first: RobotStatus | None = None
        self._last_state, self._last_torque = np.zeros(4 * self._n), np.zeros(self._n)
        self._sent: np.ndarray | None = None
        self._tick = 0
        self._stopping: str | None = None
        self._stop_time, self._stop_speed = 0.0, np.inf
        self._resting = 0
        self.record = DriveRecord()
        self.fault: str | None = None
        self.fastest_pace, plan = LARGEST_OVERRIDE, station.task.drive_plan
        if plan is not None:
            r = station.law.linearization.relative_degree
            self.fastest_pace = min(LARGEST_OVERRIDE, plan.fastest_pace(r))
        self.override, self.motion_time = min(override, self.fastest_pace), 0.0
        self.has_motion = not isinstance(station.task, SpaceTask)

    @property
    def root(self) -> Context:
        """Context of the diagram."""
        return self._simulator.get_mutable_context()

    @property
    def time(self) -> float:
        """Time since the first status, as the robot counts it [s]."""
        return self._tick * self.period

    def begin(self, status: RobotStatus) -> np.ndarray:
        """Check a robot before anything moves, and return what it would be told first, shape (N,).

        Args:
            status: Its first status.

        Raises:
            InputError: If it is not the robot of the scenario, at rest at the scenario's start.
        """
        check_first(status, self.mode, self._station.start_posture)
        self._first = status
        self._station.set_start(self.root)
        self._tell(self._state(status), status.torque)
        self._part.set_override(self.root, self.override)
        self._simulator.Initialize()
        return self._wanted()

    def answer(self, status: RobotStatus, received: float | None = None) -> None:
        """Go on by the tick that a status tells of, and send what the robot is to do.

        Args:
            status: The status.
            received: When it came, by ``time.perf_counter`` [s].
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
        state = self._believed(self._state(status), missed + 1)
        self._bridge(state, missed, status)
        if missed > self._options.bridged:
            self.stop(f"no status of the robot for {1e3 * missed * self.period:.0f} ms")
        self._tell(state, status.torque)
        q = state[: self._n]
        self._q = np.where(np.isfinite(q), q, self._q)
        # the answer first, and what is to be remembered and logged afterwards
        before = self.root.get_time()
        self.root.SetTime(self.time)
        wanted = self._wanted()
        values, clipped = self._within_limits(wanted)
        if not np.isfinite(values).all():
            self.root.SetTime(before)
            self.lose("the controller wants what is no finite number")
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
        self._last_state, self._last_torque = state, status.torque
        self._look(status, state)

    def heed(self, request: Request) -> None:
        """Do what somebody asks for, from the next tick on.

        Args:
            request: What.
        """
        if request.override is not None:
            self.override = min(request.override, self.fastest_pace)
            self._part.set_override(self.root, self.override)
        self._obstacles.hear(request, self.time)
        if request.stop:
            self.stop("asked to stop")

    def progress(self) -> dict[str, float]:
        """Return how far it is and how well it goes, numbers by name for who watches."""
        last = self.record.ticks[-1]
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
            "missed": float(sum(tick.missed for tick in self.record.ticks[-_SECOND:])),
            "clipped": float(last.clipped),
            "status_age": last.age,
            **dict(zip(names, values, strict=True)),
        }

    def stop(self, why: str) -> None:
        """Let the controller bring the robot to rest, and end then.

        Args:
            why: What is said of it.
        """
        if self._stopping is None:
            self._begin_stop(why)
            self._part.request_stop(self.root)

    def _begin_stop(self, why: str) -> None:
        n = self._n
        self._stopping, self._stop_time = why, self.time
        self._stop_speed = FASTER * np.nanmax(np.abs(self._last_state[n : 2 * n])) + LEAST_SPEED

    @property
    def has_ended(self) -> bool:
        """Whether nothing more is to be sent: the robot's driver damps then."""
        if self.fault is not None:
            return True
        if self._stopping is None:
            return False
        long = self.time - self._stop_time > LONGEST_STOP
        return long or self._resting * self.period > RESTED

    def lose(self, why: str) -> None:
        """End at once: there is no robot that would hear.

        Args:
            why: What is said of it.
        """
        self.fault = why

    def result(self, wall: float) -> SimulationResult:
        """Return what came of it.

        Args:
            wall: How long it took [s].
        """
        found = self._station.found_fault(self.root)
        said, since = self.fault, None
        if found is not None:
            said, since = found.sentence, found.time
        if self._stopping is not None and said is not None and self._stopping != _FAULT:
            said = self._stopping
        if self.fault is not None:
            said = self.fault
        return SimulationResult(self.root, self.time / max(wall, 1e-9), said, since)

    def _state(self, status: RobotStatus) -> np.ndarray:
        """Return ``[q_J, v_J, q_M, v_M]`` of a status, shape (4N,)."""
        return np.concatenate([status.q, status.v, status.q, status.v])

    def _believed(self, state: np.ndarray, ticks: int) -> np.ndarray:
        """Return a state without positions that have jumped farther than joints can move.

        Where one encoder stands for both sides of a joint, nothing else tells whether its position
        or its velocity is wrong.
        """
        n = self._n
        with np.errstate(invalid="ignore"):
            step = np.abs(state[:n] - self._last_state[:n])
            jumped = (step > self.fastest * self.period * ticks + LEAST_JUMP) & ~self._lost
        if self._tick > 0 and jumped.any():
            joint = int(np.flatnonzero(jumped)[0])
            self._lost |= jumped
            self.stop(
                f"joint {joint + 1} jumped by {np.rad2deg(step[joint]):.3g} deg from one status to "
                "the next, faster than it can move"
            )
        return np.where(np.tile(np.repeat([1, 0], n), 2) * np.tile(self._lost, 4), np.nan, state)

    def _tell(self, state: np.ndarray, torque: np.ndarray) -> None:
        self._part.tell(self.root, state, torque)
        self._obstacles.tell(self.root, self.time)
        if self._part.wrench is not None and self._end.wrench is not None:
            context = self._part.wrench.GetMyMutableContextFromRoot(self.root)
            self._part.wrench.get_mutable_source_value(context).SetFromVector(self._end.wrench)

    def _wanted(self) -> np.ndarray:
        """Return what the robot is to be told: torques without the weight, or velocities."""
        drive = self._station.controller.drive(self._station.blocks, self.root)
        if self.mode is ControlMode.VELOCITY:
            return drive
        return drive - self._weight(self._q).full().ravel()

    def _within_limits(self, wanted: np.ndarray) -> tuple[np.ndarray, int]:
        """Return what is sent, and in how many joints that is less."""
        if self.mode is ControlMode.VELOCITY:
            return wanted, 0
        values = np.clip(wanted, -self.limit, self.limit)
        if self._sent is not None:
            most = self.rate * self.period
            values = self._sent + np.clip(values - self._sent, -most, most)
        return values, int(np.count_nonzero(np.abs(values - wanted) > 1e-9))

    def _bridge(self, state: np.ndarray, missed: int, status: RobotStatus) -> None:
        """Let the controller see, tick by tick, what the robot may have done in between.

        Positions are cubic in time, and velocities their rates: what contradicts itself would be
        a fault, and a stop would begin where the robot was then.
        """
        for k in range(1, missed + 1):
            share = k / (missed + 1)
            self._tell(
                state_between(self._last_state, state, share, (missed + 1) * self.period),
                (1.0 - share) * self._last_torque + share * status.torque,
            )
            held = np.zeros(self._n) if self._sent is None else self._sent
            self._advance(DrivenTick(np.nan, 1, 0, int(status.robot_mode), held, self.override))

    def _advance(self, tick: DrivenTick) -> None:
        self.record.ticks.append(tick)
        # beyond the tick, so that it is logged with what was measured at it
        self._simulator.AdvanceTo((self._tick + 0.5) * self.period)
        self._tick += 1
        self.motion_time += self.period * self._pace()

    def _pace(self) -> float:
        """Return the pace of the reference, as its filter has it."""
        if not self.has_motion:
            return 1.0
        return float(self._station.blocks.state(self.root, PACE)[1])

    def _look(self, status: RobotStatus, state: np.ndarray) -> None:
        """Stop where nobody leads any more, end where the robot does not do what it is told."""
        leader = self._station.leader
        if leader is not None and leader.is_lost:
            self.stop(f"no word of the leader for {leader.patience:g} s")
        if status.robot_mode is not RobotMode.MOVE:
            self.lose(f"the robot went into mode {status.robot_mode.name}")
        speed = np.abs(state[self._n : 2 * self._n]).max()
        if speed > self._stop_speed:
            why = self._stopping if self._stopping != _FAULT else self.result(1.0).fault
            self.lose(f"{why}; the stop made the robot faster, and was left to its driver")
            self._end.send(RobotCommand(status.utime, self.mode, np.zeros(self._n)))
        # a joint whose speed is no number does not tell that it rests
        self._resting = self._resting + 1 if speed <= AT_REST else 0
