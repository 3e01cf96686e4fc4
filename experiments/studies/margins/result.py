"""What is known of a closed loop before it runs: its modes along the way, and what it bears."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from experiments.studies.margins.box import Error, ErrorBox
from experiments.studies.margins.sticking import StuckDrives
from experiments.studies.margins.walk import Instant, TouchedSurface
from pfsc_drake.control.margins import DiscMargin, Modes


@dataclass(frozen=True)
class Place:
    """A loop at one instant.

    Attributes:
        instant: When and where.
        modes: Its modes; None where the law goes to its safe state.
    """

    instant: Instant
    modes: Modes | None

    @property
    def rate(self) -> float:
        """Rate of the slowest or fastest growing mode [1/s]; infinite where the law gives up."""
        return np.inf if self.modes is None else self.modes.slowest

    @property
    def damping(self) -> float:
        """The smallest damping ratio of a mode; -1 where the law gives up."""
        return -1.0 if self.modes is None else self.modes.smallest_damping


@dataclass(frozen=True)
class Case:
    """A loop along its way, with what is believed wrongly.

    Attributes:
        error: What is believed wrongly beside what the scenario says.
        key: The parameter, if it is one alone.
        places: Where it was looked at.
    """

    error: Error
    key: str
    places: list[Place]

    @property
    def worst(self) -> Place:
        """Where it is slowest, or grows fastest."""
        return max(self.places, key=lambda place: place.rate)

    @property
    def is_stable(self) -> bool:
        """Whether nothing grows anywhere."""
        return self.worst.rate <= 0.0


@dataclass(frozen=True)
class DriveMargins:
    """What the drives bear at one instant, the model being as the scenario says.

    Attributes:
        instant: When and where.
        drives: Drives of each drive alone, N of them.
        common: What is common of all at once.
        delay: Further sampling intervals of delay that are borne, -1 for none.
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
    """All that is known of a loop before it runs.

    Attributes:
        period: Sampling time [s].
        joints: Names of the drives.
        box: Errors that it is to bear.
        nominal: The loop as the scenario says.
        singles: One parameter wrong at a time.
        corners: All wrong, at the weakest instants.
        margins: What the drives bear, as the scenario says.
        drives_are_servos: Whether the drives are servos that take velocities.
        remarks: What was left out of the loop, and why, one sentence each.
        surface: What of a surface that is pressed on it bears, if that is so and was looked at.
        stuck: The loop at rest where friction holds the motors, if there is friction.
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
        """All loops that were looked at, the scenario's own first."""
        return [self.nominal, *self.singles, *self.corners]

    @property
    def weakest(self) -> Case:
        """The slowest of the loops, or the one that grows fastest."""
        return max(self.cases, key=lambda case: case.worst.rate)

    @cached_property
    def worst_by_key(self) -> dict[str, Case]:
        """The worse sign of each parameter, the parameter that hurts most first."""
        keys = dict.fromkeys(case.key for case in self.singles)
        found = {
            key: max((c for c in self.singles if c.key == key), key=lambda case: case.worst.rate)
            for key in keys
        }
        return dict(sorted(found.items(), key=lambda item: -item[1].worst.rate))

    @property
    def least_damped(self) -> Place | None:
        """Where the loop, as the scenario says, is damped least."""
        known = [place for place in self.nominal.places if place.modes is not None]
        return min(known, key=lambda place: place.damping, default=None)

    @property
    def tightest(self) -> DriveMargins | None:
        """Where a drive bears least."""
        return min(self.margins, key=lambda margins: margins.smallest, default=None)

    @property
    def delay(self) -> int:
        """Further sampling intervals of delay that are borne everywhere."""
        return min((margins.delay for margins in self.margins), default=-1)
