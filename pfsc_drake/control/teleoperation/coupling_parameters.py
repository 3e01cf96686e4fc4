"""Parameters of the coupling between leader and follower, and of its passivity."""

from dataclasses import dataclass, field
from typing import Annotated

import casadi as ca

from pfsc_drake.errors import require
from pfsc_drake.yaml.rules import NotNegative, OneOf, Parameters, Positive, Range

COUPLINGS = ("waves", "position_force", "four_channel")


@dataclass
class PortTankParameters(Parameters):
    """Energy tank of one side: the energy that it may output beyond its input [J].

    Attributes:
        capacity: Largest content of the tank [J].
        initial: Initial content [J]; below it the side damps its motion.
        refill: This damping at an empty tank [N s/m].
        share: Share of the content above ``initial`` that a side sends per second [1/s]; with waves
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
    """Coupling of rotations, three additional axes about the world axes.

    Attributes:
        impedance: Wave impedance ``b`` [Nm s/rad].
        stiffness: Stiffness K of the other couplings [Nm/rad].
        damping: Damping D of the other couplings [Nm s/rad].
        scale: Rotation of the follower per rotation of the leader.
    """

    impedance: Positive = 1.0
    stiffness: Positive = 20.0
    damping: NotNegative = 1.0
    scale: Positive = 1.0


@dataclass
class CouplingParameters(Parameters):
    """Coupling of leader and follower, in lengths and forces of the follower.

    Attributes:
        coupling: ``waves``: each side sends a wave, and no more energy than its own;
            ``position_force``: a spring draws the follower to the leader's position, the leader
            feels its force; ``four_channel``: positions and measured forces in both directions.
        passive: Whether each side is passive for any delay and loss in the channel.
        impedance: Wave impedance ``b`` [N s/m]; no wave is reflected where it equals the damping
            of the freely moving follower.
        stiffness: Stiffness K of the other couplings [N/m].
        damping: Damping D of the other couplings [N s/m].
        force_share: Reflected share of the other side's measured force, ``four_channel``.
        motion_scale: Motion of the follower per motion of the leader.
        force_scale: Force at the leader per force at the follower.
        smoothing: Time constant [s] of each of the two lags on the received signal; about half the
            jitter.
        velocity_smoothing: Time constant [s] of the filter on the side's own velocity.
        tank: Energy tank of a side.
        rotation: Coupling of rotations; null for three axes.
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
        """Moment at the leader per moment at the follower.

        The ratio of work at leader and follower is then the same for rotation and translation.
        """
        turned = 1.0 if self.rotation is None else self.rotation.scale
        return self.force_scale * turned / self.motion_scale

    def per_axis(self, name: str) -> ca.DM:
        """Return a number for each axis, shape (axes,).

        Args:
            name: ``impedance``, ``stiffness`` or ``damping``; ``wave``: ``sqrt(2b)``; ``refill``:
                damping at an empty tank, for rotations in the ratio of the impedances.
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
    """Limits of a port and of the body that it moves.

    Attributes:
        force: Largest force of the port [N].
        speed: Largest speed of the body [m/s].
        ticks_late: Number of ticks after which the force acts.
        period: Sampling time [s].
        moment: Largest moment of the port [Nm], with six axes.
        turning: Largest angular velocity of the body [rad/s].

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
        """Largest work of the commanded forces that are still to act [J]."""
        power = self.force * self.speed + self.moment * self.turning
        return power * self.period * (1 + self.ticks_late)

    @property
    def pending_reserve(self) -> float:
        """Part of the reserve for forces commanded before, at least half of it [J]."""
        return self.reserve * max(0.5, self.ticks_late / (1 + self.ticks_late))
