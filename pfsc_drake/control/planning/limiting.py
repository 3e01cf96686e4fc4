"""Active limits along a motion."""

from dataclasses import dataclass

import numpy as np

# kinds of limits
KINDS = ("torque", "speed", "rate", "velocity")
# share of a limit from which on it counts as active
_AT = 0.97


@dataclass(frozen=True)
class Limiting:
    """Shares of all limits at every sample of a motion.

    Attributes:
        names: ``torque_1``, .., ``speed_1``, .., ``rate_1``, .., ``velocity``: limits of drives
            1..N, of torques, joint speeds and rates of torques, and of the tool.
        shares: Share of each limit that the motion uses, shape (samples, limits).
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
        restraint_ratio: np.ndarray | float = 0.0,
    ) -> "Limiting":
        """Return the shares of a motion.

        Args:
            demand: Torques and joint speeds at evenly spaced samples, shape (samples, 2N).
            allowed: Allowed torques and joint speeds, of the same shape.
            tick: Samples from one command to the next, and its time [s].
            torque_rate: Largest rates of torques, shape (N,).
            velocity: Share of the largest tool velocity, shape (samples,).
            restraint_ratio: Share of the joint speeds at which the posture task is restrained,
                shape (samples, N).
        """
        n = demand.shape[1] // 2
        samples, period = tick
        later = np.minimum(np.arange(len(demand)) + samples, len(demand) - 1)
        rates = np.abs(demand[later, :n] - demand[:, :n]) / period
        used = np.abs(demand) / allowed
        used[:, n:] = np.maximum(used[:, n:], restraint_ratio)
        shares = [used, rates / torque_rate, velocity[:, None]]
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
        """Number of the active limit from 1 on, 0 for none, shape (samples,)."""
        return np.where(self.largest >= _AT, 1 + self.shares.argmax(axis=1), 0)

    def path_shares(self, travel: np.ndarray) -> dict[str, float]:
        """Return the share of the path on which each limit, or ``none``, is active, if above 0.

        Args:
            travel: Distance of the tool at each sample, shape (samples,).
        """
        parts = np.bincount(self.active, travel, len(self.names) + 1) / travel.sum()
        found = zip(["none", *self.names], parts.tolist(), strict=True)
        return {name: part for name, part in found if part > 0.0}
