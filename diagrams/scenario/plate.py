"""The plate that is taken from a magazine and mounted into a frame (Sec. 5.3)."""

import dataclasses as dc

import numpy as np

from diagrams.scenario.checks import (
    require,
    require_between,
    require_not_negative,
    require_numbers,
    require_one_of,
    require_positive,
)
from diagrams.scenario.workpiece import require_contact_step, require_up_to
from pfsc_drake.geometry.workpieces import FEWEST_WEDGES
from pfsc_drake.physics.mounting_hand import MountingHandParameters
from pfsc_drake.physics.suction import SuctionParameters
from pfsc_drake.yaml.fields import equal

STARTS = ("magazine", "held", "frame")
_SMALLEST, _LARGEST = 1e-4, 2.0  # m
_LIGHTEST, _HEAVIEST = 1e-3, 100.0  # kg; what suction cups hold
_FARTHEST, _LARGEST_TURN = 0.02, 0.2  # m, rad; of misplacements
_MOST_WEDGES = 64


def _corners(x: float, y: float) -> list[list[float]]:
    return [[x, y], [x, -y], [-x, y], [-x, -y]]


@dc.dataclass
class PinParameters:
    """Pins of the plate, cylinders with round tips.

    Attributes:
        positions: Positions of their axes in the plate's frame [m], one ``[x, y]`` each.
        radius: [m].
        length: From the plate's underside to the tip [m], more than the radius.
    """

    positions: list[list[float]] = dc.field(default_factory=lambda: _corners(0.10, 0.06))
    radius: float = 4e-3
    length: float = 12e-3

    def __post_init__(self) -> None:
        require(len(self.positions) >= 2, "positions", self.positions, "two pins or more")
        for i, position in enumerate(self.positions):
            require_numbers(f"positions[{i}]", position, 2)
        require_between("radius", self.radius, _SMALLEST, _LARGEST, "m, a positive number")
        require_between("length", self.length, _SMALLEST, _LARGEST, "m, a positive number")
        require(self.length > self.radius, "length", self.length, "more than the radius")


@dc.dataclass
class RandomMisplacement:
    """A misplacement that is drawn, in addition; uniform in two balls. None by default.

    Attributes:
        seed: Another one draws another.
        shift: Radius of the ball of shifts [m].
        turn: Radius of the ball of rotation vectors [rad].
    """

    seed: int = 0
    shift: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        require(self.seed >= 0, "seed", self.seed, "zero or a positive integer")
        require_up_to("shift", self.shift, _FARTHEST)
        require_up_to("turn", self.turn, _LARGEST_TURN)

    def draw(self) -> tuple[np.ndarray, np.ndarray]:
        """Return shift [m] and rotation vector [rad], shape (3,) each."""
        random = np.random.default_rng(self.seed)
        directions, sizes = random.standard_normal((2, 3)), random.uniform(size=2) ** (1.0 / 3.0)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return self.shift * sizes[0] * directions[0], self.turn * sizes[1] * directions[1]


@dc.dataclass
class CarrierParameters:
    """Where a plate lies: a magazine or a frame.

    The path was taught with the tool in its pose at the arc length ``at`` when a gripped plate lies
    there. Since then the carrier moved.

    Attributes:
        at: Arc length of the path [m].
        shift: How far it moved, axes of the tool in that pose [m].
        turn: Rotation vector by which it turned about the tool point in that pose, same axes
            [rad].
        random: What is drawn in addition.
    """

    at: float = 0.0
    shift: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    turn: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    random: RandomMisplacement = dc.field(default_factory=RandomMisplacement)

    def __post_init__(self) -> None:
        require_not_negative("at", self.at)
        for key, most, unit in (("shift", _FARTHEST, "m"), ("turn", _LARGEST_TURN, "rad")):
            values = getattr(self, key)
            require_numbers(key, values, 3)
            small = float(np.linalg.norm(values)) <= most
            require(small, key, values, f"a vector of at most {most:g} {unit}")

    def misplacement(self) -> tuple[np.ndarray, np.ndarray]:
        """Return shift [m] and rotation vector [rad] with what is drawn, shape (3,) each."""
        shift, turn = self.random.draw()
        return np.array(self.shift) + shift, np.array(self.turn) + turn


@dc.dataclass
class FrameParameters(CarrierParameters):
    """The frame with the bores.

    Attributes:
        size: Length and width of the frame [m]; one number for a square.
        clearance: Diameter of the bores less that of the pins [m].
        ring: Radius around the axis of a bore within which there is material for a pin to touch
            [m].
        depth: Depth of the bores [m].
        wedges: Number of convex pieces that a bore is made of, see :func:`bore_wedges`.
    """

    size: list[float] = dc.field(default_factory=lambda: [0.30, 0.20], metadata=equal(2))
    clearance: float = 3e-4
    ring: float = 0.016
    depth: float = 0.015
    wedges: int = 24

    def __post_init__(self) -> None:
        super().__post_init__()
        require_numbers("size", self.size, 2)
        require(min(self.size) > 0.0, "size", self.size, "2 positive numbers")
        require_positive("clearance", self.clearance)
        for key in ("ring", "depth"):
            require_between(key, getattr(self, key), _SMALLEST, _LARGEST, "m, a positive number")
        good = FEWEST_WEDGES <= self.wedges <= _MOST_WEDGES
        require(good, "wedges", self.wedges, f"{FEWEST_WEDGES} to {_MOST_WEDGES}")


@dc.dataclass
class PlateContactParameters:
    """What happens where plate, magazine and frame touch.

    Attributes:
        stiffness: Stiffness of point contact [N/m].
        dissipation: Dissipation of Hunt and Crossley [s/m].
        friction: Coulomb coefficient.
        time_step: Time step of the plates' plant, a whole fraction of the controller's sampling
            time [s].
    """

    stiffness: float = 1e6
    dissipation: float = 1.0
    friction: float = 0.15
    time_step: float = 1e-3

    def __post_init__(self) -> None:
        require_between("stiffness", self.stiffness, 1.0, 1e9, "N/m")
        require_up_to("dissipation", self.dissipation, 1e6)
        require_up_to("friction", self.friction, 1e3)
        require_contact_step(self.time_step)


@dc.dataclass
class PlateParameters:
    """A plate with pins, where it lies and where it is to go, and the gripper that takes it there.

    A gripped plate has the frame of the tool: origin in the middle of its upper face, z into it.

    Attributes:
        size: Length, width and thickness [m].
        mass: [kg].
        believed_mass: What the controller takes off the measured force while it is held [kg].
        pins: Its pins.
        rests: Where its underside lies on magazine and frame, ``[x, y]`` each [m].
        magazine: Where it comes from.
        frame: Where it goes.
        contact: What happens where they touch.
        suction: The gripper's cups.
        start: Where a plate is at the start: in the ``magazine``; ``held`` where the tool starts;
            mounted in the ``frame`` and still held, the tool starting there, with another one in
            the magazine.
        release: When the vacuum ends if nobody decides [s].
        operator: Who mounts it; ``hand`` then says what the hand is like. None: the vacuum is on
            from the start.
    """

    size: list[float] = dc.field(default_factory=lambda: [0.24, 0.16, 0.008])
    mass: float = 0.83
    believed_mass: float = 0.8
    pins: PinParameters = dc.field(default_factory=PinParameters)
    rests: list[list[float]] = dc.field(default_factory=lambda: _corners(0.06, 0.065))
    magazine: CarrierParameters = dc.field(default_factory=CarrierParameters)
    frame: FrameParameters = dc.field(default_factory=FrameParameters)
    contact: PlateContactParameters = dc.field(default_factory=PlateContactParameters)
    suction: SuctionParameters = dc.field(default_factory=SuctionParameters)
    start: str = "magazine"
    release: float = np.inf
    operator: MountingHandParameters | None = None

    def __post_init__(self) -> None:
        require_numbers("size", self.size, 3)
        good = all(_SMALLEST <= length <= _LARGEST for length in self.size)
        require(good, "size", self.size, f"3 numbers of {_SMALLEST:g} to {_LARGEST:g} m")
        require_between("mass", self.mass, _LIGHTEST, _HEAVIEST, "kg")
        require_between("believed_mass", self.believed_mass, 0.0, _HEAVIEST, "kg")
        require_one_of("start", self.start, STARTS)
        require(self.release > 0.0, "release", self.release, "a positive number of seconds")
        require(len(self.rests) >= 3, "rests", self.rests, "three [x, y] or more")
        for i, rest in enumerate(self.rests):
            require_numbers(f"rests[{i}]", rest, 2)
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
            room = np.array(self.frame.size) / 2.0 - ring
            inside = bool(np.all(np.abs(position) <= room))
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
        room = np.array(self.size[:2]) / 2.0 - margin
        require(bool(np.all(np.abs(position) <= room)), key, position, "a place on the plate")
