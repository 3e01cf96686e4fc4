"""The lap that every law is to make: one robot, one path, one motion along it."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np
from diagrams.scenario_task import make_task

from diagrams.robot_station import RobotStation, build_robot_station
from diagrams.robots.arm import Arm
from diagrams.scenario import Scenario
from experiments.scenario_file import SCENARIO_DIRECTORY, read_scenario
from experiments.studies.peers.laws import MovingPose, moving_pose
from experiments.studies.peers.plan import JointPlan, fastest, joint_path
from pfsc_drake.following.tasks.path_task import PathTask
from pfsc_drake.yaml.typed import load_typed

SCENARIO = "pfc_panda_7r"
# a lap that begins on the path, from rest to rest
COMMON = (
    "reference.points=[0.0, 1.0]",
    "start.offset=[0, 0]",
    "start.rotation_deg=[0, 0, 0]",
    "simulation.integrator=runge_kutta3",
    "targets={}",
)
FOLDER: FilePath = SCENARIO_DIRECTORY


@dataclass(frozen=True)
class Lap:
    """A lap of the circle of ``SCENARIO``.

    Attributes:
        duration: Simulated time [s].
    """

    duration: float

    def settings(self, overrides: tuple[str, ...] = ()) -> Scenario:
        """Return the scenario.

        Args:
            overrides: What else is changed in it.
        """
        found = read_scenario(SCENARIO, [*COMMON, *overrides])
        return load_typed(Scenario, found.data, str(found.path))

    @cached_property
    def plain(self) -> Scenario:
        """The scenario with nothing to disturb it."""
        return self.settings()

    @cached_property
    def task(self) -> PathTask:
        """The path, and the motion along it."""
        task = make_task(self.plain, FOLDER)
        assert isinstance(task, PathTask)
        return task

    @cached_property
    def station(self) -> RobotStation:
        """The robot, undisturbed, that nobody controls."""
        return build_robot_station(self.plain, FOLDER)

    @cached_property
    def fastest(self) -> JointPlan:
        """The fastest motion of the joints along the path, which knows the true robot."""
        part = self.station.part
        assert isinstance(part, Arm)
        path = joint_path(part.robot, self.task.path, *self.ends, start_posture(self.station))
        return fastest(part.model, path, self.begin, self.plain.reference.reserve)

    @cached_property
    def target(self) -> MovingPose:
        """Pose that moves along the path as the reference does."""
        return moving_pose(self.task.path, self.task.motion, self.ticks, self.period)

    @property
    def ends(self) -> tuple[float, float]:
        """Arc lengths where it begins and ends [m]."""
        points = self.plain.reference.arc_lengths(self.task.path.length)
        return points[0], points[-1]

    @property
    def begin(self) -> float:
        """When the motion begins [s]."""
        return self.plain.reference.dwell

    @property
    def moving(self) -> float:
        """How long the reference moves [s]."""
        return float(self.task.motion.domain[1]) - 2.0 * self.begin

    @property
    def period(self) -> float:
        """Sampling time [s]."""
        return self.plain.controller.sampling_time

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return round(self.duration / self.period)


def start_posture(station: RobotStation) -> np.ndarray:
    """Return the joint coordinates of a robot at the start, shape (N,).

    Args:
        station: The robot.
    """
    link_state: np.ndarray = station.part.coordinates.link_rows @ station.initial_state
    return link_state[: station.part.robot.dimension]
