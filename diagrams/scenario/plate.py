"""Plate that is taken from a magazine and mounted into a frame (Sec. 5.3)."""

import dataclasses as dc
from typing import Annotated

import numpy as np

from diagrams.scenario.workpiece import ContactStep
from pfsc_drake.checks import require
from pfsc_drake.geometry.workpiece_bodies import FEWEST_WEDGES
from pfsc_drake.physics.mounting_hand import MountingHandParameters
from pfsc_drake.physics.suction import SuctionParameters
from pfsc_drake.yaml.fields import equal, former
from pfsc_drake.yaml.rules import (
    Count,
    NotNegative,
    Numbers,
    OneOf,
    Pair,
    Parameters,
    Positive,
    Range,
    Seed,
)

STARTS = ("magazine", "held", "frame")
_SMALLEST, _LARGEST = 1e-4, 2.0  # m
_LIGHTEST, _HEAVIEST = 1e-3, 100.0  # kg; what suction cups hold
_FARTHEST, _LARGEST_TURN = 0.02, 0.2  # m, rad; of misplacements
_MOST_WEDGES = 64


def _corners(x: float, y: float) -> list[list[float]]:
    return [[x, y], [x, -y], [-x, y], [-x, -y]]


@dc.dataclass
class PinParameters(Parameters):
    """Pins of the plate, cylinders with round tips.

    Attributes:
        positions: Positions of their axes in the plate's frame [m], one ``[x, y]`` each.
        radius: Radius [m].
        length: Length from the plate's underside to the tip [m], more than the radius.
    """

    positions: Annotated[list[Pair], Count(2, words="two pins or more")] = dc.field(
        default_factory=lambda: _corners(0.10, 0.06)
    )
    radius: Annotated[float, Range(_SMALLEST, _LARGEST, "m, a positive number")] = 4e-3
    length: Annotated[float, Range(_SMALLEST, _LARGEST, "m, a positive number")] = 12e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.length > self.radius, "length", self.length, "more than the radius")


@dc.dataclass
class RandomMisplacement(Parameters):
    """Random misplacement, in addition; uniform in two balls. None by default.

    Attributes:
        seed: Seed of the random numbers.
        shift: Radius of the ball of shifts [m].
        turn: Radius of the ball of rotation vectors [rad].
    """

    seed: Seed = 0
    shift: Annotated[float, Range(0.0, _FARTHEST, "m")] = 0.0
    turn: Annotated[float, Range(0.0, _LARGEST_TURN, "rad")] = 0.0

    def draw(self) -> tuple[np.ndarray, np.ndarray]:
        """Return shift [m] and rotation vector [rad], shape (3,) each."""
        random = np.random.default_rng(self.seed)
        directions, sizes = random.standard_normal((2, 3)), random.uniform(size=2) ** (1.0 / 3.0)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return self.shift * sizes[0] * directions[0], self.turn * sizes[1] * directions[1]


@dc.dataclass
class CarrierParameters(Parameters):
    """Carrier of a plate: a magazine or a frame.

    When the path was taught, a gripped plate lay in the carrier with the tool at the arc length
    ``at``. Since then the carrier has moved.

    Attributes:
        at: Arc length of the path [m].
        shift: Displacement since then, axes of the tool in that pose [m].
        turn: Rotation vector since then, about the tool point in that pose, same axes [rad].
        random: Random misplacement in addition.
    """

    at: NotNegative = 0.0
    shift: Annotated[list[float], Numbers(3)] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3)
    )
    turn: Annotated[list[float], Numbers(3)] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3)
    )
    random: RandomMisplacement = dc.field(default_factory=RandomMisplacement)

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, most, unit in (("shift", _FARTHEST, "m"), ("turn", _LARGEST_TURN, "rad")):
            values = getattr(self, key)
            small = float(np.linalg.norm(values)) <= most
            require(small, key, values, f"a vector of at most {most:g} {unit}")

    def misplacement(self) -> tuple[np.ndarray, np.ndarray]:
        """Return shift [m] and rotation vector [rad], random parts included, shape (3,) each."""
        shift, turn = self.random.draw()
        return np.array(self.shift) + shift, np.array(self.turn) + turn


@dc.dataclass
class FrameParameters(CarrierParameters):
    """The frame with the bores.

    Attributes:
        size: Length and width of the frame [m]; one number for a square.
        clearance: Difference between the diameters of bores and pins [m].
        ring: Radius around the axis of a bore within which there is material for contact [m].
        depth: Depth of the bores [m].
        wedges: Number of convex pieces of a bore, see :func:`bore_wedges`.
    """

    size: Annotated[list[float], Numbers(2, Range(0.0, open=True))] = dc.field(
        default_factory=lambda: [0.30, 0.20], metadata=equal(2)
    )
    clearance: Positive = 3e-4
    ring: Annotated[float, Range(_SMALLEST, _LARGEST, "m, a positive number")] = 0.016
    depth: Annotated[float, Range(_SMALLEST, _LARGEST, "m, a positive number")] = 0.015
    wedges: Annotated[int, Range(FEWEST_WEDGES, _MOST_WEDGES)] = 24


@dc.dataclass
class PlateContactParameters(Parameters):
    """Contact between plate, magazine and frame.

    Attributes:
        stiffness: Stiffness of point contact [N/m].
        dissipation: Dissipation of Hunt and Crossley [s/m].
        friction: Coulomb coefficient.
        time_step: Time step of the plates' plant, a whole fraction of the controller's sampling
            time [s].
    """

    stiffness: Annotated[float, Range(1.0, 1000000000.0, "N/m")] = 1e6
    dissipation: Annotated[float, Range(0.0, 1e6, "s/m")] = 1.0
    friction: Annotated[float, Range(0.0, 1e3)] = 0.15
    time_step: ContactStep = 1e-3


@dc.dataclass
class PlateParameters(Parameters):
    """A plate with pins, its magazine, the frame that it is mounted into, and the gripper.

    A gripped plate has the frame of the tool: origin in the middle of its upper face, z into it.

    Attributes:
        size: Length, width and thickness [m].
        mass: Mass [kg].
        nominal_mass: Mass whose weight is removed from the measured force while it is gripped
            [kg].
        pins: Its pins.
        rests: Points of its underside that lie on magazine and frame, ``[x, y]`` each [m].
        magazine: Magazine that it is taken from.
        frame: Frame that it is mounted into.
        contact: Contact with magazine and frame.
        suction: The gripper's cups.
        start: Plate at the start: in the ``magazine``; ``held`` by the gripper at the start of the
            tool; or mounted in the ``frame`` and still gripped, with the tool starting there and
            another plate in the magazine.
        release: Time at which the vacuum ends without an operator [s].
        operator: Operator who mounts it, with the hand of ``hand``. None: the vacuum is on from the
            start.
    """

    size: Annotated[list[float], Numbers(3, Range(_SMALLEST, _LARGEST, "m"))] = dc.field(
        default_factory=lambda: [0.24, 0.16, 0.008]
    )
    mass: Annotated[float, Range(_LIGHTEST, _HEAVIEST, "kg")] = 0.83
    nominal_mass: Annotated[float, Range(0.0, _HEAVIEST, "kg")] = dc.field(
        default=0.8, metadata=former("believed_mass")
    )
    pins: PinParameters = dc.field(default_factory=PinParameters)
    rests: Annotated[list[Pair], Count(3, words="three [x, y] or more")] = dc.field(
        default_factory=lambda: _corners(0.06, 0.065)
    )
    magazine: CarrierParameters = dc.field(default_factory=CarrierParameters)
    frame: FrameParameters = dc.field(default_factory=FrameParameters)
    contact: PlateContactParameters = dc.field(default_factory=PlateContactParameters)
    suction: SuctionParameters = dc.field(default_factory=SuctionParameters)
    start: Annotated[str, OneOf(STARTS)] = "magazine"
    release: Annotated[float, Range(0.0, open=True, infinite=True)] = np.inf
    operator: MountingHandParameters | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for i, rest in enumerate(self.rests):
            self._require_on_plate(f"rests[{i}]", rest, 0.0)
        self._check_pins()

    def _check_pins(self) -> None:
        """Refuse pins beside the plate, and bores beside the frame or within each other."""
        pins, ring = self.pins, self.frame.ring
        require(
            ring > pins.radius + self.frame.clearance,
            "frame.ring",
            ring,
            "more than the radius of a bore",
        )
        for i, position in enumerate(pins.positions):
            self._require_on_plate(f"pins.positions[{i}]", position, pins.radius)
            largest = np.array(self.frame.size) / 2.0 - ring
            inside = bool(np.all(np.abs(position) <= largest))
            allowed = f"bores at least frame.ring = {ring:g} m inside of frame.size"
            require(inside, f"pins.positions[{i}]", position, allowed)
            for other in pins.positions[:i]:
                apart = float(np.linalg.norm(np.subtract(position, other))) >= 2.0 * ring
                allowed = f"bores at least 2 frame.ring = {2.0 * ring:g} m apart"
                require(apart, f"pins.positions[{i}]", position, allowed)
            for rest in self.rests:
                free = float(np.linalg.norm(np.subtract(position, rest))) >= ring
                require(free, "rests", rest, f"at least frame.ring = {ring:g} m from every pin")

    def _require_on_plate(self, key: str, position: list[float], margin: float) -> None:
        largest = np.array(self.size[:2]) / 2.0 - margin
        require(bool(np.all(np.abs(position) <= largest)), key, position, "a point on the plate")
