"""Prior knowledge of a robot's bodies, as bounds and inequalities."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from identification.consistency.pseudo_inertia import Layout, linear_terms
from identification.model.dynamic_parameters import LINK_PARAMETERS, PER_LINK
from identification.model.subject import Subject
from pfsc_drake.checks import require, require_numbers
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.yaml.fields import REQUIRED
from pfsc_drake.yaml.rules import Name, Parameters, Positive
from pfsc_drake.yaml.typed import load_file

FILE_NAME = "physical_bounds.yaml"
_INTERVAL = 2


def _unit_interval() -> np.ndarray:
    return np.array([1.0, 1.0])


@dataclass
class FrameBox:
    """A box along the axes of a frame.

    Attributes:
        lower: Corner with the smallest coordinates [m], shape (3,).
        upper: Corner with the largest coordinates [m], shape (3,).
    """

    lower: np.ndarray = field(default_factory=lambda: np.zeros(3), metadata=REQUIRED)
    upper: np.ndarray = field(default_factory=lambda: np.ones(3), metadata=REQUIRED)

    def __post_init__(self) -> None:
        require_numbers("lower", self.lower, 3)
        require_numbers("upper", self.upper, 3)
        ordered = bool(np.all(self.lower < self.upper))
        require(ordered, "lower", self.lower, f"below upper = {self.upper.tolist()}")

    @property
    def center(self) -> np.ndarray:
        """Shape (3,) [m]."""
        return 0.5 * (self.lower + self.upper)

    @property
    def half_widths(self) -> np.ndarray:
        """Shape (3,) [m]."""
        return 0.5 * (self.upper - self.lower)


@dataclass
class LinkBounds(Parameters):
    """Bounds of one link, in the link frame of the robot's chain.

    Attributes:
        mass: ``[2]`` least and largest mass [kg].
        center_of_mass: Box that contains the centre of mass.
        body: Box that contains all of its mass; None if unknown. With it, the second moments of the
            link satisfy ``int (x - lower)(upper - x) dm >= 0`` along each axis.
        least_extent: Least standard deviation of the mass distribution in any direction [m]. A ball
            of radius R has ``R / sqrt(5)``. The smaller it is, the nearer a set may come to
            parameters that no body has.
    """

    mass: np.ndarray = field(default_factory=_unit_interval, metadata=REQUIRED)
    center_of_mass: FrameBox = field(default_factory=FrameBox, metadata=REQUIRED)
    body: FrameBox | None = None
    least_extent: Positive = field(default=1.0, metadata=REQUIRED)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_interval("mass", self.mass)


@dataclass
class DeltaMassBounds:
    """Bounds of the moving masses of a DELTA robot, with their shares of the rods.

    Attributes:
        slide: ``[2]`` least and largest ``m_q`` [kg].
        plate: ``[2]`` least and largest ``m_y`` [kg].
        equal_slides: Whether the three slides have the same mass, as in the robot's parameter file.
    """

    slide: np.ndarray = field(default_factory=_unit_interval, metadata=REQUIRED)
    plate: np.ndarray = field(default_factory=_unit_interval, metadata=REQUIRED)
    equal_slides: bool = True

    def __post_init__(self) -> None:
        check_interval("slide", self.slide)
        check_interval("plate", self.plate)


@dataclass
class PhysicalBounds(Parameters):
    """Bounds of a robot; either links, or the masses of a DELTA robot.

    Attributes:
        name: Name of the robot.
        links: Links from the base on; the last one without tool, if the tool is not identified.
        rotor_inertia: ``[2]`` least and largest ``I_M`` of each joint [kg m^2], at the motor side
            as in the parameters; empty for no bounds but zero.
        total_mass: ``[2]`` least and largest mass of all links [kg]; empty if unknown.
        delta: Masses of a DELTA robot.
        source: Source of the numbers.
    """

    name: Name = field(default="unnamed", metadata=REQUIRED)
    links: list[LinkBounds] = field(default_factory=lambda: [LinkBounds()])
    rotor_inertia: list[list[float]] = field(default_factory=list)
    total_mass: list[float] = field(default_factory=list)
    delta: DeltaMassBounds | None = None
    source: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
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
    """Return the bounds of a robot.

    Args:
        robot: Name of a shipped robot, or a YAML file.

    Raises:
        InputError: If the file cannot be read, or a key is unknown, missing or out of range.
    """
    return load_file(PhysicalBounds, shipped_or_own(robot, FILE_NAME))


def bounds_of(subject: Subject, file: Path | None) -> PhysicalBounds:
    """Return the bounds of a robot's bodies from a file, or else the shipped ones.

    Raises:
        InputError: If there is neither, or the file cannot be read.
    """
    if file is not None:
        return load_bounds(file)
    try:
        return load_bounds(subject.family)
    except InputError:
        raise InputError(
            f"{subject.name}: no bounds of its links; write --bounds FILE, or for a chain "
            "--total-mass LOW:HIGH [kg]"
        ) from None


def bounds_from_geometry(
    subject: Subject, total_mass: tuple[float, float], margin: float
) -> PhysicalBounds:
    """Return bounds for a chain with known joints and total mass only.

    The centre of mass of a link is in the box around the origins of its own and the next joint (for
    the last link: the tool point), and its mass in a box wider by as much again. Links share the
    total mass within a factor of ten of equal shares, and extend by a tenth of the margin at least.

    Args:
        subject: A serial robot of N joints.
        total_mass: Least and largest mass of all links [kg].
        margin: Margin of the box of the centre of mass around the joints' origins [m].

    Raises:
        InputError: If the robot is not a chain, or the margin or a mass is not positive.
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
        near, far = FrameBox(lower - margin, upper + margin), 2.0 * margin
        links.append(
            LinkBounds(mass.copy(), near, FrameBox(lower - far, upper + far), margin / share)
        )
    return PhysicalBounds(subject.name, links, total_mass=list(total_mass), source="geometry")


def check_interval(key: str, value: np.ndarray) -> None:
    """Refuse anything but an interval of positive numbers; both ends may be equal.

    Raises:
        InputError: If it is not such an interval.
    """
    require_numbers(key, value, _INTERVAL)
    require(bool(0.0 < value[0] <= value[1]), key, value, "[least, largest], both positive")


_TERMS = np.array(linear_terms())
_MASS, _FIRST_MOMENT = (LINK_PARAMETERS.index(name) for name in ("m", "mx"))


# G, lower, upper of ``lower <= G rho <= upper``, (k, n), (k,), (k,); ends may be infinite or equal
Intervals = tuple[np.ndarray, np.ndarray, np.ndarray]


def extent_terms(link: LinkBounds) -> np.ndarray:
    """Return ``M_k``, shape (10, 4, 4), of the matrix ``sum_k rho_k M_k >= 0`` of a link.

    It is ``P - m r^2 diag(1, 1, 1, 0)``: about the centre of mass its first three rows and columns
    are positive semidefinite if and only if the mass extends by r in every direction.

    Args:
        link: Bounds of the link, with the least extent r.
    """
    terms = _TERMS.copy()
    terms[_MASS, :3, :3] -= link.least_extent**2 * np.eye(3)
    return terms


def link_intervals(link: LinkBounds) -> Intervals:
    """Return the intervals of the ten parameters of a link, k rows of shape (k, 10).

    The mass is within its bounds, ``m lower <= h <= m upper`` for the centre of mass, and
    ``int (x - lower)(upper - x) dm >= 0`` along each axis for a body in a known box.

    Args:
        link: Bounds of the link.
    """
    unit = np.eye(PER_LINK)
    mass, moments = unit[_MASS], unit[_FIRST_MOMENT : _FIRST_MOMENT + 3]
    box = link.center_of_mass
    rows = [mass, *(moments - np.outer(box.lower, mass)), *(np.outer(box.upper, mass) - moments)]
    if link.body is not None:
        first, last = link.body.lower, link.body.upper
        second = np.diagonal(_TERMS, axis1=1, axis2=2)[:, :3].T
        inside = (first + last)[:, None] * moments - np.outer(first * last, mass) - second
        rows += [*inside]
    lower, upper = np.zeros(len(rows)), np.full(len(rows), np.inf)
    lower[0], upper[0] = link.mass
    return np.array(rows), lower, upper


def other_intervals(layout: Layout, bounds: PhysicalBounds) -> Intervals:
    """Return the intervals beyond those of single links, rows of shape (k, n).

    These are the total mass, rotors, friction, which is not negative, and the masses of a DELTA
    robot.

    Args:
        layout: Order of the n parameters.
        bounds: Bounds of the robot.
    """
    unit, none = np.eye(layout.size), [0.0, np.inf]
    rows = list(
        zip(unit[layout.rotors], bounds.rotor_inertia or [none] * layout.rotors.size, strict=True)
    )
    rows += [(unit[i], none) for i in layout.friction]
    if bounds.total_mass:
        rows.append((unit[layout.links[:, _MASS]].sum(axis=0), bounds.total_mass))
    if bounds.delta is not None:
        slides, delta = unit[layout.slides], bounds.delta
        rows += [(row, list(delta.slide)) for row in slides]
        rows.append((unit[layout.masses[-1]], list(delta.plate)))
        if delta.equal_slides:
            rows += [(row - slides[0], [0.0, 0.0]) for row in slides[1:]]
    ends = np.array([interval for _, interval in rows]).reshape(-1, 2)
    return np.array([row for row, _ in rows]).reshape(-1, layout.size), *ends.T


def check_bounds(layout: Layout, bounds: PhysicalBounds) -> None:
    """Refuse bounds of another robot.

    Raises:
        InputError: If they have another number of links, or belong to another kind of robot.
    """
    found = f"{len(bounds.links)} links" if bounds.delta is None else "a DELTA robot"
    there = "a DELTA robot" if layout.is_delta else f"{len(layout.links)} links"
    if found != there:
        raise InputError(f"bounds of {bounds.name}: {found}; must be {there}")


def shipped_or_own(robot: str | Path, name: str) -> Path:
    """Return a file shipped with a robot, or a user's own.

    Args:
        robot: Name of a shipped robot, or a file.
        name: Name of the shipped file.

    Raises:
        InputError: If the robot has no such file.
    """
    path = Path(robot)
    if path.suffix:
        return path
    path = models_directory() / path / name
    if not path.is_file():
        known = sorted(file.parent.name for file in models_directory().glob(f"*/{name}"))
        raise InputError(f"robot {str(robot)!r}: must be a file or one of {', '.join(known)}")
    return path
