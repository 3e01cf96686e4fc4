"""Which limit a motion is at, and where."""

from dataclasses import dataclass

import numpy as np

# of limits
KINDS = ("torque", "speed", "rate", "velocity")
# of a limit, from which on a motion is at it
_AT = 0.97


@dataclass(frozen=True)
class Limiting:
    """What limits a motion, at every sample.

    Attributes:
        names: ``torque_1``, .., ``speed_1``, .., ``rate_1``, .., ``velocity``: limits of drives
            1..N, of torques, joint speeds and rates of torques, and of the tool.
        shares: What the motion takes of each, shape (samples, limits).
    """

    names: list[str]
    shares: np.ndarray

    @classmethod
    def of(
        cls,
        demand: np.ndarray,
        allowed: np.ndarray,
        tick: tuple[int, float],
        torque_rate: np.ndarray,
        velocity: np.ndarray,
        held_back: np.ndarray | float = 0.0,
    ) -> "Limiting":
        """Return what limits a motion.

        Args:
            demand: Torques and joint speeds that it asks for, even samples, shape (samples, 2N).
            allowed: What it may, of the same shape.
            tick: Samples from one command to the next, and its time [s].
            torque_rate: Largest rates of torques, shape (N,).
            velocity: What it takes of the largest velocity of the tool, shape (samples,).
            held_back: What it takes of the joint speeds from which on a posture is held back, shape
                (samples, N).
        """
        n = demand.shape[1] // 2
        samples, period = tick
        later = np.minimum(np.arange(len(demand)) + samples, len(demand) - 1)
        rates = np.abs(demand[later, :n] - demand[:, :n]) / period
        taken = np.abs(demand) / allowed
        taken[:, n:] = np.maximum(taken[:, n:], held_back)
        shares = [taken, rates / torque_rate, velocity[:, None]]
        kinds = [f"{kind}_{i + 1}" for kind in KINDS[:-1] for i in range(n)]
        return cls([*kinds, KINDS[-1]], np.concatenate(shares, axis=1))

    @property
    def largest(self) -> np.ndarray:
        """Share of the tightest limit, shape (samples,)."""
        return np.asarray(self.shares.max(axis=1))

    @property
    def by_kind(self) -> np.ndarray:
        """Largest share of each of the ``KINDS``, shape (samples, 4)."""
        n = self.shares.shape[1] // 3
        parts = np.split(self.shares, [n, 2 * n, 3 * n], axis=1)
        return np.stack([part.max(axis=1) for part in parts], axis=1)

    @property
    def active(self) -> np.ndarray:
        """Number of the limit that the motion is at, from 1 on, 0 for none, shape (samples,)."""
        return np.where(self.largest >= _AT, 1 + self.shares.argmax(axis=1), 0)

    def of_the_way(self, way: np.ndarray) -> dict[str, float]:
        """Return on what share of the way each limit is the one, and ``none``; those that are.

        Args:
            way: Length that the tool goes at each sample, shape (samples,).
        """
        parts = np.bincount(self.active, way, len(self.names) + 1) / way.sum()
        found = zip(["none", *self.names], parts.tolist(), strict=True)
        return {name: part for name, part in found if part > 0.0}
