"""Results of a margin analysis: modes of a closed loop along its path, and margins."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from experiments.studies.margins.box import Error, ErrorBox
from experiments.studies.margins.sticking import StuckDrives
from experiments.studies.margins.walk import Instant, TouchedSurface
from pfsc_drake.control.margins import DiscMargin, Modes


@dataclass(frozen=True)
class OperatingPoint:
    """Loop at one instant.

    Attributes:
        instant: Time and position.
        modes: Its modes; None if the law is in its safe state.
    """

    instant: Instant
    modes: Modes | None

    @property
    def rate(self) -> float:
        """Rate of the slowest or most unstable mode [1/s]; infinite after a fault of the law."""
        return np.inf if self.modes is None else self.modes.slowest

    @property
    def damping(self) -> float:
        """Smallest damping ratio of a mode; -1 after a fault of the law."""
        return -1.0 if self.modes is None else self.modes.smallest_damping


@dataclass(frozen=True)
class Case:
    """Loop along its path, with an error of the nominal model.

    Attributes:
        error: Model error in addition to the scenario's.
        key: The parameter of a single error, or empty.
        points: Analysed points.
    """

    error: Error
    key: str
    points: list[OperatingPoint]

    @property
    def worst(self) -> OperatingPoint:
        """Point with the slowest or most unstable mode."""
        return max(self.points, key=lambda point: point.rate)

    @property
    def is_stable(self) -> bool:
        """Whether it is stable at all points."""
        return self.worst.rate <= 0.0


@dataclass(frozen=True)
class DriveMargins:
    """Margins of the drives at one instant, with the scenario's model.

    Attributes:
        instant: Time and position.
        drives: Disc margins of each drive alone, N of them.
        common: Disc margin for a common factor in all drives.
        delay: Tolerated additional delay in sampling intervals, -1 for none.
    """

    instant: Instant
    drives: list[DiscMargin]
    common: DiscMargin
    delay: int

    @property
    def smallest(self) -> float:
        """The smallest disc margin of a drive."""
        return min(margin.alpha for margin in self.drives)


@dataclass
class MarginAnalysis:
    """Result of a margin analysis.

    Attributes:
        period: Sampling time [s].
        joints: Names of the drives.
        box: Errors to tolerate.
        nominal: The scenario's loop.
        singles: Loops with single parameter errors.
        corners: Loops with errors in all parameters, at the weakest instants.
        margins: Margins of the drives in the scenario's loop.
        drives_are_servos: Whether the drives are servos that take velocities.
        remarks: Omissions and assumptions, one sentence each.
        surface: Stiffness margin of a touched surface, or None.
        stuck: The loop at rest with motors held by friction, if there is friction.
    """

    period: float
    joints: Sequence[str]
    box: ErrorBox
    nominal: Case
    singles: list[Case] = field(default_factory=list)
    corners: list[Case] = field(default_factory=list)
    margins: list[DriveMargins] = field(default_factory=list)
    drives_are_servos: bool = False
    remarks: list[str] = field(default_factory=list)
    surface: TouchedSurface | None = None
    stuck: StuckDrives | None = None

    @property
    def cases(self) -> list[Case]:
        """All analysed loops, the scenario's own first."""
        return [self.nominal, *self.singles, *self.corners]

    @property
    def weakest(self) -> Case:
        """Loop with the slowest or most unstable mode."""
        return max(self.cases, key=lambda case: case.worst.rate)

    @cached_property
    def worst_by_key(self) -> dict[str, Case]:
        """Worse sign of each parameter error, the worst parameter first."""
        keys = dict.fromkeys(case.key for case in self.singles)
        found = {
            key: max((c for c in self.singles if c.key == key), key=lambda case: case.worst.rate)
            for key in keys
        }
        return dict(sorted(found.items(), key=lambda item: -item[1].worst.rate))

    @property
    def least_damped(self) -> OperatingPoint | None:
        """Point with the least damping of the scenario's loop, if any."""
        known = [point for point in self.nominal.points if point.modes is not None]
        return min(known, key=lambda point: point.damping, default=None)

    @property
    def tightest(self) -> DriveMargins | None:
        """Margins at the instant with the smallest disc margin."""
        return min(self.margins, key=lambda margins: margins.smallest, default=None)

    @property
    def delay(self) -> int:
        """Additional delay tolerated at all instants, in sampling intervals."""
        return min((margins.delay for margins in self.margins), default=-1)
