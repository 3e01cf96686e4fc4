"""What is noted of a robot that is driven, beside what every run logs."""

from dataclasses import dataclass, field

import numpy as np

from experiments.results.run_log import RunLog
from pfsc_drake.drivers.messages import RobotMode


@dataclass
class DrivenTick:
    """What is noted of one tick.

    Attributes:
        age: Time from its status to its answer [s]; NaN where there was no status.
        missed: 1 where there was none.
        clipped: How many joints were told less than the law wanted.
        robot_mode: What the robot does.
        sent: What it was told, shape (N,).
    """

    age: float
    missed: int
    clipped: int
    robot_mode: int
    sent: np.ndarray


@dataclass
class DriveRecord:
    """What happened on the link.

    Attributes:
        ticks: What is noted of each tick of the controller.
    """

    ticks: list[DrivenTick] = field(default_factory=list)

    def add_to(self, log: RunLog) -> None:
        """Add what was noted to the log of a run.

        Args:
            log: The log.
        """
        noted = self.ticks[: len(log.time)]
        if len(noted) < len(log.time):
            noted = noted + [noted[-1]] * (len(log.time) - len(noted))
        modes = [mode.name.lower() for mode in RobotMode]
        log.add("status_age", [1e6 * tick.age for tick in noted])
        log.add("missed", [tick.missed for tick in noted])
        log.add("clipped", [tick.clipped for tick in noted])
        log.add("sent", [tick.sent for tick in noted])
        log.add("robot_mode", [tick.robot_mode for tick in noted], labels=modes)
