"""From a scenario to its robot, which waits for commands in a process of its own."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from diagrams.drawing.robot_geometry import draw_robot
from diagrams.robot_station import RobotStation, build_robot_station
from diagrams.robots.arm import Arm
from diagrams.scenario import RobotParameters, Scenario
from diagrams.scenario.simulation import AUTO
from experiments.finished_run import steady_clock
from experiments.hardware.driven_run import real_time_priority
from experiments.hardware.robot import SimulatedRobot, Transport, rehearse, run_robot
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile
from pfsc_drake.drivers.driver_rules import DriverOptions, check_mode
from pfsc_drake.drivers.link import RobotEnd
from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat
from pfsc_drake.systems.drawing.robot_visualizer import RobotVisualizer
from pfsc_drake.yaml.typed import load_typed
from reporting.interruption import noticed_interruption

# for a plant that is to keep up with the clock
_SCHEME = "runge_kutta3"


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
