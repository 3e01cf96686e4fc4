"""A controller that drives a robot by messages: one tick for each status that comes."""

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
from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode, RobotStatus
from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Request
from pfsc_drake.physics.driver import torque_rates
from pfsc_drake.robot.robot_model import gravity_function

# where the reference remembers its own time and its pace
PACE = "controller.reference_generator.pace"
# largest rate of commanded torques, as drivers have it [Nm/s], and share of a joint's effort limit
_TORQUE_RATE, _EFFORT_SHARE = 1000.0, 0.95
_US = 1e6
_FAULT = "a fault"
_SECOND = 1000  # ticks


@dataclass
class DrivenTick:
    """What is noted of one tick.

    Attributes:
        age: Time from its status to its answer [s]; NaN where there was no status.
        missed: 1 where there was none.
        clipped: How many joints were told less than the law wanted.
        robot_mode: What the robot does.
        sent: What it was told, shape (N,).
        override: Share of the planned pace that was asked for.
    """

    age: float
    missed: int
    clipped: int
    robot_mode: int
    sent: np.ndarray
    override: float


class Drive:
    """A station's controller, advanced by what a robot tells.

    Args:
        station: A station whose robot stands elsewhere.
        end: The link.
        override: Share of its planned pace at which the reference moves at first.

    Attributes:
        period: Sampling time [s].
        mode: What the robot is commanded by.
        limit: Largest torques that are sent [Nm or N], shape (N,).
        rate: How fast they may change [Nm/s or N/s], shape (N,).
        inputs: What the station receives.
        ticks: What is noted of each tick.
        fault: Why it ended, or None.
        override: Share of its planned pace at which the reference is to move.
        fastest_pace: Largest share of the planned pace.
        motion_time: How far it is in the time of the motion as planned [s].
        has_motion: Whether the reference moves by itself, not because a hand leads the tool.
    """

    def __init__(self, station: Station, end: ControllerEnd, override: float = 1.0) -> None:
        assert isinstance(station.part, RemoteArm)
        self._station, self._part, self._end = station, station.part, end
        self.inputs, self.ticks = DriveInputs(station), list[DrivenTick]()
        robot = station.part.belief.robot
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
        ticks = missed + 1 if self._tick > 0 else np.inf
        state, jumped = self.inputs.without_jumps(self._state(status), self.period, ticks)
        if jumped is not None:
            self.stop(jumped)
        self._bridge(state, missed, status)
        if missed > BRIDGED:
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
        self.inputs.keep(state, status.torque)
        self._look(status, state)

    def heed(self, request: Request) -> None:
        """Do what somebody asks for, from the next tick on.

        Args:
            request: What.
        """
        if request.override is not None:
            self.override = min(request.override, self.fastest_pace)
            self._part.set_override(self.root, self.override)
        self.inputs.hear_obstacles(request, self.time)
        if request.stop:
            self.stop("asked to stop")

    def progress(self) -> dict[str, float]:
        """Return how far it is and how well it goes, numbers by name for who watches."""
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
        self._stop_speed = (
            STOP_FACTOR * np.nanmax(np.abs(self.inputs.state[n : 2 * n])) + STOP_SPEED
        )

    @property
    def has_ended(self) -> bool:
        """Whether nothing more is to be sent: the robot's driver damps then."""
        if self.fault is not None:
            return True
        if self._stopping is None:
            return False
        long = self.time - self._stop_time > LONGEST_STOP
        return long or self._resting * self.period > RESTED_FOR

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

    def add_to(self, log: RunLog) -> None:
        """Add what was noted of the ticks to the log of a run.

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

    def _tell(self, state: np.ndarray, torque: np.ndarray) -> None:
        self.inputs.tell(self.root, self.time, state, torque, self._end.wrench)

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
            share, span = k / (missed + 1), (missed + 1) * self.period
            self._tell(*self.inputs.between(state, status.torque, share, span))
            held = np.zeros(self._n) if self._sent is None else self._sent
            self._advance(DrivenTick(np.nan, 1, 0, int(status.robot_mode), held, self.override))

    def _advance(self, tick: DrivenTick) -> None:
        self.ticks.append(tick)
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


def command_mode(station: Station) -> ControlMode:
    """Return what a station's law commands a robot by.

    Args:
        station: The station.
    """
    torques = station.law.linearization.relative_degree > 1
    return ControlMode.TORQUE if torques else ControlMode.VELOCITY
