"""A simulated robot behind the messages of a driver, in a process of its own."""

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
from pfsc_drake.drivers.link import RobotEnd
from pfsc_drake.drivers.messages import ControlMode, Dialect, RobotCommand, RobotStatus
from pfsc_drake.physics.velocity_servo import joint_inertia
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat
from pfsc_drake.systems.drawing.robot_visualizer import RobotVisualizer
from pfsc_drake.yaml.typed import load_typed
from reporting.interruption import noticed_interruption

_US = 1e6
_REHEARSED = 20  # ticks
_MOST_LATE = 10_000  # ticks by which commands come later
# for a plant that is to keep up with the clock
_SCHEME = "runge_kutta3"


@dataclass(frozen=True)
class Transport:
    """What happens to commands on their way.

    Attributes:
        lose: Share of packets that are lost, in both directions.
        delay: Ticks by which a command comes later.
        seed: Seed of which ones are lost.
    """

    lose: float = 0.0
    delay: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        require_between("--lose", self.lose, 0.0, 1.0, "")
        require_between("--delay", self.delay, 0, _MOST_LATE, "ticks")


class SimulatedRobot:
    """A robot that moves as it is commanded, tick by tick.

    At each tick it tells its status first, then hears commands, as drivers do. Its interface adds
    the weight that its own model tells to commanded torques.

    Args:
        station: The robot.
        settings: Its scenario.
        end: The link.
        options: How the driver treats commands.
        transport: What happens to messages.

    Attributes:
        tick: Number of the tick to come.
        heard: How many commands have been heard.
    """

    def __init__(
        self,
        station: RobotStation,
        settings: Scenario,
        end: RobotEnd,
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
        """The robot's clock [us]."""
        return round(self.tick * self.period * _US)

    def status(self) -> RobotStatus:
        """Return what it tells of itself now: its motors' positions, and torques in its joints."""
        _, _, q_M, v_M = np.split(self.station.joint_state(self.root), 4)
        springs = self.station.joint_torque(self.root)
        torque = np.where(self.station.part.robot.elastic_joints, springs, self._torque)
        return RobotStatus(self.utime, q_M, v_M, torque, self.rules.robot_mode, self.station.mode)

    def tell(self) -> None:
        """Send the status, unless it is lost on the way."""
        status, wrench = self.status(), self.station.sensed(self.root)
        if not self._is_lost():
            self._end.tell(status, wrench)

    def advance(self) -> None:
        """Hear what has come, and move by one tick."""
        command = self._end.hear()
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
        self.station.tell(self.root, acting)
        self.tick += 1
        self._simulator.AdvanceTo(self.tick * self.period)

    def _is_lost(self) -> bool:
        return self._transport.lose > 0.0 and self._random.random() < self._transport.lose


def rehearse(
    station: RobotStation, settings: Scenario, dialect: Dialect, options: DriverOptions
) -> None:
    """Make the first ticks of a robot while nobody waits: they take longer than its period.

    Args:
        station: The robot.
        settings: Its scenario.
        dialect: Its messages, which go nowhere.
        options: How the driver treats commands.
    """
    end = RobotEnd(DrakeLcm("memq://"), dialect)
    robot = SimulatedRobot(station, settings, end, options, Transport())
    for _ in range(_REHEARSED):
        robot.tell()
        robot.advance()


def run_robot(
    robot: SimulatedRobot,
    interrupted: Callable[[], bool],
    tell: Callable[[float], None],
    duration: float = np.inf,
) -> float:
    """Let a robot move in real time until it is interrupted.

    Args:
        robot: The robot.
        interrupted: Whether to end.
        tell: Told the robot's time, ten times a second [s].
        duration: How long it lasts at most [s].

    Returns:
        Share of the ticks that began within one period of their time.
    """
    begin, late, every = time.monotonic(), 0, max(1, round(0.1 / robot.period))
    while not interrupted() and robot.tick * robot.period < duration:
        goal = begin + robot.tick * robot.period
        wait = goal - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        elif wait < -robot.period:
            late += 1
            if wait < -0.1:  # time is not caught up after a long halt
                begin -= wait
        robot.tell()
        # whoever is quick answers within the same tick
        robot.advance()
        if robot.tick % every == 0:
            tell(robot.tick * robot.period)
    return 1.0 - late / max(robot.tick, 1)


def run_robot_scenario(
    scenario: ScenarioFile,
    end: RobotEnd,
    options: DriverOptions,
    transport: Transport,
    *,
    duration: float,
    drawn: bool,
    tell: Callable[[str], None],
) -> None:
    """Let a scenario's robot wait for commands until it is interrupted.

    Args:
        scenario: The scenario as read.
        end: The link to its controller.
        options: How the driver treats commands.
        transport: What happens to messages.
        duration: How long it lasts at most [s].
        drawn: Whether to draw it in Meshcat.
        tell: Told in words what happens.

    Raises:
        InputError: If the scenario is wrong.
    """
    settings = load_typed(Scenario, scenario.data, str(scenario.path))
    folder = scenario.path.parent
    with naming(scenario.path):
        if settings.simulation.integrator == AUTO:
            settings.simulation.integrator = _SCHEME
        station = build_robot_station(settings, folder)
    check_mode(station.mode, end.dialect.modes, end.dialect.name)
    rehearse(station, settings, end.dialect, options)
    robot = SimulatedRobot(station, settings, end, options, transport)
    view = _View(station, settings.robot, folder, tell) if drawn else None
    q = np.rad2deg(robot.status().q)
    ended = None

    def watch(time: float) -> None:
        nonlocal ended
        if view is not None:
            view.draw(robot)
        if robot.rules.ended != ended:
            ended = robot.rules.ended
            tell(f"t = {time:.1f} s: the driver has ended: {ended}; the joints are damped")

    with steady_clock(), noticed_interruption() as interrupted, real_time_priority() as allowed:
        tell(f"{len(q)} joints at {np.round(q, 2).tolist()} deg, {station.mode.name} mode")
        if not allowed:
            tell("warning: no real-time priority here; ticks may be late")
        share = run_robot(robot, interrupted, watch, duration)
    tell(
        f"{robot.tick} ticks, {share:.1%} on time; {robot.heard} commands, "
        f"{robot.rules.rejected} of them too old"
    )


class _View:
    """Draws the robot in Meshcat while it moves."""

    def __init__(
        self,
        station: RobotStation,
        parameters: RobotParameters,
        folder: Path,
        tell: Callable[[str], None],
    ) -> None:
        assert isinstance(station.part, Arm)
        meshcat = hidden_meshcat()
        drawing = draw_robot(station.part.model, station.part.tool, parameters, folder)
        self._robot = RobotVisualizer(drawing.plant, drawing.parts, meshcat, 1.0)
        self._context = self._robot.CreateDefaultContext()
        tell(f"open {meshcat.web_url()}")

    def draw(self, robot: SimulatedRobot) -> None:
        """Draw the robot as it is."""
        coordinates = robot.station.part.coordinates
        state = coordinates.plant_state(robot.station.joint_state(robot.root))
        positions = state[: coordinates.num_states // 2]
        self._robot.GetInputPort("positions").FixValue(self._context, positions)
        self._robot.ForcedPublish(self._context)
