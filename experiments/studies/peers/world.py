"""One robot under any law: the same plant, sampling, sensors, friction and forces."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.analysis import Simulator
from scipy.spatial.transform import Rotation

from diagrams.builder import build_station
from diagrams.robot_station import RobotStation, build_robot_station
from diagrams.scenario import Scenario
from experiments.simulation import configure, simulate
from experiments.studies.peers.laws import Law
from pfsc_drake.following.tasks.path_task import PathTask
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.robot.robot_model import RobotModel, pose_function
from reporting.progress import NoProgress


@dataclass(frozen=True)
class RobotMotion:
    """How a robot moved.

    Attributes:
        time: Of the ticks [s], shape (S,).
        q: True joint coordinates [rad], shape (S, N).
        effort: Torques of the drives as a share of their limits, shape (S, N).
        hand: Force of a hand on the tool [N], shape (S, 3).
        fault: Why it was stopped; empty if it was not.
    """

    time: np.ndarray
    q: np.ndarray
    effort: np.ndarray
    hand: np.ndarray
    fault: str = ""

    def every(self, step: int) -> "RobotMotion":
        """Return every so many ticks of it.

        Args:
            step: How many.
        """
        time, q, effort, hand = (x[::step] for x in (self.time, self.q, self.effort, self.hand))
        return RobotMotion(time, q, effort, hand, self.fault)


def under_own_law(settings: Scenario, folder: FilePath, duration: float) -> RobotMotion:
    """Let a scenario's own controller move its robot.

    Args:
        settings: The scenario.
        folder: Where its relative file names start.
        duration: Simulated time [s].
    """
    station = build_station(settings, folder)
    result = simulate(station, settings.simulation, duration, NoProgress())
    time, signals = station.log.read(result.root)
    n = station.robot.dimension
    hand = signals.get("push_wrench", np.zeros((len(time), 6)))[:, :3]
    effort = signals["law"][:, station.law.layout.drive] / station.robot.gather("effort_limit")
    return RobotMotion(time, signals["joint_state"][:, :n], effort, hand, result.fault or "")


def under_law(
    settings: Scenario, folder: FilePath, duration: float, make: Callable[[RobotStation], Law]
) -> RobotMotion:
    """Let another law move the same robot.

    The law is asked once per tick with what is measured then, and its torques are held until the
    next within the drives' limits, as the scenario's own are.

    Args:
        settings: The scenario; encoders are exact.
        folder: Where its relative file names start.
        duration: Simulated time [s].
        make: Makes the law for the robot.
    """
    station = build_robot_station(settings, folder)
    law, robot = make(station), station.part.robot
    simulator, period = Simulator(station.diagram), settings.controller.sampling_time
    parameters = settings.simulation
    configure(simulator, parameters.integrator, parameters.max_step, parameters.accuracy)
    root, limit = simulator.get_mutable_context(), robot.gather("effort_limit")
    station.set_start(root)
    simulator.Initialize()
    ticks, n = round(duration / period), robot.dimension
    q, effort, hand = np.zeros((ticks, n)), np.zeros((ticks, n)), np.zeros((ticks, 3))
    for k in range(ticks):
        state = station.joint_state(root)
        torque = np.clip(law(k, state[:n], state[n : 2 * n]), -limit, limit)
        q[k], effort[k] = state[:n], torque / limit
        if settings.pushes:
            hand[k] = station.blocks.output(root, "push_hold.held")[:3]
        station.tell(root, torque)
        simulator.AdvanceTo((k + 1) * period)
    return RobotMotion(np.arange(ticks) * period, q, effort, hand)


@dataclass(frozen=True)
class Judgement:
    """How good a motion along a path was, whatever was to move.

    Attributes:
        deviation: Distance from the path [m], shape (S,).
        turned: Angle from the orientation of the nearest point of the path [rad], shape (S,).
        to_end: Distance from the end of the path [m], shape (S,).
    """

    deviation: np.ndarray
    turned: np.ndarray
    to_end: np.ndarray


def judge(motion: RobotMotion, robot: RobotModel, task: PathTask, end: float) -> Judgement:
    """Measure a motion against a path.

    Args:
        motion: The motion.
        robot: The robot as it is.
        task: The path.
        end: Arc length where it ends [m].
    """
    poses = pose_function(robot).map(len(motion.time))(motion.q.T).full().T
    evaluator, layout = task.evaluator, task.place.layout
    memory = task.start(np.zeros(3)).place[0]
    deviation, turned = np.zeros(len(poses)), np.zeros(len(poses))
    goal = task.path.pose(end)[0]
    for k, pose in enumerate(poses):
        point = evaluator(pose[:3].tolist(), memory)
        memory = point[layout.memory][0]
        deviation[k] = np.linalg.norm(pose[:3] - point[layout.position][:3])
        R_d = quaternion_to_matrix(point[layout.quaternion][:4])
        turned[k] = Rotation.from_matrix(pose[3:].reshape(3, 3) @ R_d.T).magnitude()
    return Judgement(deviation, turned, np.linalg.norm(poses[:, :3] - goal, axis=1))
