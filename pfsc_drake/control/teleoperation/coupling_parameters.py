"""How leader and follower are coupled, and the numbers that keep them passive."""

from dataclasses import dataclass, field
from typing import Annotated

import casadi as ca

from pfsc_drake.errors import require
from pfsc_drake.yaml.rules import NotNegative, OneOf, Parameters, Positive, Range

COUPLINGS = ("waves", "position_force", "four_channel")


@dataclass
class PortTankParameters(Parameters):
    """Energy that one side may give to what it moves, beyond what it got [J].

    Attributes:
        capacity: Most that the tank holds [J].
        initial: What it holds at the start [J]; where it holds less, the side damps what it moves.
        refill: That damping, where the tank is empty [N s/m].
        share: Share of what is above ``initial`` that a side sends on in a second [1/s]; with waves
            only while the other side lacks energy.
    """

    capacity: Positive = 4.0
    initial: float = 0.2
    refill: NotNegative = 20.0
    share: NotNegative = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        good = 0.0 < self.initial <= self.capacity
        require(good, "initial", self.initial, f"above 0, up to the capacity, {self.capacity:g} J")


@dataclass
class RotationParameters(Parameters):
    """How turns are coupled, three axes more, about those of the world.

    Attributes:
        impedance: ``b`` of their waves [Nm s/rad].
        stiffness: K of the other couplings [Nm/rad].
        damping: D of the other couplings [Nm s/rad].
        scale: How far the follower turns by the leader's turn.
    """

    impedance: Positive = 1.0
    stiffness: Positive = 20.0
    damping: NotNegative = 1.0
    scale: Positive = 1.0


@dataclass
class CouplingParameters(Parameters):
    """How leader and follower are coupled, in lengths and forces of the follower.

    Attributes:
        coupling: ``waves``: each side sends a wave, and no more energy than its own;
            ``position_force``: the follower is drawn to where the leader is, the leader feels how
            much; ``four_channel``: positions and felt forces go both ways.
        passive: Whether no side gives energy that it has not got, whatever the channel does.
        impedance: ``b`` of the waves [N s/m]; that of a follower that moves freely, its damping,
            reflects none.
        stiffness: K of the other couplings [N/m].
        damping: D of the other couplings [N s/m].
        force_share: Share of the other side's felt force, ``four_channel``.
        motion_scale: How far the follower moves by the leader's way.
        force_scale: What the leader feels of the follower's forces.
        smoothing: Time constant [s] of each of two lags by which what arrives is taken over;
            about half the jitter.
        velocity_smoothing: Time constant [s] of the side's own velocity.
        tank: What one side may give.
        rotation: How turns are coupled; null for three axes.
    """

    coupling: Annotated[str, OneOf(COUPLINGS)] = "waves"
    passive: bool = True
    impedance: Positive = 40.0
    stiffness: Positive = 1000.0
    damping: NotNegative = 40.0
    force_share: Annotated[float, Range(0.0, 1.0)] = 0.5
    motion_scale: Positive = 1.0
    force_scale: Positive = 1.0
    smoothing: NotNegative = 0.01
    velocity_smoothing: NotNegative = 0.004
    tank: PortTankParameters = field(default_factory=PortTankParameters)
    rotation: RotationParameters | None = None

    @property
    def axes(self) -> int:
        """Axes of leader and follower, 3 or 6."""
        return 3 if self.rotation is None else 6

    @property
    def moment_scale(self) -> float:
        """What the leader feels of the follower's moments.

        Work at the leader is then in one ratio to that at the follower, whatever turns or moves.
        """
        turned = 1.0 if self.rotation is None else self.rotation.scale
        return self.force_scale * turned / self.motion_scale

    def per_axis(self, name: str) -> ca.DM:
        """Return a number for each axis, shape (axes,).

        Args:
            name: ``impedance``, ``stiffness`` or ``damping``; ``wave``: ``sqrt(2b)``; ``refill``:
                damping where a tank is empty, for turns in the ratio of the impedances.
        """
        if name == "wave":
            return ca.sqrt(2.0 * self.per_axis("impedance"))
        linear = self.tank.refill if name == "refill" else getattr(self, name)
        if self.rotation is None:
            return ca.DM([linear] * 3)
        ratio = self.rotation.impedance / self.impedance
        turning = ratio * linear if name == "refill" else getattr(self.rotation, name)
        return ca.DM([linear] * 3 + [turning] * 3)


@dataclass(frozen=True)
class PortLimits(Parameters):
    """What a port may count on, of what it moves.

    Attributes:
        force: Largest force that it gives [N].
        speed: Largest speed of what it moves [m/s].
        ticks_late: Ticks after which its force acts.
        period: Sampling time [s].
        moment: Largest moment that it gives [Nm], where it turns something.
        turning: Largest angular velocity of what it moves [rad/s].

    Raises:
        InputError: If a number is out of range.
    """

    force: Positive
    speed: Positive
    ticks_late: Annotated[int, Range(0, 10)]
    period: Positive
    moment: NotNegative = 0.0
    turning: NotNegative = 0.0

    @property
    def reserve(self) -> float:
        """Most energy that forces take which are given and still to act [J]."""
        power = self.force * self.speed + self.moment * self.turning
        return power * self.period * (1 + self.ticks_late)

    @property
    def pledged(self) -> float:
        """What of the reserve forces may take that are given already, at least half of it [J]."""
        return self.reserve * max(0.5, self.ticks_late / (1 + self.ticks_late))
