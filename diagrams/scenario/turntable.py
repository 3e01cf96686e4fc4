"""A turntable that carries the workpiece, on which the path of the robot is."""

import dataclasses as dc
from typing import Annotated

import numpy as np

from diagrams.scenario.holder import HeldWorkpieceParameters
from diagrams.scenario.robot import PoseParameters
from pfsc_drake.checks import require, require_between, require_numbers
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
# deg, that an axis may turn; s, by which what it tells may be late
_FARTHEST, _LATEST = 1e5, 0.1


@dc.dataclass
class TurntableAxisParameters(Parameters):
    """An axis of a turntable, in the axes of its base while all angles are zero.

    Attributes:
        direction: About which it turns, of any length, shape (3,).
        point: A point of it, from the base [m], shape (3,).
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

    Its drives follow their command ``lag`` late. Its controller tells the angles of its encoders,
    ``delay`` late, and the derivatives of the command.

    Attributes:
        base_pose: Where it stands.
        axes: Its axes, that at the base first; each carries the next.
        workpiece: What the last axis carries; its pose is that from the base while all angles are
            zero.
        stops_deg: Angles of all axes at each stop; from one to the next on a straight line [deg].
        velocity_deg: Largest rate of the axis that has the longest way [deg/s].
        acceleration_deg: Its largest acceleration [deg/s^2].
        dwell: Rest before the first move and after each [s].
        increments: Increments of each encoder per turn; 0 for exact ones.
        lag: Time by which the axes are behind their command, which nobody is told [s].
        delay: Time by which angles come late; a whole number of sampling times [s].
        believed_delay: What the robot's controller makes up for; ``delay`` if null [s].
        placement_error: Where it is believed to stand, in its own axes, beside where it stands.
        derivatives: What the robot's controller knows of the motion: ``known``: derivatives of the
            command; ``differenced``, from the angles of the last ticks; ``none``.
        highest: Highest derivative that is known or differenced, 0 to 4.
    """

    base_pose: PoseParameters = dc.field(default_factory=PoseParameters)
    axes: list[TurntableAxisParameters] = dc.field(default_factory=list)
    workpiece: HeldWorkpieceParameters = dc.field(default_factory=HeldWorkpieceParameters)
    stops_deg: list[list[float]] = dc.field(default_factory=list)
    velocity_deg: Positive = 90.0
    acceleration_deg: Positive = 180.0
    dwell: NotNegative = 0.0
    increments: NotNegative = 0.0
    lag: Annotated[float, Range(0.0, _LATEST, "s")] = 0.0
    delay: Annotated[float, Range(0.0, _LATEST, "s")] = 0.0
    believed_delay: float | None = None
    placement_error: PoseParameters = dc.field(default_factory=PoseParameters)
    derivatives: Annotated[str, OneOf(DERIVATIVES)] = "known"
    highest: Annotated[int, Range(0, 4)] = 4

    def check(self) -> None:
        """Refuse a table that has no axes, nowhere to go, or is believed to be too late.

        Raises:
            InputError: If so.
        """
        if self.believed_delay is not None:
            require_between("turntable.believed_delay", self.believed_delay, 0.0, _LATEST, "s")
        key, count = "turntable.stops_deg", len(self.axes)
        require(1 <= count <= 6, "turntable.axes", f"{count} given", "1 to 6")
        require(len(self.stops_deg) > 1, key, self.stops_deg, "two stops or more")
        for i, stop in enumerate(self.stops_deg):
            require_numbers(f"{key}[{i}]", stop, count)
            near = max(map(abs, stop)) <= _FARTHEST
            require(near, f"{key}[{i}]", stop, f"angles of at most {_FARTHEST:g} deg")
            moves = i == 0 or stop != self.stops_deg[i - 1]
            require(moves, f"{key}[{i}]", stop, "another place than the stop before")
