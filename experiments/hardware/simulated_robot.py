"""Simulated robot with the messages of a driver, in a separate process."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.lcm import DrakeLcm
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from diagrams.drawing.robot_geometry import draw_robot
from diagrams.robot_station import RobotStation, build_robot_station
from diagrams.robots.arm import Arm
from diagrams.scenario import RobotParameters, Scenario
from diagrams.scenario.simulation import AUTO
from experiments.finished_run import steady_clock
from experiments.hardware.driven_run import real_time_priority
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile
from experiments.simulation import configure
from pfsc_drake.checks import require_between
from pfsc_drake.drivers.driver_rules import DriverOptions, DriverRules, check_mode
from pfsc_drake.drivers.link import RobotEndpoint
from pfsc_drake.drivers.messages import ControlMode, Dialect, RobotCommand, RobotStatus
from pfsc_drake.physics.velocity_servo import joint_inertia
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat
from pfsc_drake.systems.drawing.robot_visualizer import RobotVisualizer
from pfsc_drake.yaml.typed import load_typed
from reporting.interruption import watch_interruption

_US = 1e6
_REHEARSED = 20  # ticks
_MOST_LATE = 10_000  # ticks, largest delay of commands
# for simulation in real time
_SCHEME = "runge_kutta3"


@dataclass(frozen=True)
class Transport:
    """Packet loss and delay of messages.

    Attributes:
        lose: Share of lost packets, in both directions.
        delay: Delay of commands in ticks.
        seed: Seed of the losses.
    """

    lose: float = 0.0
    delay: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        require_between("--lose", self.lose, 0.0, 1.0, "")
        require_between("--delay", self.delay, 0, _MOST_LATE, "ticks")


class SimulatedRobot:
    """Robot that executes commands, tick by tick.

    At each tick it sends its status first, then receives commands, as drivers do. Its interface
    adds gravity torques of its own model to commanded torques.

    Args:
        station: The robot.
        settings: Its scenario.
        end: The link.
        options: Options of the driver.
        transport: Packet loss and delay.

    Attributes:
        tick: Number of the next tick.
        heard: Number of received commands.
    """

    def __init__(
        self,
        station: RobotStation,
        settings: Scenario,
        end: RobotEndpoint,
        options: DriverOptions,
        transport: Transport,
    ) -> None:
        self.station, self._end, self._transport = station, end, transport
        self.period = settings.controller.sampling_time
        self._n = station.part.robot.dimension
        self._weight = gravity_function(station.part.robot)
        self._simulator = Simulator(station.diagram)
        parameters = settings.simulation
        configure(self._simulator, parameters.integrator, parameters.max_step, parameters.accuracy)
        station.set_start(self.root)
        self._simulator.Initialize()
        robot = station.part.robot
        self._limit = robot.gather("effort_limit")
        inertia = joint_inertia(robot, np.split(station.joint_state(self.root), 4)[0])
        self.rules = DriverRules(inertia, self._limit, station.mode, options, self.period)
        self._late: deque[RobotCommand | None] = deque([None] * transport.delay)
        self._random = np.random.default_rng(transport.seed)
        self._torque = np.zeros(self._n)
        self.tick = self.heard = 0

    @property
    def root(self) -> Context:
        """Context of the diagram."""
        return self._simulator.get_mutable_context()

    @property
    def utime(self) -> int:
        """Time of the robot's clock [us]."""
        return round(self.tick * self.period * _US)

    def status(self) -> RobotStatus:
        """Return the current status: motor positions and velocities, and joint torques."""
        _, _, q_M, v_M = np.split(self.station.joint_state(self.root), 4)
        springs = self.station.joint_torque(self.root)
        torque = np.where(self.station.part.robot.elastic_joints, springs, self._torque)
        return RobotStatus(self.utime, q_M, v_M, torque, self.rules.robot_mode, self.station.mode)

    def tell(self) -> None:
        """Send the status, unless the packet is lost."""
        status, wrench = self.status(), self.station.measured_wrench(self.root)
        if not self._is_lost():
            self._end.send_status(status, wrench)

    def advance(self) -> None:
        """Receive commands, and advance by one tick."""
        command = self._end.receive_command()
        if command is not None:
            self.heard += 1
        self._late.append(None if command is None or self._is_lost() else command)
        arrived = self._late.popleft()
        state = self.station.joint_state(self.root)
        _, _, q_M, v_M = np.split(state, 4)
        acting = self.rules.advance(self.utime, arrived, v_M)
        if self.station.mode is ControlMode.TORQUE:
            acting = acting + self._weight(q_M).full().ravel()
            acting = self._torque = np.clip(acting, -self._limit, self._limit)
        self.station.set_command(self.root, acting)
        self.tick += 1
        self._simulator.AdvanceTo(self.tick * self.period)

    def _is_lost(self) -> bool:
        return self._transport.lose > 0.0 and self._random.random() < self._transport.lose


def rehearse(
    station: RobotStation, settings: Scenario, dialect: Dialect, options: DriverOptions
) -> None:
    """Simulate the first ticks of a robot beforehand, since they take longer than its period.

    Args:
        station: The robot.
        settings: Its scenario.
        dialect: Its messages, which are not sent.
        options: Options of the driver.
    """
    end = RobotEndpoint(DrakeLcm("memq://"), dialect)
    robot = SimulatedRobot(station, settings, end, options, Transport())
    for _ in range(_REHEARSED):
        robot.tell()
        robot.advance()


def run_robot(
    robot: SimulatedRobot,
    interrupted: Callable[[], bool],
    notify: Callable[[float], None],
    duration: float = np.inf,
) -> float:
    """Simulate a robot in real time until an interruption.

    Args:
        robot: The robot.
        interrupted: Whether to end.
        notify: Receives the robot's time ten times a second [s].
        duration: Longest duration [s].

    Returns:
        Share of ticks that began within one period of their time.
    """
    begin, late, every = time.monotonic(), 0, max(1, round(0.1 / robot.period))
    while not interrupted() and robot.tick * robot.period < duration:
        goal = begin + robot.tick * robot.period
        wait = goal - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        elif wait < -robot.period:
            late += 1
            if wait < -0.1:  # lost time is not caught up after a long halt
                begin -= wait
        robot.tell()
        # a fast controller answers within the same tick
        robot.advance()
        if robot.tick % every == 0:
            notify(robot.tick * robot.period)
    return 1.0 - late / max(robot.tick, 1)


def run_robot_scenario(
    scenario: ScenarioFile,
    end: RobotEndpoint,
    options: DriverOptions,
    transport: Transport,
    *,
    duration: float,
    drawn: bool,
    notify: Callable[[str], None],
) -> None:
    """Simulate a scenario's robot in real time until an interruption.

    Args:
        scenario: The scenario as read.
        end: The link to its controller.
        options: Options of the driver.
        transport: Packet loss and delay.
        duration: Longest duration [s].
        drawn: Whether to draw it in Meshcat.
        notify: Receives lines about events.

    Raises:
        InputError: If the scenario is wrong.
    """
    settings = load_typed(Scenario, scenario.data, scenario.source)
    folder = scenario.path.parent
    with naming(scenario.source):
        if settings.simulation.integrator == AUTO:
            settings.simulation.integrator = _SCHEME
        station = build_robot_station(settings, folder)
    check_mode(station.mode, end.dialect.modes, end.dialect.name)
    rehearse(station, settings, end.dialect, options)
    robot = SimulatedRobot(station, settings, end, options, transport)
    view = _View(station, settings.robot, folder, notify) if drawn else None
    q = np.rad2deg(robot.status().q)
    ended = None

    def watch(time: float) -> None:
        nonlocal ended
        if view is not None:
            view.draw(robot)
        if robot.rules.ended != ended:
            ended = robot.rules.ended
            notify(f"t = {time:.1f} s: the driver has ended: {ended}; the joints are damped")

    with steady_clock(), watch_interruption() as interrupted, real_time_priority() as allowed:
        notify(f"{len(q)} joints at {np.round(q, 2).tolist()} deg, {station.mode.name} mode")
        if not allowed:
            notify("warning: no real-time priority here; ticks may be late")
        share = run_robot(robot, interrupted, watch, duration)
    notify(
        f"{robot.tick} ticks, {share:.1%} on time; {robot.heard} commands, "
        f"{robot.rules.rejected} of them too old"
    )


class _View:
    """Drawing of the moving robot in Meshcat."""

    def __init__(
        self,
        station: RobotStation,
        parameters: RobotParameters,
        folder: Path,
        notify: Callable[[str], None],
    ) -> None:
        assert isinstance(station.part, Arm)
        meshcat = hidden_meshcat()
        drawing = draw_robot(station.part.model, station.part.tool, parameters, folder)
        self._robot = RobotVisualizer(drawing.plant, drawing.parts, meshcat, 1.0)
        self._context = self._robot.CreateDefaultContext()
        notify(f"open {meshcat.web_url()}")

    def draw(self, robot: SimulatedRobot) -> None:
        """Draw the robot's current posture."""
        coordinates = robot.station.part.coordinates
        state = coordinates.plant_state(robot.station.joint_state(robot.root))
        positions = state[: coordinates.num_states // 2]
        self._robot.GetInputPort("positions").FixValue(self._context, positions)
        self._robot.ForcedPublish(self._context)
