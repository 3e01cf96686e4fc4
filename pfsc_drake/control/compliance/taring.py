"""The bias of a force/torque sensor, found while nothing pushes; components that stand still."""

from types import MappingProxyType
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.cases import all_of, any_of, where

# s, over whose means a sensor is judged to be quiet
TARING_BLOCK = 0.01


class Taring:
    """The sensor's bias as the mean of a quiet stretch of residuals.

    Quiet is judged by means over blocks of samples. Noise does not matter then, and neither do the
    strokes of drives that creep against their friction: an arm that holds a load which nobody
    told it of does so for seconds, at rest but for the last increments of its encoders, and what
    the tool's inertia is believed to do at every one of them is a spike of a sample or two. What
    pushes or moves the tool lasts longer than a block. The first block is judged, but does not
    count for the bias: what came before it, a start for instance, may still fade in it.

    What is remembered of a stretch (:attr:`states`) is the number of its samples, their sum, the
    lowest and the highest mean of a block, and the sum of the block that is not full; all zero is
    the empty one. It starts anew, with the last block, whenever the means differ too much, so that
    taring goes on until it is quiet.

    Args:
        samples: Number of samples in a stretch.
        largest_spread: Largest difference of means in it, shape (6,) [N, Nm].
        largest_bias: Largest mean that is believed, shape (6,) [N, Nm].
        block: Number of samples in a block; a stretch is made of whole ones.
    """

    states: ClassVar = MappingProxyType(
        {
            "taring_count": 1,
            "taring_sum": 6,
            "taring_lowest": 6,
            "taring_highest": 6,
            "taring_block": 6,
        }
    )

    def __init__(
        self,
        samples: int,
        largest_spread: np.ndarray,
        largest_bias: np.ndarray,
        block: int = 1,
    ) -> None:
        self._block = min(block, samples)
        self._samples = -(-samples // self._block) * self._block
        self._only_judged = self._block if 1 < self._block < self._samples else 0
        self._largest_spread = ca.DM(np.asarray(largest_spread, dtype=float))
        self._largest_bias = ca.DM(np.asarray(largest_bias, dtype=float))

    def extended(self, x: Values, residual: Any) -> Values:
        """Return a stretch with one more residual; only its last block if that differs.

        Args:
            x: The stretch.
            residual: Shape (6,) [N, Nm].
        """
        count, block = x.taring_count + 1.0, x.taring_block + residual
        total = where(x.taring_count >= self._only_judged, x.taring_sum + residual, x.taring_sum)
        mean, is_first = block / self._block, count <= self._block
        lowest = where(is_first, mean, ca.fmin(x.taring_lowest, mean))
        highest = where(is_first, mean, ca.fmax(x.taring_highest, mean))
        is_full = ca.fmod(count, self._block) == 0.0
        differs = all_of(is_full, any_of(highest - lowest > self._largest_spread))
        anew = ca.DM.zeros(6) if self._only_judged else block
        return Values(
            taring_count=where(differs, self._block, count),
            taring_sum=where(differs, anew, total),
            taring_lowest=where(is_full, where(differs, mean, lowest), x.taring_lowest),
            taring_highest=where(is_full, where(differs, mean, highest), x.taring_highest),
            taring_block=where(is_full, 0.0, block),
        )

    def bias(self, x: Values) -> tuple[Any, Any, Any]:
        """Return the bias, whether the stretch is long enough, and whether it is believed.

        Args:
            x: The stretch.

        Returns:
            The mean, shape (6,) [N, Nm], and two conditions, shape (1,): where the first does not
            hold, the others mean nothing; where the second does not, the stretch is to be thrown
            away.
        """
        mean = x.taring_sum / (x.taring_count - self._only_judged)
        is_believed = all_of(ca.fabs(mean) <= self._largest_bias)
        return mean, x.taring_count >= self._samples, is_believed


# s, for which a component has to move first, and to stand still then
STILL_TIME = 0.05
# other components that must move, and samples within which they must have changed
_OTHERS, _LATELY = 3, 3


def memory_size(size: int) -> int:
    """Return the number of values that are remembered of a measurement of as many components."""
    return 3 * size


def stands_still(
    measured: ca.SX, memory: ca.SX, at_range: ca.SX, samples: int, noisy: np.ndarray
) -> tuple[ca.SX, ca.SX]:
    """Return whether components of a sensor stand still that should not.

    One stands still when it has been the same, to the last bit, for so many samples. With noise
    larger than its steps none ever does, so the sensor is broken if more than three do that have
    some. One is enough if at least three others changed within the last three samples; there only
    components count that changed at each of as many samples in a row before. What is constant
    anyway, as without noise, never did; and a sensor at rest with coarse steps repeats its values,
    too, but in all components.

    Args:
        measured: The measurement, shape (n,).
        memory: ``[last measurement, samples for which it stayed, samples at which it changed]``
            of each component, shape (3n,); zero before the first.
        at_range: Whether each is at the end of its range, where it stays, shape (n,).
        samples: Number of samples.
        noisy: Whether each is believed to have noise larger than its steps, shape (n,).

    Returns:
        0 or 1, and the next memory.
    """
    last, stayed, changed = ca.vertsplit(memory, measured.numel())
    same = ca.logic_and(measured == last, ca.logic_not(at_range))
    counts = changed >= samples
    stayed = ca.if_else(same, stayed + 1.0, 0.0)
    # once it counts it goes on to
    changed = ca.if_else(counts, changed, ca.if_else(same, 0.0, changed + 1.0))
    moving = ca.logic_and(counts, stayed < _LATELY)
    still = ca.logic_and(counts, stayed >= samples)
    one = ca.logic_and(ca.sum1(still) > 0, ca.sum1(moving) >= _OTHERS)
    most = ca.dot(stayed >= samples, ca.DM(np.asarray(noisy, dtype=float))) > _OTHERS
    return ca.logic_or(one, most), ca.vertcat(measured, stayed, changed)
