"""Drives that jump from one of their limits to the other, and back."""

import numpy as np

# s, in which turns are forgotten
_FORGETTING = 0.2


class Chatter:
    """Finds drives that are at both of their limits in turns.

    A loop that has become unstable in the frequencies of its own sampling asks for more torque at
    every turn until the drives give all they have, one way and the other: it stays in bounds, and
    no drive is at one limit for long. So the turns are counted, from one limit to the other; in
    between, a drive may be anywhere. They are forgotten with a time constant of 0.2 s, so that a
    drive that swings at f Hz counts ``0.4 f`` in the end, beyond ``turns`` for all f above
    ``2.5 turns`` Hz. A reversal at full torque, even with an overshoot, has one or two.

    Args:
        num_drives: N.
        turns: From how many on a drive chatters, positive; infinite for never.
        period: Sampling time [s].

    Attributes:
        size: Length of the memory, which belongs to the caller; zeros at the start.
    """

    def __init__(self, num_drives: int, turns: float, period: float) -> None:
        self.size, self._n, self._turns = 2 * num_drives, num_drives, turns
        self._decay = float(np.exp(-period / _FORGETTING))

    def advance(self, memory: np.ndarray, drive: np.ndarray, limits: np.ndarray) -> np.ndarray:
        """Return the next memory: at which limit each drive was last, -1, 0 or 1, and its turns.

        Args:
            memory: Of this object, shape (size,).
            drive: What the drives are told, shape (N,).
            limits: Of these, shape (N,).
        """
        side = np.where(np.abs(drive) >= limits, np.sign(drive), 0.0)
        last, turns = memory[: self._n], self._decay * memory[self._n :]
        return np.concatenate([np.where(side, side, last), turns + (side * last < 0.0)])

    def chattering(self, memory: np.ndarray) -> np.ndarray:
        """Return which drives chatter, shape (N,).

        Args:
            memory: Of this object, shape (size,).
        """
        return np.asarray(memory[self._n :] >= self._turns)
