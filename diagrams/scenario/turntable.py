"""A turntable that carries the workpiece with the path of the robot."""

import dataclasses as dc
from typing import Annotated

import numpy as np

from diagrams.scenario.holder import HolderWorkpiece
from diagrams.scenario.robot import PoseParameters
from pfsc_drake.checks import require, require_between, require_numbers
from pfsc_drake.yaml.fields import former
from pfsc_drake.yaml.rules import (
    Direction,
    NotNegative,
    Numbers,
    OneOf,
    Parameters,
    Positive,
    Range,
)

DERIVATIVES = ("known", "differenced", "none")
# deg, largest angle of an axis; s, largest delay of its angles
_FARTHEST, _LATEST = 1e5, 0.1


@dc.dataclass
class TurntableAxisParameters(Parameters):
    """An axis of a turntable, in the axes of its base while all angles are zero.

    Attributes:
        direction: Direction of the axis, of any length, shape (3,).
        point: A point of the axis, relative to the base [m], shape (3,).
    """

    direction: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    point: Annotated[list[float], Numbers(3)] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])

    def __post_init__(self) -> None:
        super().__post_init__()
        good = 1e-6 < float(np.linalg.norm(self.direction)) < 1e6
        require(good, "direction", self.direction, "3 numbers that are not all zero")


@dc.dataclass
class TurntableParameters(Parameters):
    """A turntable with one axis or more, which turns the workpiece from stop to stop.

    Its drives follow their command with a ``lag``. Its controller reports the angles of its
    encoders, with a ``delay``, and the derivatives of the command.

    Attributes:
        base_pose: Pose of its base.
        axes: Its axes, the one at the base first; each carries the next.
        workpiece: Workpiece on the last axis; its pose is relative to the base while all angles are
            zero.
        stops_deg: Angles of all axes at each stop; from one to the next on a straight line [deg].
        velocity_deg: Largest rate of the axis with the largest angle to turn [deg/s].
        acceleration_deg: Its largest acceleration [deg/s^2].
        dwell: Rest before the first move and after each [s].
        increments: Increments of each encoder per turn; 0 for exact ones.
        lag: Lag of the axes behind their command, which the controllers do not model [s].
        delay: Delay of the reported angles, a whole number of sampling times [s].
        nominal_delay: Delay that the robot's controller compensates; ``delay`` if null [s].
        placement_error: Pose of its base in the controller's model relative to the actual one, axes
            of the base.
        derivatives: Derivatives of the motion in the robot's controller: ``known``: those of the
            command; ``differenced``, from the angles of the last ticks; ``none``.
        highest: Highest derivative that is known or differenced, 0 to 4.
    """

    base_pose: PoseParameters = dc.field(default_factory=PoseParameters)
    axes: list[TurntableAxisParameters] = dc.field(default_factory=list)
    workpiece: HolderWorkpiece = dc.field(default_factory=HolderWorkpiece)
    stops_deg: list[list[float]] = dc.field(default_factory=list)
    velocity_deg: Positive = 90.0
    acceleration_deg: Positive = 180.0
    dwell: NotNegative = 0.0
    increments: NotNegative = 0.0
    lag: Annotated[float, Range(0.0, _LATEST, "s")] = 0.0
    delay: Annotated[float, Range(0.0, _LATEST, "s")] = 0.0
    nominal_delay: float | None = dc.field(default=None, metadata=former("believed_delay"))
    placement_error: PoseParameters = dc.field(default_factory=PoseParameters)
    derivatives: Annotated[str, OneOf(DERIVATIVES)] = "known"
    highest: Annotated[int, Range(0, 4)] = 4

    def check(self) -> None:
        """Refuse a table without axes or stops, or with a delay out of range.

        Raises:
            InputError: If a parameter is invalid.
        """
        if self.nominal_delay is not None:
            require_between("turntable.nominal_delay", self.nominal_delay, 0.0, _LATEST, "s")
        key, count = "turntable.stops_deg", len(self.axes)
        require(1 <= count <= 6, "turntable.axes", f"{count} given", "1 to 6")
        require(len(self.stops_deg) > 1, key, self.stops_deg, "two stops or more")
        for i, stop in enumerate(self.stops_deg):
            require_numbers(f"{key}[{i}]", stop, count)
            near = max(map(abs, stop)) <= _FARTHEST
            require(near, f"{key}[{i}]", stop, f"angles of at most {_FARTHEST:g} deg")
            moves = i == 0 or stop != self.stops_deg[i - 1]
            require(moves, f"{key}[{i}]", stop, "angles unlike those of the stop before")
