"""What is known of a robot's bodies before anything is measured."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from identification.model.shipped import shipped_or_own
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.parameter_checks import check_vector, require
from pfsc_drake.yaml.typed import REQUIRED, load_file

FILE_NAME = "physical_bounds.yaml"
_INTERVAL = 2


def _unit_interval() -> np.ndarray:
    return np.array([1.0, 1.0])


@dataclass
class Box:
    """A box along the axes of a frame.

    Attributes:
        lower: ``[3]`` its corner with the smallest coordinates [m].
        upper: ``[3]`` that with the largest ones [m].
    """

    lower: np.ndarray = field(default_factory=lambda: np.zeros(3), metadata=REQUIRED)
    upper: np.ndarray = field(default_factory=lambda: np.ones(3), metadata=REQUIRED)

    def __post_init__(self) -> None:
        check_vector("lower", self.lower, 3)
        check_vector("upper", self.upper, 3)
        ordered = bool(np.all(self.lower < self.upper))
        require(ordered, "lower", self.lower, f"below upper = {self.upper.tolist()}")

    @property
    def center(self) -> np.ndarray:
        """``[3]`` [m]."""
        return 0.5 * (self.lower + self.upper)

    @property
    def half_widths(self) -> np.ndarray:
        """``[3]`` [m]."""
        return 0.5 * (self.upper - self.lower)


@dataclass
class LinkBounds:
    """What is known of one link, in the link frame of the robot's chain.

    Attributes:
        mass: ``[2]`` least and largest mass [kg].
        center_of_mass: Where the centre of mass is.
        body: Where all of its mass is; if known. The second moments of the link then keep
            ``int (x - lower)(upper - x) dm >= 0`` along each axis.
        least_extent: How far its mass spreads at least in any direction, as standard deviation of
            its places [m]. A ball of radius R has ``R / sqrt(5)``. The smaller it is, the nearer
            a set may come to what no body has.
    """

    mass: np.ndarray = field(default_factory=_unit_interval, metadata=REQUIRED)
    center_of_mass: Box = field(default_factory=Box, metadata=REQUIRED)
    body: Box | None = None
    least_extent: float = field(default=1.0, metadata=REQUIRED)

    def __post_init__(self) -> None:
        check_interval("mass", self.mass)
        extent = self.least_extent
        require(0.0 < extent < np.inf, "least_extent", extent, "positive and finite")


@dataclass
class DeltaMassBounds:
    """What is known of the moving masses of a DELTA robot, with their shares of the rods.

    Attributes:
        slide: ``[2]`` least and largest ``m_q`` [kg].
        plate: ``[2]`` least and largest ``m_y`` [kg].
        equal_slides: Whether the three slides weigh the same, as the robot's parameter file has
            it.
    """

    slide: np.ndarray = field(default_factory=_unit_interval, metadata=REQUIRED)
    plate: np.ndarray = field(default_factory=_unit_interval, metadata=REQUIRED)
    equal_slides: bool = True

    def __post_init__(self) -> None:
        check_interval("slide", self.slide)
        check_interval("plate", self.plate)


@dataclass
class PhysicalBounds:
    """What is known of a robot; either links, or the masses of a DELTA robot.

    Attributes:
        name: Of the robot.
        links: From the base on; of the last one without tool, if the tool is not identified.
        rotor_inertia: ``[2]`` least and largest ``I_M`` of each joint [kg m^2], at the motor side
            as in the parameters; empty for no bounds but zero.
        total_mass: ``[2]`` least and largest mass of all links [kg]; empty if unknown.
        delta: Masses of a DELTA robot.
        source: Where the numbers are from.
    """

    name: str = field(default="unnamed", metadata=REQUIRED)
    links: list[LinkBounds] = field(default_factory=lambda: [LinkBounds()])
    rotor_inertia: list[list[float]] = field(default_factory=list)
    total_mass: list[float] = field(default_factory=list)
    delta: DeltaMassBounds | None = None
    source: str = ""

    def __post_init__(self) -> None:
        require(bool(self.name), "name", self.name, "a name")
        many = len(self.links)
        if self.total_mass:
            check_interval("total_mass", np.array(self.total_mass))
        for j, inertia in enumerate(self.rotor_inertia):
            check_interval(f"rotor_inertia[{j}]", np.array(inertia))
        fits = len(self.rotor_inertia) in (0, many)
        require(fits, "rotor_inertia", len(self.rotor_inertia), f"one interval per link, {many}")
        one = (self.delta is None) == bool(self.links)
        require(one, "links", many, "one entry per link, or instead the key delta")


def load_bounds(robot: str | Path) -> PhysicalBounds:
    """Return what is known of a robot.

    Args:
        robot: Name of a shipped robot, or a YAML file.

    Raises:
        InputError: If the file cannot be read, or a key is unknown, missing or out of range.
    """
    return load_file(PhysicalBounds, shipped_or_own(robot, FILE_NAME))


def bounds_from_geometry(
    subject: Subject, total_mass: tuple[float, float], margin: float
) -> PhysicalBounds:
    """Return bounds for a chain of which only the joints and the mass on a scale are known.

    A link's centre of mass is in the box around the origins of its own and the next joint (of the
    last link: the tool point), and its mass in a box wider by as much again. Links share the total
    mass within a factor of ten of equal shares, and spread by a tenth of the margin at least.

    Args:
        subject: A serial robot of N joints.
        total_mass: Least and largest mass of all links [kg].
        margin: By which the box of the centre of mass is wider than the joints' origins [m].

    Raises:
        InputError: If the robot is no chain, the margin is not positive or the masses are none.
    """
    if subject.chain is None:
        raise InputError(f"{subject.name}: no chain of links; allowed: bounds from a file")
    require(0.0 < margin < np.inf, "margin", margin, "positive and finite")
    check_interval("total_mass", np.array(total_mass))
    chain, share = subject.chain, 10.0
    ends = [link.p_PF for link in chain.links[1:]] + [chain.p_LT]
    mass = np.array([total_mass[0] / share, min(1.0, share / len(ends)) * total_mass[1]])
    mass[0] /= len(ends)
    links = []
    for end in ends:
        lower, upper = np.minimum(end, 0.0), np.maximum(end, 0.0)
        near, far = Box(lower - margin, upper + margin), 2.0 * margin
        links.append(LinkBounds(mass.copy(), near, Box(lower - far, upper + far), margin / share))
    return PhysicalBounds(subject.name, links, total_mass=list(total_mass), source="geometry")


def check_interval(key: str, value: np.ndarray) -> None:
    """Refuse what is no interval of positive numbers; both ends may be equal.

    Raises:
        InputError: If it is none.
    """
    check_vector(key, value, _INTERVAL)
    require(bool(0.0 < value[0] <= value[1]), key, value, "[least, largest], both positive")
