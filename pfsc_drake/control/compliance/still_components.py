"""Components of a measurement that stand still and should not, as those of a broken sensor."""

import casadi as ca
import numpy as np

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
