"""What a motion is judged by."""

import math
from dataclasses import dataclass

import numpy as np

from experiments.studies.peers.lap import Lap
from experiments.studies.peers.world import RobotMotion, judge
from pfsc_drake.robot.robot_model import RobotModel
from reporting.metrics import NOT_A_NUMBER

_ARRIVED = 5e-3  # m
_STEP = 5  # ticks, between places that are judged
_NOTHING = (math.nan,) * 6


@dataclass(frozen=True)
class Score:
    """What one run came to; NaN where it came to nothing.

    Attributes:
        largest: Deviation from the path [m].
        rms: Its root mean square [m].
        turned: Largest error of orientation [rad].
        time: From the beginning of the motion until the tool stays near the end [s].
        effort: Largest share of a drive's torque.
        hand: Largest force of a hand [N].
        fault: Why it was stopped; empty if it was not.
    """

    largest: float
    rms: float
    turned: float
    time: float
    effort: float
    hand: float
    fault: str = ""

    @property
    def numbers(self) -> dict[str, tuple[float, str]]:
        """Values and units by what they are."""
        return {
            "largest deviation": (self.largest, "m"),
            "rms deviation": (self.rms, "m"),
            "largest turn": (self.turned, "rad"),
            "time taken": (self.time, "s"),
            "largest share of a drive": (self.effort, "1"),
            "force of the hand": (self.hand, "N"),
        }

    @property
    def cells(self) -> list[str]:
        """The same in mm, mm, mrad, s, % and N."""
        values = np.array([value for value, _ in self.numbers.values()])
        shown = zip(values * [1e3, 1e3, 1e3, 1.0, 1e2, 1.0], (3, 3, 2, 2, 0, 1), strict=True)
        return [f"{x:.{digits}f}" if np.isfinite(x) else NOT_A_NUMBER for x, digits in shown]

    def __str__(self) -> str:
        if self.fault:
            return self.fault
        largest, _, turned, time, _, hand = self.cells
        held = "" if hand == NOT_A_NUMBER else f", {hand} N"
        return f"{largest} mm, {turned} mrad, {time} s{held}"


def score(lap: Lap, robot: RobotModel, motion: RobotMotion, held_from: float = np.inf) -> Score:
    """Judge a motion.

    Args:
        lap: The lap that was to be made.
        robot: The robot as it is.
        motion: How it moved.
        held_from: When a hand takes hold of the tool, if one does [s]; how far it moves it is not
            judged.
    """
    if motion.fault:
        return Score(*_NOTHING, fault=motion.fault)
    seen = motion.every(_STEP)
    judged = judge(seen, robot, lap.task, lap.ends[1])
    free = seen.time < held_from
    deviation, away = judged.deviation[free], np.flatnonzero(judged.to_end[free] > _ARRIVED)
    arrived = len(away) > 0 and away[-1] + 1 < np.count_nonzero(free)
    return Score(
        float(deviation.max()),
        float(np.sqrt(np.mean(deviation**2))),
        float(judged.turned[free].max()),
        float(seen.time[away[-1] + 1] - lap.begin) if arrived else np.nan,
        float(np.abs(motion.effort[motion.time < held_from]).max()),
        float(np.linalg.norm(motion.hand, axis=1).max()) if np.isfinite(held_from) else np.nan,
    )
